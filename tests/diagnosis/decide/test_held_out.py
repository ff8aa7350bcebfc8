"""An effect stands if recordings that nothing was fitted to are predicted better with it, and it is no small change."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from motions import RATE, Array, Motion
from wandering import axis, posed, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis import diagnose as whole
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores
from cosim.diagnosis.decide.decision import Gain, decide, followed, open_rivals
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.effects import HYPOTHESES, hypothesis_of
from cosim.diagnosis.effects.tuning import ANY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.evidence.shaking import ABOVE, burst_share
from cosim.diagnosis.measure.protocol import of_the_best
from cosim.diagnosis.search import rivals
from cosim.diagnosis.search.candidate_fit import CandidateFit, weighed
from cosim.diagnosis.search.nameless import Nameless, _Challenge, _challenge, _held, _Offered, nameless
from cosim.diagnosis.search.proof import Validation
from cosim.diagnosis.search.rivals import AcceptedEffect, examine, explains, margins
from cosim.diagnosis.search.stages import Search, Stage
from cosim.diagnosis.terms.candidate_terms import candidate_terms
from cosim.diagnosis.terms.learn import allowed
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim_studies.proof import generator
from cosim_studies.proof.generator import make_case, write_case, write_given
from cosim_studies.proof.tool import given
from pyfmi_models.effects import Cogging, Delay, Effect, FrictionAsymmetry, GravityUnbalance, TorqueOffset
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.mount import Mount

NOISE = 0.1


T = np.arange(60 * RATE) / RATE


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
def test_a_small_offset_that_is_there_predicts_and_its_opposite_does_not(seed, factor, least):
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
def test_a_spring_that_is_refitted_to_spring_no_more_falls(damping, stands, monkeypatch):
    monkeypatch.setattr("cosim.diagnosis.search.admissibility.recorded_by", lambda _: ANY)
    prepared = SimpleNamespace(pieces=())
    problem = SimpleNamespace(weight=np.ones(4), mount=left(1.0).mount, prepared=prepared)
    one = accepted(spring(0.1))
    comparison: Any = SimpleNamespace(problem=problem, policy=POLICY)
    examined: Any = SimpleNamespace(effects=(one,), base=left(1.0))
    validation = Validation(comparison, examined, cast(Any, None))
    assert all_pass(validation.rules(left(0.1, spring(damping)), one, SURE)) is stands


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
        pytest.param(replace(spring(0.1), resonance_hz=4.0), {"plain_gain": 0.9}, id="a spring of no card"),
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


# A name leaves where something without a name explains far more in its place; where it does not, the name stays.


RIPPLING_MOTOR = (594088557, "motor_ripple", 0.39)
"""A machine of the own generator, of a deck that is development data: seed, what is concealed, size."""


class Preferring:
    """Held-out recordings that prefer one model by so many nats more than they do."""

    def __init__(self, held: Any, mount: Mount, nats: float) -> None:
        self._held, self._mount, self._nats = held, mount, nats

    def likelihood_of(self, mount: Mount) -> float:
        return float(self._held.likelihood_of(mount) + self._nats * (mount is self._mount))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._held, name)


@pytest.fixture(scope="module")
def motor(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What is said of a machine, what `nameless` was asked, the one effect that stands, and all terms by name."""
    folder = tmp_path_factory.mktemp("motor")
    seed, concealed, size = RIPPLING_MOTOR
    write_given(make_case(seed, [concealed], size, machine=generator.ANY), folder)
    card, train, there = given(str(folder))
    asked: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        names = ("comparison", "examined", "proof", "held")
        patch.setattr(whole, "nameless", lambda *a: (asked.update(zip(names, a, strict=True)), nameless(*a))[1])
        said = whole.diagnose(train, [there], card).diagnosis
    (effect,), problem = asked["proof"].standing, asked["comparison"].problem
    beside = problem.without(asked["proof"].chosen, effect.effect.id)
    terms = {one.name: one for one in candidate_terms(problem.mount, problem.prepared)}
    return SimpleNamespace(said=said, **asked, effect=effect, beside=beside, terms=terms)


def test_a_torque_constant_that_waves_is_no_friction_over_position(motor: Any) -> None:
    said = motor.said
    assert (said.verdict, said.depends_on) == (("unknown",), ("torque and position",))
    taken = next(one for one in said.findings if one.effect == "position_friction")
    assert taken.answer == "not_proven"
    assert taken.evidence == "what goes with torque and position explains more in its place"
    assert said.learned["quantities"] == ["torque and position"]
    assert said.heldout.after_rms < 0.5 * said.heldout.before_rms


def test_a_name_is_not_taken_by_less_than_excludes_a_rival_or_where_held_out_recordings_contradict(motor):
    never = replace(motor.comparison.policy, clear=1e4)
    left = nameless(replace(motor.comparison, policy=never), motor.examined, motor.proof, motor.held)
    assert left.taken == ()
    assert left.proof is motor.proof
    contradict = Preferring(motor.held, motor.proof.chosen.mount, 1e6)
    assert nameless(motor.comparison, motor.examined, motor.proof, contradict).taken == ()


def test_what_held_out_recordings_prefer_one_term_to_two_names_by_is_evidence(motor: Any) -> None:
    """To two alone; and training may prefer each of them by what excludes a rival."""
    comparison, proof, effect = motor.comparison, motor.proof, motor.effect
    two = _Challenge((effect, effect), motor.terms["torque and position"], 0.0, motor.beside)
    own, least = _held(comparison, Nameless(proof), two, motor.held)[1], comparison.policy.clear

    def lead(train: float, nats: float, names: int = 2) -> tuple[bool, float]:
        prefers, asked = Preferring(motor.held, proof.chosen.mount, own - nats), replace(two, effects=(effect,) * names)
        return _held(comparison, Nameless(proof), replace(asked, lead=train), prefers)

    assert lead(0.0, 12.0) == (True, pytest.approx(12.0))
    assert lead(-2 * least + 1, 50.0) == (True, pytest.approx(51.0 - 2 * least))
    assert not lead(-2 * least - 1, 50.0)[0]
    assert lead(12.0, 50.0, names=1) == lead(12.0, -5.0, names=1) == (True, 12.0)
    assert not lead(least - 1, 50.0, names=1)[0]
    assert not lead(12.0, -least - 1)[0]
    assert not lead(12.0, -least - 1, names=1)[0]


@pytest.mark.parametrize(("name", "takes"), [("torque and position", True), ("speed and position", False)])
def test_a_term_that_raises_the_held_out_error_takes_no_name_however_many_nats_it_leads_by(name, takes, motor):
    silent = Preferring(motor.held, motor.proof.chosen.mount, -1e6)  # nats say nothing for the name
    term = motor.terms[name]
    asked = _Challenge((motor.effect,), term, 1e3, motor.beside)
    assert _held(motor.comparison, Nameless(motor.proof), asked, silent)[0] is takes
    grown, _ = allowed(motor.comparison, motor.beside, (term,))
    removed = min(motor.held.plain_gains(motor.proof.chosen.mount, grown))
    assert removed > 0 if takes else removed < -POLICY.slight


def test_what_took_a_name_stands_beside_every_rival_of_the_next(motor: Any) -> None:
    """Also where it is the next effect itself in another form: else the rest would be the next one's to explain."""
    proof, effect, tried = motor.proof, motor.effect, list(motor.terms.values())
    barred = hypothesis_of(effect.effect).tables
    own = next(one for one in tried if one.name in barred)
    alone, both = (
        _challenge(motor.comparison, found, (effect,), 0.0, _Offered(tried, []))
        for found in (Nameless(proof), Nameless(proof, ((effect, own),)))
    )
    assert both.lead > alone.lead
    assert both.term.name not in (own.name, *barred)


def test_however_bad_its_shape_an_effects_own_table_speaks_for_its_name(motor: Any) -> None:
    tables, terms = hypothesis_of(motor.effect.effect).tables, motor.terms.values()
    own, others = ([one for one in terms if (one.name in tables) is is_own] for is_own in (True, False))

    def challenge(shape: float, offered: Iterable[Any]) -> _Challenge:
        return _challenge(motor.comparison, Nameless(motor.proof), (motor.effect,), shape, _Offered(list(offered), []))

    assert challenge(-1e9, terms).lead == challenge(-2e9, terms).lead < 1e6
    assert challenge(-1e9, others).lead > 0.9e9
    none = challenge(-1e9, own[:1])
    assert (none.lead, none.term) == (-np.inf, own[0]), "nothing else is there to take the name"


def test_what_takes_a_name_is_unknown_whatever_is_left_beside_it() -> None:
    residual = ResidualScores(0.0, 0.0, in_place=("torque and position",))
    assert decide(Scores([], residual), POLICY).is_unknown
    assert followed(residual, POLICY) == ("torque and position",)
    assert not decide(Scores([], ResidualScores(0.0, 0.0)), POLICY).is_unknown


def test_tables_of_hypotheses_are_terms_that_exist() -> None:
    t = np.arange(2000) / 100
    turns = {"t": t, "q": 9 * np.sin(t), "tau": np.cos(t), "temperature": 20 + t}
    runs = [prepare([Recording("one", one)], 10.0) for one in (turns, turns | {"q": np.sin(t)})]
    named = {one.name for run in runs for one in candidate_terms(axis(), run)}
    assert {table for one in HYPOTHESES for table in one.tables} <= named


# What comes in bursts: a floor that trembles now and then is missing; noise of one size, and single jolts, are not.

NOW = np.arange(40 * RATE) / RATE
STEADY = np.ones(len(NOW))
WAY = np.where(np.sin(2 * np.pi * 3 * NOW) >= 0, 1.0, -1.0)
FAST = np.where(NOW % 12 < 6, 1.0, 5.0)
THEN = (NOW > 10) & (NOW < 14)


def noise(size: Array | float = 1.0, seed: int = 1) -> Array:
    return np.asarray(size * np.random.default_rng(seed).standard_normal(len(NOW)))


LOUD = noise(np.where(THEN, 10.0, 1.0))
ENERGY = 4 * 100.0  # of 476 in all, each window of it less three of the usual
SHARE = (ENERGY - 4 * ABOVE) / (ENERGY + 76)
COLOURED = np.convolve(noise(), np.ones(20) / np.sqrt(20), "same")
JOLT = noise(np.where((NOW >= 10) & (NOW < 11), 30.0, 1.0))
LEVEL = np.where(THEN, 8.0 * WAY, 0.0)
ABOUT = (NOW > 9) & (NOW < 15)


def few(seconds: int) -> Array:
    """Weight of the first seconds of one recording, and of no row of another."""
    return np.concatenate([seconds > NOW, 0 * NOW])


@pytest.mark.parametrize(
    ("rest", "speed", "more", "least", "most"),
    [
        pytest.param(noise(50.0), STEADY, {"scale": 50.0}, 0.0, 0.0, id="noise of one size"),
        pytest.param(COLOURED, STEADY, {}, 0.0, 0.02, id="noise of another colour"),
        pytest.param(JOLT, STEADY, {}, 0.0, 0.0, id="a jolt: a single window stands out"),
        pytest.param(noise() + 20 * np.sin(2 * np.pi * NOW / 40), STEADY, {}, 0.0, 0.1, id="what wanders slowly"),
        pytest.param(LOUD, STEADY, {}, 0.95 * SHARE, 1.05 * SHARE, id="larger for some seconds: in bursts"),
        pytest.param(np.where(NOW < 30, LOUD, noise(seed=3)), STEADY, {}, 0.95 * SHARE, 1.05 * SHARE, id="so too"),
        pytest.param(LOUD, STEADY, {"weight": np.concatenate([~ABOUT, STEADY])}, 0.0, 0.0, id="in rows without weight"),
        pytest.param(LOUD, np.where(ABOUT, 1e-6, 1.0), {}, 0.0, 0.0, id="where nothing moves clearly"),
        pytest.param(noise(FAST), FAST, {"other": noise(FAST, 2)}, 0.0, 0.02, id="what goes with the motion"),
        pytest.param(noise(FAST), STEADY, {"other": noise(FAST, 2)}, POLICY.small, 1.0, id="what does not go with it"),
        # A friction level that is another for some seconds changes with the direction, and shakes nothing.
        pytest.param(noise() + LEVEL, WAY, {}, 0.0, 0.02, id="another friction level for some seconds"),
        pytest.param(noise() + abs(LEVEL) * noise(seed=3), WAY, {}, POLICY.small, 1.0, id="what shakes as much"),
        pytest.param(noise(np.where(NOW < 4, 10.0, 1.0)), STEADY, {"weight": few(19)}, 0.0, 0.0, id="too few windows"),
        pytest.param(noise(np.where(NOW < 4, 10.0, 1.0)), STEADY, {"weight": few(21)}, 0.5, 1.0, id="enough windows"),
    ],
)
def test_bursts_have_a_share(rest: Array, speed: Array, more: dict[str, Any], least: float, most: float) -> None:
    """Of the energy that is left in two recordings at one speed."""
    scale, counted = more.get("scale", 1.0), more.get("weight", np.ones(2 * len(NOW)))
    motion = Motion({"v": [speed, speed]})
    motion.cutoff = 20.0
    comparison: Any = SimpleNamespace(
        problem=SimpleNamespace(prepared=motion, weight=counted.astype(float)),
        bands=SimpleNamespace(slices=(slice(0, len(NOW)), slice(len(NOW), 2 * len(NOW)))),
        noise=SimpleNamespace(at=lambda v: np.full(len(v), scale)),
    )
    found: Any = SimpleNamespace(residual=np.concatenate([rest, more.get("other", noise(scale, seed=2))]))
    assert least <= burst_share(comparison, found) <= most
