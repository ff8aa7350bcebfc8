"""What has no name is learned, and delivered where it helps a recording that nothing saw."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from learned_cases import (
    FC,
    MOUNT,
    Array,
    Extra,
    droop,
    iron,
    learned,
    night,
    parts,
    recording,
    swerve,
    teeth,
    wanders,
    warm_place,
)
from problems import diagnosed

from cosim.data.recording import Recording
from cosim.delivery.deliver import as_json, deliver_quickly
from cosim.delivery.proposal import Proposal
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.candidate_terms import candidate_terms, resolved
from cosim.diagnosis.terms.dictionary import further_columns, user_columns
from cosim.diagnosis.terms.grams import columns_of, grams_of, with_terms
from cosim.diagnosis.terms.learn import _judged, learn
from cosim.diagnosis.terms.select import begun, paths, telling
from cosim.diagnosis.trust.limits import own_set_point, own_torque
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import PROTOCOL_HZ, Prepared, prepare
from pyfmi_models.card import parse_card, read_card
from pyfmi_models.effects.learned_memory import LearnedHysteresis


def polish(now: dict[str, Array]) -> Array:
    """Friction that falls with the way travelled."""
    way = np.cumsum(np.abs(np.diff(now["q"], prepend=now["q"][0])))
    return FC * np.exp(-way / (0.15 * way[-1])) * np.sign(now["v"])


def nothing(now: dict[str, Array]) -> Array:
    return 0 * now["t"]


@pytest.mark.parametrize(
    ("extra", "quantity", "least", "size"),
    [
        (warm_place, "position and temperature", 0.6, None),
        (droop, "torque", 0.3, None),
        (iron, "hysteresis over a long stroke", 0.6, 1.25),  # a quarter more than was planted, as its table goes
        (teeth, "torque and position", 0.5, None),
        (lambda now: 2.0 * now["v"] * (1 + np.sin(4 * now["q"])), "speed and position", 0.5, None),
        (swerve, "speed and acceleration", 0.5, None),
    ],
)
def test_what_has_no_name_is_modelled_and_the_held_out_error_falls(
    extra: Extra, quantity: str, least: float, size: float | None
) -> None:
    found = learned(extra)
    assert found is not None
    assert found.quantities[0] == quantity
    assert 1 - found.after / found.before > least
    assert size is None or found.size == pytest.approx(size, rel=0.1)
    low, high = found.interval
    assert 0 < low < found.before - found.after < high
    assert found.sentence().startswith(f"Something that depends on {quantity}")
    for effect in found.effects:  # its friction never drives, its drive gives more for more
        assert effect.broken_rule() == ""


def test_what_fades_with_the_way_is_found_beside_the_temperature_that_rises_with_it() -> None:
    found = learned(polish)
    assert found is not None
    assert "way travelled" in found.quantities
    assert 1 - found.after / found.before > 0.5
    assert all(name in found.sentence() for name in found.quantities)


def test_sure_is_what_three_kinds_of_recordings_prove_each_for_itself() -> None:
    found = learned(warm_place)
    assert found is not None
    assert found.is_sure
    weak = POLICY.clear - 1
    for less in ({"evidence": (weak,)}, {"predicted": (weak,)}, {"gain": weak}, {"helps": False}):
        assert not replace(found, **less).is_sure


@pytest.mark.parametrize("extra", [nothing, wanders])
def test_nothing_is_delivered_where_it_does_not_help(extra: Extra) -> None:
    assert learned(extra) is None


@pytest.mark.parametrize(
    ("extra", "tells"),
    [(lambda now: 0.3 * FC * np.sin(9 * now["q"]) * np.sign(now["v"]), False), (warm_place, True)],
    ids=["a level that is uneven at any temperature", "one that is so where it is warm"],
)
def test_a_table_over_two_quantities_says_more_than_tables_over_each(extra: Extra, tells: bool) -> None:
    comparison, base, _ = parts(extra)
    prepared = comparison.problem.prepared
    terms = candidate_terms(base.mount, prepared)
    grams = grams_of(comparison, base, [columns_of(base.mount, one, prepared) for one in terms], terms)
    names = [terms[k].name for k in telling(grams, terms)]
    assert ("position and temperature" in names) is tells
    assert {one.name for one in terms} - {"position and temperature"} <= set(names)


def test_no_recording_is_worse_off_than_before() -> None:
    """A night that has less of it than the others vetoes what they propose."""
    comparison, base, _ = parts(iron)
    there = [recording(iron, 3), recording(nothing, 4)]
    held = Predictive.of(comparison, prepare(there, 10.0), base, prepare(there, PROTOCOL_HZ)).as_delivered()
    found = learn(comparison, base, held)
    assert found is not None
    assert not found.helps
    assert "is not in the model" in found.sentence()


def test_a_diagnosis_says_unknown_delivers_the_term_and_its_card_holds_it(tmp_path: Path) -> None:
    text = '[mount]\nname = "axis"\ninertia = 5.0\n[friction]\nmodel = "coulomb"\nFc = 2.0\nsigma2 = 1.0\n'
    runs, card = [recording(warm_place, seed) for seed in (1, 2, 3)], parse_card(text, "axis.toml")
    outcome = diagnosed(runs, text)
    assert "unknown" in outcome.diagnosis.verdict
    said = as_json(outcome.diagnosis)["learned"]
    assert outcome.diagnosis.heldout.after_rms < outcome.diagnosis.heldout.before_rms
    assert said["after"] < 0.5 * said["before"]
    assert said["after"] == pytest.approx(outcome.diagnosis.heldout.after_rms, rel=1e-9)
    assert said["cutoff_hz"] == outcome.diagnosis.heldout.cutoff_hz
    assert len(said["table"]) == len(said["range"]) == len(said["quantities"])
    deliver_quickly(outcome, runs[:2], runs[2:], card, tmp_path, "cosim diagnose")
    back = read_card(tmp_path / "card.toml")
    assert back.effects == outcome.card.effects
    assert "something learned over position" in (tmp_path / "card.toml").read_text("utf-8")
    assert json.loads((tmp_path / "diagnosis.json").read_text("utf-8"))["improved"]["card"] == "card.toml"
    ((formula, statement),) = outcome.formulas
    proposal = Proposal(formula, statement)
    assert proposal.id == "proposed_friction_over_position_and_temperature"
    assert said["formula"][0]["equation"] in proposal.text()


# What a learned term may be: its columns, its signs, its waves, its energy, the evidence it needs.


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
    found = learned(lambda now: -0.3 * iron(now))  # a loop the wrong way round, as of a delay
    for effect in found.effects if found else ():
        assert not isinstance(effect, LearnedHysteresis) or min(effect.torque) >= 0


def test_a_column_has_no_more_waves_than_its_values_tell() -> None:
    """Two nights at two temperatures tell no bend between them."""
    two = np.concatenate([np.linspace(10, 11, 50), np.linspace(20, 21, 50)])
    assert [resolved(4, values) for values in (two, np.linspace(0, 1, 100), np.array([0, 0.3, 0.6, 1.0]))] == [1, 4, 2]


@pytest.mark.parametrize(
    ("extra", "helps"), [(warm_place, True), (wanders, False), (lambda now: 0.12 * warm_place(now), False)]
)
def test_what_removes_much_of_an_error_is_delivered(extra: Extra, helps: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """What nuisances could be is free in a likelihood, and error all the same in what is delivered.

    An eighth of the energy that is left: a percent of the error is enough, the evidence is not there.
    """
    comparison, base, held = parts(extra)
    terms = [
        one for one in candidate_terms(MOUNT, comparison.problem.prepared) if one.name == "position and temperature"
    ]
    monkeypatch.setattr(Predictive, "likelihood_of", lambda *_: 0.0)
    found = _judged(comparison, base, terms, held)
    assert found is not None
    assert found.gain == 0.0
    assert found.helps is helps


def choosing(evidence: Callable[[Sequence[int]], float]) -> Any:
    """A stand-in for Gram matrices: how much evidence a choice of terms has, all of it or half of it elsewhere."""
    return SimpleNamespace(
        recordings=2,
        marginal=lambda chosen, _: SimpleNamespace(log_likelihood=evidence(chosen)),
        fitted=lambda chosen, _: chosen,
        predicted=lambda chosen, *_: evidence(chosen) / 2,
    )


def test_terms_need_evidence_each() -> None:
    assert paths(choosing(lambda chosen: (POLICY.clear - 1) * len(chosen)), range(4)) == []


def test_first_terms_that_gain_nearly_as_much_are_each_followed_and_held_out_recordings_judge() -> None:
    """The place and the temperature there go together in training: 0 and 1 gain alike, 2 a tenth."""
    alike = choosing(lambda chosen: max((0.0, *((100.0, 90.0, 10.0)[k] for k in chosen))))
    assert [one.order for one in begun(paths(alike, range(3)))] == [(0,), (1,)]


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
