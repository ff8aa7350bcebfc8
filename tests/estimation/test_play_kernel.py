"""Plays in C have the bits of the expressions that they write out."""

import numpy as np
import pytest

from cosim.estimation import play
from cosim.estimation.kernels import library
from cosim.estimation.play import stepped_torque
from pyfmi_models.effects.backlash import Backlash

DT = 1e-3
PLAY = Backlash(gap_rad=1e-3, load_friction=0.3, load_viscous=0.1)
SEVERAL = [
    PLAY,
    Backlash(gap_rad=0.0, load_friction=0.0),
    *(
        Backlash(gap_rad=gap, load_friction=2.0, contact_hz=20.0, load_deflection=1e-3)
        for gap in np.geomspace(1e-4, 1, 9)
    ),
]


def moved(rows: int = 5_000) -> tuple[np.ndarray, np.ndarray]:
    """Speed [rad/s] and acceleration at rows DT apart."""
    speed = np.cumsum(np.random.default_rng(7).normal(size=rows)) * 1e-3
    return speed, np.gradient(speed, DT) if rows > 1 else np.zeros(rows)


def interpreted(plays: list[Backlash], v: np.ndarray, a: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    with monkeypatch.context() as patch:
        patch.setattr(play, "library", lambda: None)
        return stepped_torque(plays, [5.0] * len(plays), v, a, DT)


def test_the_library_has_plays() -> None:
    assert hasattr(library(), "play_run")


@pytest.mark.parametrize("many", [1, 8, len(SEVERAL)])
def test_plays_in_c_have_the_bits_of_the_expressions(many: int, monkeypatch: pytest.MonkeyPatch) -> None:
    v, a = moved()
    found = stepped_torque(SEVERAL[:many], [5.0] * many, v, a, DT)
    assert found.shape == (many, len(v))
    assert np.array_equal(found, interpreted(SEVERAL[:many], v, a, monkeypatch))
    assert np.abs(found + 5.0 * a).max() > 0


def test_each_of_several_has_the_bits_of_it_alone() -> None:
    v, a = moved()
    found = stepped_torque(SEVERAL, [5.0] * len(SEVERAL), v, a, DT)
    alone = [stepped_torque([one], [5.0], v, a, DT)[0] for one in SEVERAL]
    assert np.array_equal(found, alone)
    assert not np.array_equal(found[0], found[1])


def test_a_speed_that_is_not_in_one_piece_of_memory_is_the_same() -> None:
    v, a = moved()
    apart = np.column_stack([v, a])
    assert np.array_equal(stepped_torque([PLAY], [5.0], apart[:, 0], a, DT), stepped_torque([PLAY], [5.0], v, a, DT))


def test_one_row_alone_passes_nothing_on() -> None:
    assert np.array_equal(stepped_torque([PLAY], [5.0], np.ones(1), np.zeros(1), DT), np.zeros((1, 1)))
