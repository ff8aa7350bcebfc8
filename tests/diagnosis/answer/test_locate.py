"""Regions say over what the missing torque changes, with bands; over the other axes they say "everywhere"."""

from collections.abc import Callable

import numpy as np
import pytest

from cosim.diagnosis.answer.result import Region, Trace
from cosim.diagnosis.measure.locate import regions

Array = np.ndarray


def trace(missing: Callable[[dict[str, Array]], Array], seed: int = 0) -> Trace:
    """Five minutes of moves to and fro of 3 s each, with rests of 0.5 to 8 s between, in a room that warms up."""
    rng, dt = np.random.default_rng(seed), 0.01
    v, rest = [], []
    for move in range(60):
        rested = float(rng.choice([0.5, 2.0, 8.0]))
        v += [np.zeros(round(rested / dt)), (-1) ** move * np.sin(np.pi * np.arange(dt, 3, dt) / 3) ** 2]
        rest.append(np.full(len(v[-2]) + len(v[-1]), rested))
    speed, rested = np.concatenate(v), np.concatenate(rest)
    t = dt * np.arange(len(speed))
    now = {"t": t, "v": speed, "rested": rested, "temperature": 10 + t / 20}
    noise = 0.05 * rng.standard_normal(len(t))
    zero = np.zeros_like(t)
    return Trace(
        name=f"run_{seed}", heldout=False, t=t, q=np.cumsum(speed) * dt, v=speed, tau=missing(now) + noise,
        before=zero, after=zero, missing=zero, band=zero, extras={"temperature": now["temperature"]},
    )  # fmt: skip


def over(axis: str, missing: Callable[[dict[str, Array]], Array]) -> Region:
    found = regions([trace(missing, 1), trace(missing, 2)], False, False)
    return next(region for region in found if region.axis == axis)


def changes(region: Region) -> bool:
    """Whether the ends of an axis differ by more than their bands."""
    seen = np.flatnonzero(np.isfinite(region.mean))
    low, high = seen[0], seen[-1]
    return abs(region.mean[low] - region.mean[high]) > region.band[low] + region.band[high] + 0.02


CAUSES: dict[str, Callable[[dict[str, Array]], Array]] = {
    "acceleration": lambda now: np.gradient(now["v"], now["t"]),
    "temperature": lambda now: (now["temperature"] - 10) / 10 * np.sign(now["v"]),
    "rest before a move": lambda now: 0.3 * np.log(now["rested"]) * np.sign(now["v"]),
    "speed": lambda now: now["v"],
}


@pytest.mark.parametrize("cause", CAUSES)
def test_the_missing_torque_changes_over_its_own_axis_and_what_is_everywhere_the_same_over_none(cause: str) -> None:
    assert changes(over(cause, CAUSES[cause]))
    assert not changes(over(cause, lambda now: 0 * now["t"]))


def test_a_tone_stands_in_its_band_of_frequency_with_its_rms() -> None:
    found = over("frequency", lambda now: np.sqrt(2) * np.sin(2 * np.pi * 6.3 * now["t"]))
    loudest = int(np.argmax(found.mean))
    assert loudest == np.argmin(np.abs(np.log(np.array(found.centres) / 6.3))), "the band whose middle is nearest"
    assert found.mean[loudest] == pytest.approx(1.0, rel=0.05)
    assert np.delete(found.mean, loudest).max() < 0.2


def test_without_rests_and_columns_these_axes_are_left_out() -> None:
    t = np.arange(3000) / 100
    zero = np.zeros_like(t)
    v = 1 + 0.5 * np.sin(t)
    one = Trace(name="r", heldout=False, t=t, q=np.cumsum(v), v=v, tau=v, before=zero, after=zero, missing=v, band=v)
    names = [region.axis for region in regions([one], False, False)]
    assert names == ["position", "speed", "direction", "acceleration", "time", "time since reversal", "frequency"]
