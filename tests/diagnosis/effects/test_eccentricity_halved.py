"""A disc of half the turns whose error twice a turn is that of the disc that was found."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.diagnosis.effects.encoder_eccentricity import halved
from pyfmi_models.effects.base import Motion
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity


def problem(middle: float, motion: str) -> Any:
    """What the search knows: where the axis was, and whether it turns."""
    prepared = SimpleNamespace(ranges={"q": (middle - 0.5, middle + 0.5)})
    return SimpleNamespace(mount=SimpleNamespace(motion=motion), prepared=prepared)


def twice_a_turn(disc: EncoderEccentricity, angle: np.ndarray) -> np.ndarray:
    """The second harmonic of a disc's error, as its docstring has it, at an angle in rad (a place in m times 2 pi)."""
    return np.asarray(disc.second * disc.amplitude_rad * np.sin(2 * (disc.cycles_per_rev * angle + disc.phase)))


@pytest.mark.parametrize("motion", ["rotary", "linear"])
@pytest.mark.parametrize("phase", [0.0, 0.8, -2.5])
@pytest.mark.parametrize("cycles", [12.0, 13.0])
def test_the_error_twice_a_turn_of_half_the_turns_is_the_error_that_was_found(
    motion: str, phase: float, cycles: float
) -> None:
    """In the middle of what was visited, and everywhere where the turns can be halved."""
    disc = EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=3e-4, phase=phase)
    middle = 0.7
    found = halved(problem(middle, motion), disc)
    angle = (2 * np.pi if motion == "linear" else 1.0) * np.linspace(middle - 0.3, middle + 0.3, 61)
    error = disc.amplitude_rad * np.sin(cycles * angle + phase)
    whole = motion == "linear" or cycles % 2 == 0
    assert len(found) == 2
    for one in found:
        got = twice_a_turn(one, angle)
        np.testing.assert_allclose(got if whole else got[30], error if whole else error[30], rtol=0, atol=1e-12)


def test_the_two_starts_differ_in_the_sign_of_the_error_once_a_turn() -> None:
    disc = EncoderEccentricity(cycles_per_rev=12.0, amplitude_rad=3e-4, phase=0.8)
    one, other = (first_harmonic(each) for each in halved(problem(0.0, "rotary"), disc))
    np.testing.assert_allclose(one, -other, rtol=0, atol=1e-12)
    assert np.abs(one).max() == pytest.approx(1.5e-4, rel=1e-2)


def first_harmonic(disc: EncoderEccentricity) -> np.ndarray:
    angle = np.linspace(-1, 1, 201)
    motion = SimpleNamespace(angle=angle)
    read = [float(disc.reading(0.0, _at(motion, k))) for k in range(len(angle))]
    return np.array(read) - twice_a_turn(disc, angle)


def _at(motion: Any, k: int) -> Motion:
    found: Any = SimpleNamespace(angle=float(motion.angle[k]))
    return found  # type: ignore[no-any-return]


def test_an_axis_that_turns_has_whole_turns_and_at_least_one() -> None:
    for cycles, turns in ((1.0, 1.0), (5.0, 2.0), (7.0, 4.0), (12.0, 6.0)):
        disc = EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=3e-4)
        assert {one.cycles_per_rev for one in halved(problem(0.0, "rotary"), disc)} == {turns}
        assert {one.cycles_per_rev for one in halved(problem(0.0, "linear"), disc)} == {cycles / 2}
