"""A name leaves where something without a name explains far more in its place; where it does not, the name stays."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from motions import RATE, Array, Motion

from cosim.data.recording import Recording
from cosim.diagnosis import diagnose as whole
from cosim.diagnosis.answer.result import Diagnosis
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
def rippling_motor(tmp_path_factory: pytest.TempPathFactory) -> tuple[Diagnosis, tuple[Any, ...]]:
    """What is said of a machine, and what `nameless` was asked."""
    folder = tmp_path_factory.mktemp("motor")
    seed, concealed, size = RIPPLING_MOTOR
    write_given(make_case(seed, [concealed], size, machine=ANY), folder)
    card, train, held = given(str(folder))
    asked: list[tuple[Any, ...]] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(whole, "nameless", lambda *parts: (asked.append(parts), nameless(*parts))[1])
        return whole.diagnose(train, [held], card).diagnosis, asked[0]


def test_a_torque_constant_that_waves_is_no_friction_over_position(
    rippling_motor: tuple[Diagnosis, tuple[Any, ...]],
) -> None:
    said, _ = rippling_motor
    assert said.verdict == ("unknown",)
    assert said.depends_on == ("torque and position",)
    taken = next(one for one in said.findings if one.effect == "position_friction")
    assert taken.answer == "not_proven"
    assert taken.evidence == "what goes with torque and position explains more in its place"
    assert said.learned["quantities"] == ["torque and position"]
    assert said.heldout.after_rms < 0.5 * said.heldout.before_rms


def test_a_name_is_not_taken_by_less_than_excludes_a_rival(rippling_motor: tuple[Diagnosis, tuple[Any, ...]]) -> None:
    _, (comparison, examined, proof, held) = rippling_motor
    never = replace(comparison.policy, clear=1e4)
    left = nameless(replace(comparison, policy=never), examined, proof, held)
    assert left.taken == ()
    assert left.proof is proof


def test_a_name_is_not_taken_where_held_out_recordings_contradict(
    rippling_motor: tuple[Diagnosis, tuple[Any, ...]],
) -> None:
    _, (comparison, examined, proof, held) = rippling_motor
    assert nameless(comparison, examined, proof, Preferring(held, proof.chosen.mount, 1e6)).taken == ()


def test_what_held_out_recordings_prefer_one_term_to_two_names_by_is_evidence(
    rippling_motor: tuple[Diagnosis, tuple[Any, ...]],
) -> None:
    """To two alone; and training may prefer each of them by what excludes a rival."""
    comparison, _, proof, held = rippling_motor[1]
    (effect,) = proof.standing
    beside = comparison.problem.without(proof.chosen, effect.effect.id)
    tried = {one.name: one for one in candidate_terms(comparison.problem.mount, comparison.problem.prepared)}
    two = _Challenge((effect, effect), tried["torque and position"], 0.0, beside)
    own, least = _held(comparison, Nameless(proof), two, held)[1], comparison.policy.clear

    def lead(train: float, nats: float, names: int = 2) -> tuple[bool, float]:
        prefers, asked = Preferring(held, proof.chosen.mount, own - nats), replace(two, effects=(effect,) * names)
        return _held(comparison, Nameless(proof), replace(asked, lead=train), prefers)

    assert lead(0.0, 12.0) == (True, pytest.approx(12.0))
    assert lead(-2 * least + 1, 50.0) == (True, pytest.approx(51.0 - 2 * least))
    assert not lead(-2 * least - 1, 50.0)[0]
    assert lead(12.0, 50.0, names=1) == lead(12.0, -5.0, names=1) == (True, 12.0)
    assert not lead(least - 1, 50.0, names=1)[0]
    assert not lead(12.0, -least - 1)[0]
    assert not lead(12.0, -least - 1, names=1)[0]


def test_a_term_that_raises_the_held_out_error_takes_no_name_however_many_nats_it_leads_by(
    rippling_motor: tuple[Diagnosis, tuple[Any, ...]],
) -> None:
    comparison, _, proof, held = rippling_motor[1]
    (effect,) = proof.standing
    beside = comparison.problem.without(proof.chosen, effect.effect.id)
    silent = Preferring(held, proof.chosen.mount, -1e6)  # nats say nothing for the name
    tried = {one.name: one for one in candidate_terms(comparison.problem.mount, comparison.problem.prepared)}

    def takes(name: str) -> tuple[bool, float]:
        term = tried[name]
        whole, _ = allowed(comparison, beside, (term,))
        removed = held.plain_gains(proof.chosen.mount, whole)
        return _held(comparison, Nameless(proof), _Challenge((effect,), term, 1e3, beside), silent)[0], min(removed)

    able, removed = takes("torque and position")
    assert able
    assert removed > 0
    able, removed = takes("speed and position")
    assert not able
    assert removed < -POLICY.slight


def test_what_took_a_name_stands_beside_every_rival_of_the_next(
    rippling_motor: tuple[Diagnosis, tuple[Any, ...]],
) -> None:
    """Also where it is the next effect itself in another form: else the rest would be the next one's to explain."""
    comparison, _, proof, _ = rippling_motor[1]
    (effect,) = proof.standing
    tried = candidate_terms(comparison.problem.mount, comparison.problem.prepared)
    barred = hypothesis_of(effect.effect).tables
    own = next(one for one in tried if one.name in barred)
    beside = Nameless(proof, ((effect, own),))
    alone, both = (
        _challenge(comparison, found, (effect,), 0.0, _Offered(tried, [])) for found in (Nameless(proof), beside)
    )
    assert both.lead > alone.lead
    assert both.term.name not in (own.name, *barred)


def test_however_bad_its_shape_an_effects_own_table_speaks_for_its_name(
    rippling_motor: tuple[Diagnosis, tuple[Any, ...]],
) -> None:
    comparison, _, proof, _ = rippling_motor[1]
    (effect,) = proof.standing
    tried = candidate_terms(comparison.problem.mount, comparison.problem.prepared)
    leads = [_challenge(comparison, Nameless(proof), (effect,), own, _Offered(tried, [])).lead for own in (-1e9, -2e9)]
    assert leads[0] == leads[1] < 1e6
    others = [one for one in tried if one.name not in hypothesis_of(effect.effect).tables]
    assert _challenge(comparison, Nameless(proof), (effect,), -1e9, _Offered(others, [])).lead > 0.9e9
    (own_alone,) = [one for one in tried if one.name in hypothesis_of(effect.effect).tables][:1]
    none = _challenge(comparison, Nameless(proof), (effect,), -1e9, _Offered([own_alone], []))
    assert (none.lead, none.term) == (-np.inf, own_alone), "nothing else is there to take the name"


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


def test_a_friction_level_that_is_another_for_some_seconds_is_no_burst() -> None:
    """It changes with the direction, several times in a window, and shakes nothing."""
    way = np.where(np.sin(2 * np.pi * 3 * T) >= 0, 1.0, -1.0)
    level = np.where((T > 10) & (T < 14), 8.0 * way, 0.0)
    found: Any = SimpleNamespace(residual=np.concatenate([noise() + level, noise(seed=2)]))
    assert burst_share(comparing(way), found) < 0.02
    shaken: Any = SimpleNamespace(residual=np.concatenate([noise() + np.abs(level) * noise(seed=3), noise(seed=2)]))
    assert burst_share(comparing(way), shaken) > POLICY.small
