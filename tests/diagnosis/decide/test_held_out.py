"""An effect stands if recordings that nothing was fitted to are predicted better with it, and it is no small change."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from wandering import axis, posed, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.answer.scores import EffectScores
from cosim.diagnosis.decide.decision import Gain, open_rivals
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.effects.tuning import ANY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.measure.protocol import of_the_best
from cosim.diagnosis.search import rivals
from cosim.diagnosis.search.proof import _validation
from cosim.diagnosis.search.rivals import AcceptedEffect, examine, explains, margins
from cosim.diagnosis.search.stages import CandidateFit, Search, Stage, weighed
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.effects import Cogging, Delay, Effect, FrictionAsymmetry, GravityUnbalance, TorqueOffset
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.quadratic_drag import QuadraticDrag

Array = np.ndarray
SECONDS, RATE = 60, 200
NOISE = 0.1


T = np.arange(SECONDS * RATE) / RATE


def held_out(missing: Array, v: Array) -> Recording:
    """A recording at speed `v` whose torque has something that the base lacks."""
    tau = 5 * np.gradient(v, T) + 2 * np.sign(v) + v + missing
    return Recording("held-out", {"t": T, "tau": tau, "q": np.cumsum(v) / RATE})


def white(seed: int) -> Array:
    return NOISE * np.random.default_rng(seed).standard_normal(len(T))


def predicted(recording: Recording, effect: Effect) -> float:
    """Nats by which an effect predicts a held-out recording better than the base."""
    problem = posed(axis(), [held_out(white(99), np.sin(T))], 30.0)
    base, there = problem.fit(axis(), 10), prepare([recording], 30.0)
    held = Predictive.of(Comparison.of(problem, base, POLICY), there, base, there)
    return held.likelihood_of(axis(effects=(effect,))) - held.likelihood_of(axis())


@pytest.mark.parametrize(
    ("seed", "factor", "least"), [(0, 1.0, 1.0), (1, 1.0, 1.0), (2, 1.0, 1.0), (5, 0.8, 10.0), (5, 1.2, 10.0)]
)
def test_a_small_offset_that_is_there_predicts_and_its_opposite_does_not(
    seed: int, factor: float, least: float
) -> None:
    """Where friction and load are of another day every number of the base is off by a fifth: that decides nothing."""
    offset, v = 0.2 * NOISE, np.sin(T)
    base = 5 * np.gradient(v, 1 / RATE) + 2 * np.sign(v) + v
    recording = held_out(white(seed) + offset + (factor - 1) * base, v)
    assert predicted(recording, TorqueOffset(torque=offset)) > least * POLICY.fair
    assert predicted(recording, TorqueOffset(torque=-offset)) < 0


def test_what_acts_in_one_second_of_a_minute_predicts() -> None:
    v = 1 + 2 * np.exp(-(((T - 30.5) / 0.15) ** 2)) + 0.1 * np.sin(T)
    recording = held_out(white(2) + 0.3 * v**2, v)
    assert predicted(recording, QuadraticDrag(coefficient=0.3)) > POLICY.fair


def test_what_training_leaves_open_of_an_effect_is_not_held_against_it() -> None:
    """Near one speed each way an asymmetry of the level and one of the viscous friction are much the same."""
    steady, swinging = np.tanh(20 * np.sin(T)) * (1 + 0.2 * np.sin(0.37 * T)), np.sin(T) * (1.5 + np.sin(0.3 * T))
    problem = posed(axis(), [held_out(white(1) + 0.1 * np.abs(steady), steady)], 30.0)
    there = prepare([held_out(white(2) + 0.1 * np.abs(swinging), swinging)], 30.0)
    base, found = (problem.fit(axis(effects=one), 15) for one in ((), (FrictionAsymmetry(level_asymmetry=0.03),)))
    held = Predictive.of(Comparison.of(problem, base, POLICY), there, base, there)
    assert held.predicted(found) > held.likelihood_of(found.mount) + POLICY.fair
    assert held.predicted(found) > held.predicted(base) + POLICY.fair
    assert held.predicted(base) == held.likelihood_of(base.mount)


def test_a_diagnosis_never_ends_with_a_model_that_is_worse_than_the_base(tmp_path: Path) -> None:
    """A dwell that had a warm-up beside it was left alone when that was taken out, and misled."""
    write_case(make_case(1755486916, ("thermal_viscosity",)), tmp_path)
    card, train, held = given(str(tmp_path))
    found = diagnose(train, [held], card).diagnosis
    assert found.heldout.after_rms <= found.heldout.before_rms
    assert "dwell_breakaway" not in found.verdict


def test_the_range_of_the_best_of_some_is_wider_and_of_one_the_same() -> None:
    assert of_the_best((1.0, 4.0), 2.0, 1) == pytest.approx((1.0, 4.0))
    low, high = of_the_best((1.0, 4.0), 2.0, 4)
    assert (low, high) == pytest.approx((2 - 1.2744, 2 + 2 * 1.2744), rel=1e-4)  # 2.4977 and 1.9600 of a normal
    assert of_the_best((0.0, 0.0), 0.0, 8) == (0.0, 0.0)


# What stands on held-out recordings is still what its name says when all that stands was fitted anew.

SURE = Gain(100.0, 0.9, 0.9)


def spring(damping: float) -> Compliance:
    return Compliance(antiresonance_hz=5.0, resonance_hz=6.0, damping_ratio=damping)


def left(size: float, *effects: Effect) -> Any:
    return SimpleNamespace(mount=axis(effects=effects), residual=np.full(4, size))


def accepted(*effects: Effect) -> AcceptedEffect:
    own: Any = SimpleNamespace(fit=left(0.1, *effects), effect=effects[0], evidence=200.0, plain_gain=0.9)
    return AcceptedEffect(effects, own, left(1.0), (), {}, {})


@pytest.mark.parametrize(("damping", "stands"), [(0.1, True), (0.3, False)])
def test_a_spring_that_is_refitted_to_spring_no_more_falls(
    damping: float, stands: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.diagnosis.search.admissibility.recorded_by", lambda _: ANY)
    prepared = SimpleNamespace(pieces=())
    problem = SimpleNamespace(weight=np.ones(4), mount=left(1.0).mount, prepared=prepared)
    one = accepted(spring(0.1))
    comparison: Any = SimpleNamespace(problem=problem, policy=POLICY)
    examined: Any = SimpleNamespace(effects=(one,), base=left(1.0))
    assert all_pass(_validation(comparison, examined, left(0.1, spring(damping)), one, SURE)) is stands


def test_of_a_ripple_the_strongest_wave_is_looked_at_and_none_of_the_cards_own() -> None:
    waves = [Cogging(cycles_per_rev=10.0 * k, amplitude=a) for k, a in ((1, 9.0), (2, 0.1), (3, 0.4))]
    assert accepted(*waves[1:]).within(left(0.0, *waves).mount) is waves[2]


# A rival that is nothing, or lies at a bound, stands in nobody's set, whatever evidence it brings.

OFFSET = 0.5


@cache
def compared() -> tuple[Comparison, Fit, Fit]:
    """An axis with a constant torque, recorded once; the base, and the structure with an offset."""
    t = np.arange(4_000) / 200
    q, v, a = swing(t, [(0.5, 0.7, 0.0), (0.1, 2.3, 1.0)], per=1)
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(t))
    problem = posed(axis(), [recorded(5 * a + 2 * np.sign(v) + v + OFFSET + noise, t, q)], 10.0, 0.02)
    base, found = (problem.fit(axis(effects=one), 15) for one in ((), (TorqueOffset(torque=0.1),)))
    return Comparison.of(problem, base, POLICY), base, found


def beside(effect: Effect, **more: Any) -> CandidateFit:
    """An effect with the very numbers that it has, beside the base; `more` is what it is said to be worth."""
    comparison, base, _ = compared()
    fit = comparison.problem.fit(axis(effects=(effect,)), 0)
    return replace(weighed(comparison, fit, base), effect=effect, **more)


def offset(monkeypatch: pytest.MonkeyPatch, rival: CandidateFit) -> AcceptedEffect:
    """The offset that was found, challenged by what was tried in its place."""
    comparison, base, found = compared()
    monkeypatch.setattr(rivals, "stage", lambda _, fit, *__: Stage(fit, () if fit.mount.effects else (rival,)))
    (one,) = examine(comparison, Search(base, (Stage(found, ()),))).effects
    return one


@pytest.mark.parametrize(
    ("effect", "more"),
    [
        pytest.param(GravityUnbalance(mgl=0.0, phase=0.3), {}, id="no load"),
        pytest.param(Cogging(cycles_per_rev=20.0, amplitude=0.0), {}, id="no ripple"),
        pytest.param(CableWrap(stiffness=0.0, home=0.0), {}, id="no cable"),
        pytest.param(FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=0.0), {}, id="no asymmetry"),
        pytest.param(FrictionAsymmetry(level_asymmetry=0.95), {"plain_gain": 0.9}, id="an asymmetry at its bound"),
        pytest.param(Delay(delay_ms=0.0), {"plain_gain": 0.9}, id="a delay at its bound"),
        pytest.param(
            Compliance(antiresonance_hz=30.0, resonance_hz=20.0), {"plain_gain": 0.9}, id="a spring of no card"
        ),
    ],
)
def test_what_removes_nothing_lies_at_a_bound_or_is_no_effect_is_no_rival_whatever_its_evidence(
    effect: Effect, more: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = offset(monkeypatch, beside(effect, evidence=1e3, **more))
    assert (one.effect.id, one.rivals) == ("torque_offset", ())


def test_a_rival_that_is_something_is_one_and_may_stand_in_the_set(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison, base, _ = compared()
    two = comparison.problem.fit(axis(effects=(FrictionAsymmetry(level_asymmetry=0.2),)), 15)
    one = offset(monkeypatch, weighed(comparison, two, base))
    assert [rival.effect.id for rival in one.rivals] == ["friction_asymmetry"]
    scores = EffectScores("torque_offset", one.own.evidence, margins(one), explains(one))
    assert open_rivals(scores, POLICY) == ("friction_asymmetry",)
