"""A name leaves where something without a name explains far more in its place; where it does not, the name stays."""

from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from motions import RATE, Array, Motion

from cosim.data.recording import Recording
from cosim.diagnosis import diagnose as whole
from cosim.diagnosis.answer.scores import ResidualScores, Scores
from cosim.diagnosis.decide.decision import decide, followed
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import HYPOTHESES, hypothesis_of
from cosim.diagnosis.evidence.bursts import ABOVE, burst_share
from cosim.diagnosis.search.nameless import Nameless, _Challenge, _challenge, _held, _Offered, nameless
from cosim.diagnosis.terms.candidate_terms import candidate_terms
from cosim.diagnosis.terms.learn import allowed
from cosim.estimation.prepare import prepare
from cosim_studies.proof.generator import ANY, make_case, write_given
from cosim_studies.proof.tool import given
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

RIPPLING_MOTOR = (594088557, "motor_ripple", 0.39)
"""A machine of the own generator, of a deck that is development data: seed, what is concealed, size."""
TIME, AXIS = np.arange(2000) / 100, Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=1.0))


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
    write_given(make_case(seed, [concealed], size, machine=ANY), folder)
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


def test_a_name_is_not_taken_by_less_than_excludes_a_rival_or_where_held_out_recordings_contradict(
    motor: Any,
) -> None:
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
def test_a_term_that_raises_the_held_out_error_takes_no_name_however_many_nats_it_leads_by(
    name: str, takes: bool, motor: Any
) -> None:
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
    turns = {"t": TIME, "q": 9 * np.sin(TIME), "tau": np.cos(TIME), "temperature": 20 + TIME}
    stays = turns | {"q": np.sin(TIME)}
    named = {
        one.name for run in (turns, stays) for one in candidate_terms(AXIS, prepare([Recording("one", run)], 10.0))
    }
    assert {table for one in HYPOTHESES for table in one.tables} <= named


# What comes in bursts: a floor that trembles now and then is missing; noise of one size, and single jolts, are not.

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


@pytest.mark.parametrize(
    ("rest", "scale", "most"),
    [
        pytest.param(noise(), 1.0, 0.0, id="noise of one size"),
        pytest.param(noise(50.0), 50.0, 0.0, id="large noise of one size"),
        pytest.param(np.convolve(noise(), np.ones(20) / np.sqrt(20), "same"), 1.0, 0.02, id="noise of another colour"),
        pytest.param(noise(np.where((T >= 10) & (T < 11), 30.0, 1.0)), 1.0, 0.0, id="a jolt: one window stands out"),
        pytest.param(noise() + 20 * np.sin(2 * np.pi * T / 40), 1.0, 0.1, id="what wanders slowly"),
    ],
)
def test_no_burst_is(rest: Array, scale: float, most: float) -> None:
    assert share(rest, scale=scale) <= most


LOUD = noise(np.where((T > 10) & (T < 14), 10.0, 1.0))


def test_noise_that_is_larger_for_some_seconds_comes_in_bursts() -> None:
    energy = 4 * 100.0  # of 476 in all, each window of it less three of the usual
    assert share(LOUD) == pytest.approx((energy - 4 * ABOVE) / (energy + 76), rel=0.05)
    assert share(LOUD) > POLICY.small
    assert share(np.where(T < 30, LOUD, noise(seed=3))) == pytest.approx(share(LOUD), rel=0.02)


def test_what_goes_with_the_motion_is_no_burst() -> None:
    fast = np.where(T % 12 < 6, 1.0, 5.0)
    found: Any = SimpleNamespace(residual=np.concatenate([noise(fast), noise(fast, seed=2)]))
    assert burst_share(comparing(fast), found) < 0.02
    assert burst_share(comparing(np.ones(len(T))), found) > POLICY.small


def test_only_clear_motion_that_has_weight_counts() -> None:
    weight = np.ones(2 * len(LOUD))
    weight[: len(LOUD)][(T > 9) & (T < 15)] = 0
    assert share(LOUD, weight=weight) == 0
    found: Any = SimpleNamespace(residual=np.concatenate([LOUD, noise(seed=2)]))
    still = np.where((T > 9) & (T < 15), 1e-6, 1.0)
    assert burst_share(comparing(still), found) == 0


def test_too_few_windows_tell_nothing() -> None:
    weight = np.zeros(2 * len(T))
    weight[: 19 * RATE] = 1
    assert share(noise(np.where(T < 4, 10.0, 1.0)), weight=weight) == 0
    weight[: 21 * RATE] = 1
    assert share(noise(np.where(T < 4, 10.0, 1.0)), weight=weight) > 0.5


def test_a_friction_level_that_is_another_for_some_seconds_is_no_burst() -> None:
    """It changes with the direction, several times in a window, and shakes nothing."""
    way = np.where(np.sin(2 * np.pi * 3 * T) >= 0, 1.0, -1.0)
    level = np.where((T > 10) & (T < 14), 8.0 * way, 0.0)
    found: Any = SimpleNamespace(residual=np.concatenate([noise() + level, noise(seed=2)]))
    assert burst_share(comparing(way), found) < 0.02
    shaken: Any = SimpleNamespace(residual=np.concatenate([noise() + np.abs(level) * noise(seed=3), noise(seed=2)]))
    assert burst_share(comparing(way), shaken) > POLICY.small
