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
