"""What comes in bursts: a floor that trembles now and then is missing; noise of one size, and single jolts, are not."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from motions import RATE, Array, Motion

from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores
from cosim.diagnosis.decide.decision import IN_BURSTS, decide
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.bursts import ABOVE, burst_share

SECONDS = 40
T = np.arange(SECONDS * RATE) / RATE


def comparing(v: Array, scale: float = 1.0, weight: Array | None = None) -> Any:
    motion = Motion({"v": [v, v]})
    motion.cutoff = 20.0  # type: ignore[attr-defined]
    counted = np.ones(2 * len(v)) if weight is None else weight
    problem = SimpleNamespace(prepared=motion, weight=counted)
    rows = SimpleNamespace(slices=(slice(0, len(v)), slice(len(v), 2 * len(v))))
    return SimpleNamespace(problem=problem, bands=rows, noise=SimpleNamespace(at=lambda v: np.full(len(v), scale)))


def noise(size: Array | float = 1.0, seed: int = 1) -> Array:
    return np.asarray(size * np.random.default_rng(seed).standard_normal(SECONDS * RATE))


def share(rest: Array, *, scale: float = 1.0, weight: Array | None = None) -> float:
    found: Any = SimpleNamespace(residual=np.concatenate([rest, noise(scale, seed=2)]))
    return burst_share(comparing(np.ones(len(rest)), scale, weight), found)


def test_noise_of_one_size_has_none_whatever_its_colour_and_size() -> None:
    coloured = np.convolve(noise(), np.ones(20) / np.sqrt(20), "same")
    assert share(noise()) == 0
    assert share(noise(50.0), scale=50.0) == 0
    assert share(coloured) < 0.02


def test_noise_that_is_larger_for_some_seconds_comes_in_bursts() -> None:
    loud = noise(np.where((T > 10) & (T < 14), 10.0, 1.0))
    energy = 4 * 100.0  # of 476 in all, each window of it less three of the usual
    assert share(loud) == pytest.approx((energy - 4 * ABOVE) / (energy + 76), rel=0.05)
    assert share(loud) > POLICY.small
    assert share(np.where(T < 30, loud, noise(seed=3))) == pytest.approx(share(loud), rel=0.02)


def test_a_single_window_that_stands_out_is_a_jolt() -> None:
    assert share(noise(np.where((T >= 10) & (T < 11), 30.0, 1.0))) == 0


def test_what_wanders_slowly_is_no_burst() -> None:
    assert share(noise() + 20 * np.sin(2 * np.pi * T / 40)) < 0.1


def test_what_goes_with_the_motion_is_no_burst() -> None:
    fast = np.where(T % 12 < 6, 1.0, 5.0)
    found: Any = SimpleNamespace(residual=np.concatenate([noise(fast), noise(fast, seed=2)]))
    assert burst_share(comparing(fast), found) < 0.02
    assert burst_share(comparing(np.ones(len(T))), found) > POLICY.small


def test_only_clear_motion_that_has_weight_counts() -> None:
    loud = noise(np.where((T > 10) & (T < 14), 10.0, 1.0))
    weight = np.ones(2 * len(loud))
    weight[: len(loud)][(T > 9) & (T < 15)] = 0
    assert share(loud, weight=weight) == 0
    found: Any = SimpleNamespace(residual=np.concatenate([loud, noise(seed=2)]))
    still = np.where((T > 9) & (T < 15), 1e-6, 1.0)
    assert burst_share(comparing(still), found) == 0


def test_too_few_windows_tell_nothing() -> None:
    weight = np.zeros(2 * len(T))
    weight[: 19 * RATE] = 1
    assert share(noise(np.where(T < 4, 10.0, 1.0)), weight=weight) == 0
    weight[: 21 * RATE] = 1
    assert share(noise(np.where(T < 4, 10.0, 1.0)), weight=weight) > 0.5


def test_bursts_are_unknown_and_take_nothing_from_a_name() -> None:
    one = EffectScores("cogging", 50.0, {"delay": 9.0}, {"cogging": 0.5, "delay": 0.1}, 20.0, 0.5)
    quiet = ResidualScores(0.0, 0.0, in_bursts=POLICY.small)
    loud = replace(quiet, in_bursts=1.001 * POLICY.small)
    named, shaken = (decide(Scores([one], left), POLICY) for left in (quiet, loud))
    assert not named.is_unknown
    assert shaken.is_unknown
    assert shaken.depends_on == (IN_BURSTS,)
    assert (shaken.sets, shaken.probabilities, shaken.doubtful) == (named.sets, named.probabilities, ())


def test_a_friction_level_that_is_another_for_some_seconds_is_no_burst() -> None:
    """It changes with the direction, several times in a window, and shakes nothing."""
    way = np.where(np.sin(2 * np.pi * 3 * T) >= 0, 1.0, -1.0)
    level = np.where((T > 10) & (T < 14), 8.0 * way, 0.0)
    found: Any = SimpleNamespace(residual=np.concatenate([noise() + level, noise(seed=2)]))
    assert burst_share(comparing(way), found) < 0.02
    shaken: Any = SimpleNamespace(residual=np.concatenate([noise() + np.abs(level) * noise(seed=3), noise(seed=2)]))
    assert burst_share(comparing(way), shaken) > POLICY.small
