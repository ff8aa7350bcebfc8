"""What has no name is learned, and delivered where it helps a recording that nothing saw."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from learned_cases import FC, Array, Extra, droop, iron, learned, parts, recording, swerve, teeth, wanders, warm_place
from problems import diagnosed

from cosim.delivery.deliver import as_json, deliver_quickly
from cosim.delivery.proposal import Proposal
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.candidate_terms import candidate_terms
from cosim.diagnosis.terms.grams import columns_of, grams_of
from cosim.diagnosis.terms.learn import learn
from cosim.diagnosis.terms.select import telling
from cosim.estimation.prepare import PROTOCOL_HZ, prepare
from pyfmi_models.card import parse_card, read_card


def tight(now: dict[str, Array]) -> Array:
    """Oil that is sluggish at one side."""
    return 2.0 * now["v"] * (1 + np.sin(4 * now["q"]))


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
        (tight, "speed and position", 0.5, None),
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


def uneven(now: dict[str, Array]) -> Array:
    """A friction level that is not the same everywhere, at any temperature."""
    return 0.3 * FC * np.sin(9 * now["q"]) * np.sign(now["v"])


@pytest.mark.parametrize(("extra", "tells"), [(uneven, False), (warm_place, True)])
def test_a_table_over_two_quantities_says_more_than_tables_over_each(extra: Extra, tells: bool) -> None:
    comparison, base, _ = parts(extra)
    prepared = comparison.problem.prepared
    terms = candidate_terms(base.mount, prepared)
    grams = grams_of(comparison, base, [columns_of(base.mount, one, prepared) for one in terms], terms)
    names = [terms[k].name for k in telling(grams, terms)]
    assert ("position and temperature" in names) is tells
    assert {one.name for one in terms} - {"position and temperature"} <= set(names)


def test_no_recording_is_worse_off_than_before() -> None:
    """A night night that has less of it than the others vetoes what they propose."""
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
