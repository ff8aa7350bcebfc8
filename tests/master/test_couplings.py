"""What couplings choose by: sizes of pieces, their growth with the error, and the same choices in C."""

from typing import Any

import numpy as np
import pytest
from oscillators import BOND, Tiny, oscillator

from cosim.master.loop.coupling import _fitting, _growth
from cosim.system.algorithm import Energy, Iterated


@pytest.mark.parametrize("error", [0.03, 0.4, 1.0, 3.0, 20.0])
@pytest.mark.parametrize("before", [0.02, 0.7, 5.0])
def test_a_piece_grows_by_the_error_and_by_how_it_changed_within_bounds(before: float, error: float) -> None:
    """A PI controller of the step: 0.9 error^(-3/8) before^(1/4), between a fifth and one and a half."""
    assert _growth(before, error) == pytest.approx(np.clip(0.9 * error**-0.375 * before**0.25, 0.2, 1.5), rel=1e-14)


def test_a_piece_without_an_error_grows_most_and_the_first_has_none_before_it() -> None:
    assert _growth(0.5, 0.0) == 1.5
    assert _growth(0.0, 2.0) == pytest.approx(0.9 * 2**-0.125, rel=1e-14)


@pytest.mark.parametrize("most", [1, 2, 8, 16])
def test_a_piece_is_the_largest_power_of_two_that_fits_its_size_and_its_place(most: int) -> None:
    for size in (1.0, 1.99, 2.0, 3.5, 4.0, 7.9, 8.0, 16.0, 40.0):
        for position in range(most):
            fits = [2**k for k in range(5) if 2**k <= min(size, most) and position % 2**k == 0]
            assert _fitting(size, position, most) == max(fits)


@pytest.mark.parametrize(
    "algorithm",
    [
        *(
            Energy(kind="energy", bonds=BOND, tolerance=tolerance, max_pieces=most)
            for tolerance, most in ((1e-3, 1), (1e-3, 64), (1e-5, 4), (3e-7, 1024))
        ),
        *(
            Iterated(kind="iterated", theta=theta, tolerance=tolerance)
            for theta, tolerance in ((0.0, 1e-3), (0.3, 1e-6), (1.0, 1e-14))
        ),
    ],
)
def test_python_and_c_take_the_same_pieces_and_rounds_to_the_same_bits(plain: Tiny, algorithm: Any) -> None:
    """Stiff, soft and at rest until its first row: each way the power on the bond is another."""
    for version, k in ((2, 0.3), (3, 7.0)):
        parameters = {"mass": {"k": k}, "spring": {"k": k}}
        one, other = (
            oscillator(plain[version], algorithm, ticks=40, compiled=compiled, parameters=parameters, decimation=3)
            for compiled in (True, False)
        )
        assert one.statistics["coupling"] == other.statistics["coupling"]
        assert one.statistics["notes"] == [note for note in other.statistics["notes"] if "ran in Python" not in note]
        for name in one.recording:
            np.testing.assert_array_equal(one.recording[name], other.recording[name])


def test_a_coupling_at_rest_takes_the_fewest_pieces_and_rounds(plain: Tiny) -> None:
    """Nothing moves, so nothing is lost: the first tick begins with one piece of 8, then pieces grow by half."""
    algorithm = Energy(kind="energy", bonds=BOND, tolerance=1e-6, max_pieces=8)
    for compiled in (True, False):
        run = oscillator(plain[3], algorithm, ticks=20, compiled=compiled, parameters={"mass": {"k": 0.0}})
        (effort,) = run.statistics["coupling"]
        sizes, size, position = [], 1.0, 0
        while sum(sizes) < 20 * 8:
            sizes.append(_fitting(size, position, 8))
            position, size = (position + sizes[-1]) % 8, min(1.5 * size, 8.0)
        assert effort["rounds"] == len(sizes)
        assert effort["greatest"] == max(np.unique(np.cumsum([0, *sizes[:-1]]) // 8, return_counts=True)[1])
        assert effort["at_limit"] == 0
    iterated = oscillator(plain[3], Iterated(kind="iterated"), ticks=20, parameters={"mass": {"k": 0.0}})
    assert iterated.statistics["coupling"] == [{"rounds": 20, "greatest": 1, "at_limit": 0}]
