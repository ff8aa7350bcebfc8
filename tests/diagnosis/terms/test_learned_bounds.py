"""What a learned term may be: its columns, its signs, its waves, its energy, the evidence it needs."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from learned_cases import FC, MOUNT, Array, Extra, iron, learned, night, parts, wanders, warm_place

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.candidates import Candidate
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.candidate_terms import candidate_terms, resolved
from cosim.diagnosis.terms.dictionary import further_columns, user_columns
from cosim.diagnosis.terms.grams import with_terms
from cosim.diagnosis.terms.learn import _judged
from cosim.diagnosis.terms.select import begun, paths
from cosim.diagnosis.trust.limits import own_set_point, own_torque
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Prepared, prepare
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.learned_memory import LearnedHysteresis


def gives(now: dict[str, Array]) -> Array:
    """A loop the wrong way round, as of a delay that feeds energy in."""
    return -0.3 * iron(now)


def test_the_effect_of_a_card_is_the_term_that_was_fitted() -> None:
    comparison, base, _ = parts(warm_place)
    prepared = comparison.problem.prepared
    for term in candidate_terms(base.mount, prepared):
        fitted = term.with_coefficients([0.01 * (k + 1) for k in range(term.count)])
        there, _ = with_terms(base.mount, [fitted])
        here = replace(base.mount, effects=(fitted.learned(fitted.coefficients.tolist()),))
        torques = [stacked(Inverse(one, ()), prepared.pieces, np.zeros(0))[0] for one in (here, there)]
        np.testing.assert_allclose(torques[0], torques[1], atol=1e-9)


def test_a_hysteresis_that_would_give_energy_is_not_learned() -> None:
    found = learned(gives)
    for effect in found.effects if found else ():
        assert not isinstance(effect, LearnedHysteresis) or min(effect.torque) >= 0


def test_a_column_has_no_more_waves_than_its_values_tell() -> None:
    """Two nights at two temperatures tell no bend between them."""
    two = np.concatenate([np.linspace(10, 11, 50), np.linspace(20, 21, 50)])
    assert [resolved(4, values) for values in (two, np.linspace(0, 1, 100), np.array([0, 0.3, 0.6, 1.0]))] == [1, 4, 2]


def faint(now: dict[str, Array]) -> Array:
    """An eighth of the energy that is left: a percent of the error is enough, the evidence is not there."""
    return 0.12 * warm_place(now)


@pytest.mark.parametrize(("extra", "helps"), [(warm_place, True), (wanders, False), (faint, False)])
def test_what_removes_much_of_an_error_is_delivered_though_the_rest_is_no_likelier(
    extra: Extra, helps: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What nuisances could be is free in a likelihood, and error all the same in what is delivered."""
    comparison, base, held = parts(extra)
    terms = [
        one for one in candidate_terms(MOUNT, comparison.problem.prepared) if one.name == "position and temperature"
    ]
    monkeypatch.setattr(Predictive, "likelihood_of", lambda *_: 0.0)
    found = _judged(comparison, base, terms, held)
    assert found is not None
    assert found.gain == 0.0
    assert found.helps is helps


class Scores:
    """A stand-in for Gram matrices: how much evidence a choice of terms has, all of it or half of it elsewhere."""

    recordings = 2

    def __init__(self, evidence: Callable[[Sequence[int]], float]) -> None:
        self.evidence = evidence

    def marginal(self, chosen: Sequence[int], _: object) -> Any:
        return SimpleNamespace(log_likelihood=self.evidence(chosen))

    def fitted(self, chosen: Sequence[int], _: object) -> Sequence[int]:
        return chosen

    def predicted(self, chosen: Sequence[int], *_: object) -> float:
        return self.evidence(chosen) / 2


def test_terms_need_evidence_each() -> None:
    each: Any = Scores(lambda chosen: (POLICY.clear - 1) * len(chosen))
    assert paths(each, range(4)) == []


def test_first_terms_that_gain_nearly_as_much_are_each_followed_and_held_out_recordings_judge() -> None:
    """The place and the temperature there go together in training: 0 and 1 gain alike, 2 a tenth."""
    alike: Any = Scores(lambda chosen: max((0.0, *((100.0, 90.0, 10.0)[k] for k in chosen))))
    assert [one.order for one in begun(paths(alike, range(3)))] == [(0,), (1,)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_candidate_that_can_only_add_is_none_where_it_would_take_away(sign: float) -> None:
    """What is left is the column itself, or that upside down, which a spring cannot be."""
    comparison, base, _ = parts(warm_place)
    one = Compliance(antiresonance_hz=3.0, resonance_hz=4.0)
    free, spring = (
        comparison.score(base, [Candidate("compliance", (one,), (), lambda _: one, positive)], [column])[0]
        for positive in (False, True)
        for column in [sign * base.residual[:, None]]
    )
    assert np.sign(free.coefficients[0]) == np.sign(spring.coefficients[0]) == sign
    assert free.evidence > 100
    assert (spring.evidence, spring.plain) == ((free.evidence, free.plain) if sign > 0 else (-np.inf, 0))


# A column that is the axis' own torque, commanded or read elsewhere, is no cause; that of a cause stays one.


def needed(now: dict[str, Array]) -> Array:
    """Torque that the base has for a night's motion."""
    return 5.0 * now["a"] + FC * np.sign(now["v"]) + now["v"]


def read(now: dict[str, Array], tau: Array, **columns: Array) -> Prepared:
    return prepare([Recording("one", {"t": now["t"], "q": now["q"], "tau": tau} | columns)], 10.0)


def recorded(pull: float = 0.0, coupling: float = 0.0) -> Prepared:
    """An axis whose torque was commanded, too, by a drive that follows badly; a neighbour, and a pull that was read."""
    now, rng = night(1), np.random.default_rng(1)
    t = now["t"]
    neighbour, force = 3.0 * np.sin(1.3 * t), np.sin(0.7 * t)
    tau = needed(now) + pull * force + coupling * neighbour
    slow = np.convolve(rng.standard_normal(len(t)), np.ones(50) / 50**0.5, "same")
    command = 1.3 * tau + 0.3 * float(np.std(tau)) * slow
    return read(now, tau, command=command, neighbour=neighbour, force=force)


def test_a_command_that_the_torque_follows_badly_is_no_cause() -> None:
    prepared = recorded()
    column = np.concatenate([piece.extras["command"][piece.kept] for piece in prepared.pieces])
    assert np.corrcoef(column, prepared.stacked("tau"))[0, 1] ** 2 < 0.98, "a plain copy would be told without the rule"
    assert further_columns(prepared).torque == ("command",)
    assert set(user_columns(prepared)) == {"neighbour", "force"}
    assert "command" in own_torque(prepared)[0].statement


@pytest.mark.parametrize("cause", [{"pull": 5.0}, {"coupling": 2.0}])
def test_a_cause_stays_one_even_where_it_is_most_of_the_torque(cause: dict[str, float]) -> None:
    prepared = recorded(**cause)
    assert further_columns(prepared).torque == ("command",)
    assert {"neighbour", "force"} <= set(user_columns(prepared))


def test_nothing_is_told_of_an_axis_whose_motion_asks_for_no_torque() -> None:
    now, tau = night(2), np.random.default_rng(2).standard_normal(6000)
    assert further_columns(read(now, tau, half=tau + np.sin(now["t"]))).torque == ()


def looped(name: str = "asked", along: float = 0.0) -> Prepared:
    """An axis that follows a set point softly, logged a step early; a neighbour that moves along; pushes from outside.

    The torque is read with noise, so that the set point is no plain function of it and of the motion.
    """
    now, rng = night(3), np.random.default_rng(3)
    t, dt = now["t"], float(now["t"][1] - now["t"][0])
    pushes = 4.0 * np.sign(np.sin(2.1 * t + 2 * np.sin(0.9 * t)))
    tau = needed(now) + pushes
    asked = np.roll(now["q"] + (tau + 3.0 * now["v"]) / 25, -round(0.06 / dt))
    neighbour = along * now["q"] / now["q"].std() + np.sin(1.3 * t)
    noisy = tau + 0.2 * tau.std() * rng.standard_normal(len(t)) + 2.0 * neighbour
    return read(now, noisy, **{name: asked}, neighbour=neighbour)


@pytest.mark.parametrize("name", ["joint_pos_target_0", "column_17"])
def test_a_set_point_under_another_name_is_told_and_no_cause(name: str) -> None:
    prepared = looped(name)
    assert further_columns(prepared).set_point == (name,)
    assert set(user_columns(prepared)) == {"neighbour"}
    assert f"q_d={name}" in own_set_point(prepared)[0].statement


def test_a_neighbour_that_moves_along_stays_a_cause() -> None:
    assert "neighbour" in user_columns(looped(along=2.0))


def test_the_set_point_of_another_axis_is_none_of_this_one() -> None:
    now = night(1)
    assert further_columns(read(now, needed(now), joint_pos_target_1=np.sin(1.3 * now["t"]))).set_point == ()
