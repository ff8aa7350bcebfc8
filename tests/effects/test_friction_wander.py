"""Friction that wanders: random as stated, and the same for the same seed."""

import casadi as ca
import numpy as np
import pytest

from pyfmi_models.effects import FrictionWander, Motion

clock = np.arange(0.013, 20, 0.02)


def levels(seeds: int, **numbers: float) -> np.ndarray:
    """Friction level over time, one row a seed, of a level that would be 1."""
    t, seed = ca.SX.sym("t"), ca.SX.sym("seed")
    effect = FrictionWander(**({"std": 0.0} | numbers), seed=seed)
    level = ca.Function("level", [t, seed], [effect.level(1.0, Motion(t, 0.0, 0.0, 0.0))]).map(len(clock))
    return np.array([level(ca.DM(clock).T, float(one)).full().ravel() for one in range(seeds)])


def test_the_slow_part_has_the_spread_and_the_memory_it_was_given() -> None:
    """An Ornstein-Uhlenbeck process forgets as exp(-lag / T); eight sines do so within a tenth."""
    found = levels(200, std=0.16, correlation_time=0.5) - 1
    assert found.mean() == pytest.approx(0, abs=5e-3)
    assert found.std() == pytest.approx(0.16, rel=0.03)
    for lag in (0.1, 0.3, 0.5, 1.0):
        ticks = round(lag / 0.02)
        memory = np.mean(found[:, :-ticks] * found[:, ticks:]) / found.var()
        assert memory == pytest.approx(np.exp(-lag / 0.5), abs=0.1)


def test_jumps_have_their_spread_and_their_period_and_no_memory() -> None:
    found = levels(400, jump_std=0.1, jump_period=2.0) - 1
    held = [found[:, (clock > 2 * k + 0.1) & (clock < 2 * k + 1.99)] for k in range(10)]
    assert max(np.ptp(one, axis=1).max() for one in held) < 1e-12
    drawn = np.array([one[:, 0] for one in held])
    assert drawn.std() == pytest.approx(0.1, rel=0.03)
    assert np.abs(drawn).max() <= 0.1 * np.sqrt(3)
    assert np.abs(np.corrcoef(drawn) - np.eye(10)).max() < 0.2
    assert abs(np.corrcoef(drawn[:, :-1].ravel(), drawn[:, 1:].ravel())[0, 1]) < 0.05  # neighbouring seeds


def test_another_seed_is_another_friction_and_the_same_seed_the_same() -> None:
    first, again = levels(3, std=0.2), levels(3, std=0.2)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first[0] - first[1]).max() > 0.1


def test_the_level_stays_positive_however_it_wanders() -> None:
    assert levels(50, std=0.5, jump_std=0.5).min() == 0.05
