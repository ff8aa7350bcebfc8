"""The step of an encoder is found where readings are rounded, and nowhere else."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.data.recording import Recording
from cosim.data.resolution import resolution
from cosim.data.single_readings import cleaned

Array = npt.NDArray[np.float64]
T = np.arange(20_000) / 1000


def wave(period: float, t: Array = T) -> Array:
    """Ramps up and down between 0 and 1."""
    return np.abs((t / period) % 2 - 1)


def multisine(t: Array = T, phase: float = 0.0) -> Array:
    return sum(
        (a * np.sin(2 * np.pi * f * t + phase * f) for a, f in ((0.3, 0.11), (0.12, 0.27), (0.036, 0.63))), 0 * t
    )


def strokes() -> Array:
    """Constant accelerations and constant speeds, integrated exactly."""
    one = np.concatenate([np.full(200, 1.0), np.zeros(600), np.full(200, -1.0), np.zeros(500)])
    speed = np.cumsum(np.tile(np.concatenate([one, -one]), 6)) / 1000
    return np.cumsum(speed) / 1000


def steady_speeds() -> Array:
    """A friction test: speeds that are multiples of each other, up and down, read to 1e-7 rad."""
    speeds = np.repeat([0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.4, -0.4], 2500)
    return np.cumsum(speeds) / 1000 + np.random.default_rng(1).normal(0, 1e-7, len(speeds))


MOTIONS: dict[str, Callable[[], Array]] = {
    "ramp": lambda: 0.1 * T,
    "ramp of a whole turn a second": lambda: 2 * np.pi * T,
    "ramps that turn": lambda: wave(1.0),
    "fast ramps that turn": lambda: wave(0.013),
    "sum of a ramp and ramps that turn": lambda: 0.1 * T + 0.3 * wave(3.0),
    "sum of ramps that turn": lambda: 0.1 * wave(1.0) + 0.21 * wave(0.7),
    "steady speeds": steady_speeds,
    "strokes": strokes,
    "parabolas": lambda: np.sign(T % 2 - 1) * (T % 2 - 1) ** 2,
    "sine of 1 Hz": lambda: np.sin(2 * np.pi * T),
    "sine of 5 Hz": lambda: np.sin(2 * np.pi * 5 * T),
    "several sines": multisine,
    "several sines and noise": lambda: multisine() + np.random.default_rng(2).normal(0, 1e-5, len(T)),
    "steady speed, held for 20 ms": lambda: 57 * np.floor(T / 0.02) * 0.02,
    "ramps that turn, held for 10 ms": lambda: wave(2.0, np.floor(T / 0.01 + 1e-9) * 0.01),
    "several sines, held for 20 ms": lambda: multisine(np.floor(T / 0.02 + 1e-9) * 0.02),
    "nearly steady speed, held for 20 ms": lambda: (
        57 * (1 + 0.01 * np.sin(T[::20] / 3)).cumsum().repeat(20) * 0.02 + 1e-3 * wave(0.31, T[::20]).repeat(20)
    ),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_that_is_not_rounded_has_no_step(name: str) -> None:
    assert resolution(MOTIONS[name]()) == 0


@settings(max_examples=30, deadline=None)
@given(
    share=st.floats(1e-4, 3e-2),
    phase=st.floats(0, 6),
    noise=st.sampled_from([0.0, 1e-5, 1e-3]),
    unit=st.sampled_from([1.0, 1e-3, 57.2957795]),
)
def test_a_rounded_motion_has_its_step_whatever_its_size(share: float, phase: float, noise: float, unit: float) -> None:
    motion = multisine(phase=phase) + np.random.default_rng(3).normal(0, noise, len(T))
    step = share * float(np.ptp(motion))
    assert resolution(unit * step * np.round(motion / step)) == pytest.approx(unit * step, rel=1e-6)


@pytest.mark.parametrize("name", ["ramp", "ramps that turn", "strokes", "steady speeds", "sum of ramps that turn"])
@pytest.mark.parametrize("share", [1e-3, 4e-3, 2e-2])
def test_a_rounded_ramp_has_its_step(name: str, share: float) -> None:
    motion = MOTIONS[name]()
    step = 1.234 * share * float(np.ptp(motion))
    assert resolution(step * np.round(motion / step)) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("rate", [0.0729, 0.0611, 0.313])
def test_an_encoder_that_counts_at_a_steady_rate_has_its_step(rate: float) -> None:
    """A telescope at sidereal rate counts almost as regularly as a held reading is refreshed."""
    assert resolution(1e-3 * np.round(rate * T / 1e-3)) == pytest.approx(1e-3, rel=1e-6)


def run(q: Array) -> Recording:
    return Recording("run", {"t": T, "tau": multisine(phase=1.0), "q": q})


def at_rest_then_fast(count: float) -> Array:
    """An axis that rests on a count and shows its neighbour now and then, and at last moves by many counts a row."""
    q = count * np.round(np.where(T < 16, 0.0, 1e5 * (T - 16) ** 2))
    for row, rows in ((700, 1), (4000, 2), (9000, 3), (15_000, 1)):
        q[row : row + rows] -= count
    return q


@pytest.mark.parametrize("count", [2e-6, 1e-3])
def test_a_single_count_at_rest_is_no_false_reading(count: float) -> None:
    assert cleaned(run(at_rest_then_fast(count))).notes == ()


def test_a_reading_far_from_rest_is_false_still() -> None:
    q = at_rest_then_fast(1e-3)
    q[5000] = 0.5
    (note,) = cleaned(run(q)).notes
    assert "row 5,001" in note
