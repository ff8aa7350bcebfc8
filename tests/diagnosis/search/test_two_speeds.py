"""A base that is one thing to slow motion and another to fast one costs all structures alike."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY, Policy
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.stages import refitted
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

SMALL, NOISE = 2e-5, 1e-3
AXIS = Mount(name="axis", axis=Axis(inertia=2.0), friction=Coulomb(Fc=1.0, sigma2=0.5))


def swinging(more: float, weight: float) -> Recording:
    """Two slow tones and a fast one of 12 Hz, for which the axis has `more` inertia, with a weight out of balance."""
    t = np.arange(15_000) / 500
    tones = ((0.5, 0.5), (0.4, 1.3), (SMALL, 2 * np.pi * 12))
    q, v = (sum(size * w**k * wave(w * t) for size, w in tones) for k, wave in ((0, np.sin), (1, np.cos)))
    slow, quick = (-sum(size * w**2 * np.sin(w * t) for size, w in some) for some in (tones[:2], tones[2:]))
    tau = 2 * (slow + (1 + more) * quick) + np.sign(v) + 0.5 * v + weight * np.sin(q + 1)
    return Recording("run", {"t": t, "q": q, "tau": tau + NOISE * np.random.default_rng(1).standard_normal(len(t))})


def worth(more: float, weight: float, policy: Policy = POLICY) -> float:
    """Nats of a weight out of balance."""
    prepared = prepare([swinging(more, weight)], 40.0)
    problem = Problem(AXIS, prepared, np.ones(len(prepared.recording_of)), 0.002)
    base = problem.fit(AXIS, 15)
    return refitted(
        Comparison.of(problem, base, policy), base, GravityUnbalance(mgl=0.5 * weight + 0.1, phase=1.1), 1
    ).evidence


def test_what_explains_slow_motion_is_worth_the_same_whatever_inertia_fast_motion_has() -> None:
    alike = worth(0.0, 2.0)
    assert alike > 100
    assert worth(0.03, 2.0) == pytest.approx(alike, rel=0.15)  # 11 % more: the noise is another


def test_without_that_freedom_it_would_pay_for_the_fast_motion() -> None:
    pinned = replace(POLICY, wander=1e-6)
    assert worth(0.03, 2.0, pinned) < worth(0.03, 2.0) - 100


def test_the_freedom_makes_nothing_of_nothing() -> None:
    assert worth(0.03, 0.0) < 5
