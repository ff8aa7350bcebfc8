"""A rival that is nothing, or lies at a bound, stands in nobody's set, whatever evidence it brings."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.answer.scores import EffectScores
from cosim.diagnosis.decide.decision import open_rivals
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search import rivals
from cosim.diagnosis.search.rivals import AcceptedEffect, examine, explains, margins
from cosim.diagnosis.search.stages import CandidateFit, Search, Stage, weighed
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Cogging, Delay, Effect, FrictionAsymmetry, GravityUnbalance, TorqueOffset
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))
OFFSET = 0.5
NOTHING = (
    GravityUnbalance(mgl=0.0, phase=0.3),
    Cogging(cycles_per_rev=20.0, amplitude=0.0),
    CableWrap(stiffness=0.0, home=0.0),
    FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=0.0),
)
AT_A_BOUND = (
    FrictionAsymmetry(level_asymmetry=0.95, viscous_asymmetry=0.0),
    Delay(delay_ms=0.0),
    Compliance(antiresonance_hz=30.0, resonance_hz=20.0),
)


@cache
def compared() -> tuple[Comparison, Fit, Fit]:
    """An axis with a constant torque, recorded once; the base, and the structure with an offset."""
    t = np.arange(4_000) / 200
    q = 0.5 * np.sin(0.7 * t) + 0.1 * np.sin(2.3 * t + 1)
    v = 0.35 * np.cos(0.7 * t) + 0.23 * np.cos(2.3 * t + 1)
    a = -0.245 * np.sin(0.7 * t) - 0.529 * np.sin(2.3 * t + 1)
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(t))
    prepared = prepare([Recording("run", {"t": t, "q": q, "tau": 5 * a + 2 * np.sign(v) + v + OFFSET + noise})], 10.0)
    problem = Problem(MOUNT, prepared, (np.abs(prepared.stacked("v")) > 0.02).astype(float), t[1])
    base, found = (problem.fit(replace(MOUNT, effects=e), 15) for e in ((), (TorqueOffset(torque=0.1),)))
    return Comparison.of(problem, base, POLICY), base, found


def beside(effect: Effect, **more: Any) -> CandidateFit:
    """An effect with the very numbers that it has, beside the base; `more` is what it is said to be worth."""
    comparison, base, _ = compared()
    fit = comparison.problem.fit(replace(MOUNT, effects=(effect,)), 0)
    return replace(weighed(comparison, fit, base), effect=effect, **more)


def offset(monkeypatch: pytest.MonkeyPatch, rival: CandidateFit) -> AcceptedEffect:
    """The offset that was found, challenged by what was tried in its place."""
    comparison, base, found = compared()
    monkeypatch.setattr(rivals, "stage", lambda _, fit, __: Stage(fit, () if fit.mount.effects else (rival,)))
    (one,) = examine(comparison, Search(base, (Stage(found, ()),))).effects
    return one


def test_of_what_is_nothing_the_true_evidence_and_gain_are_nothing() -> None:
    for effect in NOTHING:
        one = beside(effect)
        assert one.evidence <= 0.1, effect.id
        assert one.plain_gain < POLICY.negligible, effect.id


@pytest.mark.parametrize("effect", NOTHING, ids=lambda one: one.id)
def test_what_removes_nothing_is_no_rival_whatever_its_evidence(
    effect: Effect, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = offset(monkeypatch, beside(effect, evidence=1e3))
    assert (one.effect.id, one.rivals, margins(one)) == ("torque_offset", (), {})
    assert set(explains(one)) == {"torque_offset"}


@pytest.mark.parametrize("effect", AT_A_BOUND, ids=lambda one: one.id)
def test_what_lies_at_a_bound_or_is_no_effect_is_no_rival_whatever_it_removes(
    effect: Effect, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = offset(monkeypatch, beside(effect, evidence=1e3, plain_gain=0.9))
    assert (one.effect.id, one.rivals) == ("torque_offset", ())


def test_a_rival_that_is_something_is_one_and_may_stand_in_the_set(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison, base, _ = compared()
    two = comparison.problem.fit(replace(MOUNT, effects=(FrictionAsymmetry(level_asymmetry=0.2),)), 15)
    one = offset(monkeypatch, weighed(comparison, two, base))
    assert [rival.effect.id for rival in one.rivals] == ["friction_asymmetry"]
    scores = EffectScores("torque_offset", one.own.evidence, margins(one), explains(one))
    assert open_rivals(scores, POLICY) == ("friction_asymmetry",)
