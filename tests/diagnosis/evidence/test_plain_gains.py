"""The plain held-out error of a real model in both bands: what errs in one of them alone does not stand."""

from functools import cache

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.decision import Gain, stands
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Cogging, Effect, TorqueOffset
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

SECONDS, RATE, NOISE = 40, 200, 0.1
NARROW, WIDE = 10.0, 30.0
CYCLES = 16.0 / 2 * 2 * np.pi
"""Of a ripple at 12 to 20 Hz where the axis turns at 2 rad/s: above the one band and below the other."""
FAST, SLOW = 0.08, 0.03


def axis(*effects: Effect) -> Mount:
    return Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0), effects=effects)


def ripple(amplitude: float) -> Cogging:
    return Cogging(cycles_per_rev=CYCLES, amplitude=abs(amplitude), phase=0.0 if amplitude > 0 else np.pi)


def offset(torque: float) -> TorqueOffset:
    return TorqueOffset(torque=torque)


def recorded(seed: int, fast: float, slow: float, hum: float = 0.0) -> Recording:
    """Steady turning with a ripple and an offset of these sizes; a hum at 20 Hz is in no model."""
    t = np.arange(SECONDS * RATE) / RATE
    q, v, a = 2 * t - np.cos(0.5 * t), 2 + 0.5 * np.sin(0.5 * t), 0.25 * np.cos(0.5 * t)
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(t))
    extra = fast * np.cos(CYCLES * q) + slow + hum * np.sin(2 * np.pi * 20 * t)
    return Recording("run", {"t": t, "q": q, "tau": 5 * a + 2 + v + extra + noise})


@cache
def held(fast: float, slow: float, hum: float = 0.0, band: float = NARROW) -> Predictive:
    """A recording with these in it, held out from a base that knows of none."""
    prepared = prepare([recorded(1, 0.0, 0.0)], band)
    problem = Problem(axis(), prepared, np.ones(len(prepared.recording_of)), 1 / RATE)
    base, runs = problem.fit(axis(), 10), [recorded(2, fast, slow, hum)]
    return Predictive.of(Comparison.of(problem, base, POLICY), prepare(runs, band), base, prepare(runs, WIDE))


def gains(this: Predictive, *effects: Effect) -> tuple[float, float]:
    return this.plain_gains(axis(), axis(*effects))


def is_vetoed(narrow: float, wide: float) -> bool:
    """Whether an effect that surely matters and predicts falls by these."""
    return not stands(Gain(2 * POLICY.clearly_predicted, narrow, wide), 0.5, POLICY)


def test_what_is_there_removes_error_in_its_own_band_and_raises_none() -> None:
    narrow, wide = gains(held(FAST, 0.0), ripple(FAST))
    assert abs(narrow) < 0.02 < 0.3 < wide
    assert not is_vetoed(narrow, wide)


@pytest.mark.parametrize("times", [1.0, 5.0])
def test_what_errs_above_the_band_of_the_analysis_alone_is_seen_in_the_wider_one(times: float) -> None:
    """Five times as large, most of the error lies above the narrow band: there it is no noise but an amplified one."""
    narrow, wide = gains(held(0.0, 0.0), ripple(times * FAST))
    assert abs(narrow) < 0.1 * abs(wide)
    assert wide < -0.5 * times**2
    assert is_vetoed(narrow, wide)


def test_what_errs_below_is_seen_in_the_narrow_band_though_the_wider_one_is_better() -> None:
    narrow, wide = gains(held(FAST, 0.0), ripple(FAST), offset(SLOW))
    assert narrow < -0.3
    assert wide > 0.1
    assert is_vetoed(narrow, wide)
    assert not is_vetoed(*gains(held(FAST, SLOW), ripple(FAST), offset(SLOW)))


def test_where_the_wider_band_is_mostly_noise_that_a_model_does_not_amplify_the_narrow_one_counts_twice() -> None:
    this = held(0.0, SLOW, hum=0.3)
    narrow, wide = gains(this, offset(SLOW))
    assert narrow == wide > 0.3
    assert not is_vetoed(narrow, wide)
    assert is_vetoed(*gains(this, offset(-SLOW)))


def test_the_wider_band_comes_last_though_it_be_that_of_the_analysis() -> None:
    cycles = 2 * np.pi * 45 / 2
    false = Cogging(cycles_per_rev=cycles, amplitude=2 * FAST, phase=0.0)
    narrow, wide = gains(held(0.0, 0.0, band=60.0), false)
    assert wide < -0.5 < narrow
    assert is_vetoed(narrow, wide)
