"""What is printed is what is delivered: the card is read back, numbers computed again; files of 0.1.0 are read."""

import json
import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import cosim
from cosim.api.why import read_ledger
from cosim.data.recording import Recording
from cosim.delivery.deliver import deliver_quickly
from cosim.diagnosis.diagnose import _problem, diagnose
from cosim.diagnosis.measure.protocol import Structures, heldout_rms, judge, of_the_best, traces
from cosim.diagnosis.measure.regression import black_box_rms
from cosim.estimation.fit import free_parameters, with_values
from cosim.estimation.prepare import Band, prepare
from cosim.estimation.residuals import residuals
from cosim.support.errors import InputError
from cosim.support.statistics import rms
from cosim_studies.proof.generator import make_case, to_toml
from pyfmi_models.card import Card, parse_card, read_card
from pyfmi_models.model import parameters_of

ROUNDING = 1e-3
"""Relative: what a printed number of four digits may differ by."""
CONVERGED = 0.02
"""Share by which a structure without an effect, fitted again, may end elsewhere."""


class Delivered(NamedTuple):
    """What a diagnosis was given, and what it wrote."""

    card: Card
    train: list[Recording]
    held: Recording
    told: dict[str, Any]
    better: Card
    proposed: Card
    """What training alone proposed."""

    @property
    def models(self) -> Structures:
        """The models that are compared: the base refitted as is printed, the last one as was written."""
        names = [*self.told["base_parameters"]]
        values = np.array([self.told["base_parameters"][name][1] for name in names])
        return Structures(self.card.plant(), with_values(self.card.plant(), names, values), self.better.plant())

    @property
    def band(self) -> Band:
        """That of the analysis."""
        clear = self.told["heldout"]["clear_motion"]
        return Band(clear["cutoff_hz"], clear["motion_hz"])


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> Delivered:
    case = make_case(953, ["friction_asymmetry", "torque_offset"], duration=20.0)
    runs = [
        Recording(name, {n: frame[n].to_numpy(float) for n in frame.columns})
        for name, frame in zip(("train_1", "train_2", "heldout"), (*case.train, case.heldout), strict=True)
    ]
    card, out = parse_card(to_toml(case.card), "card.toml"), tmp_path_factory.mktemp("out")
    outcome = diagnose(runs[:2], runs[2:], card)
    deliver_quickly(outcome, runs[:2], runs[2:], card, out, "a test")
    told = json.loads((out / "diagnosis.json").read_text("utf-8"))
    return Delivered(card, runs[:2], runs[2], told, read_card(out / "card.toml"), outcome.proposed)


def test_the_held_out_errors_are_those_of_the_cards_given_refitted_written_and_proposed(delivered: Delivered) -> None:
    assert in_model(delivered), "something was found to speak of"
    held, runs = delivered.told["heldout"], [delivered.held]
    band = Band(held["cutoff_hz"], held["motion_hz"])
    for name in ("nominal", "before", "after"):
        plant = getattr(delivered.models, name)
        assert heldout_rms(runs, plant, band) == pytest.approx(held[f"{name}_rms"], rel=ROUNDING), name
    proposed = heldout_rms(runs, delivered.proposed.plant(), band)
    assert held["unvetoed_rms"] == pytest.approx(proposed, rel=ROUNDING)  # without a veto
    beside = black_box_rms(traces(delivered.train, runs, delivered.models))
    assert held["black_box_rms"] == pytest.approx(beside, rel=CONVERGED)  # one that is learned from the same cards


def test_the_errors_in_clear_motion_the_floor_and_the_range_are_those_of_the_same_cards(delivered: Delivered) -> None:
    clear = delivered.told["heldout"]["clear_motion"]
    prepared = prepare([delivered.held], delivered.band)
    v, inside = (np.concatenate([getattr(piece, name) for piece in prepared.pieces]) for name in ("v", "inside"))
    assert clear["least_speed"] == pytest.approx(0.02 * np.abs(v[inside]).max(), rel=ROUNDING)
    moving = inside & (np.abs(v) > clear["least_speed"])
    for name in ("before", "after"):
        left = np.concatenate(residuals(prepared, getattr(delivered.models, name)))[moving]
        assert rms(left) == pytest.approx(clear[f"{name}_rms"], rel=ROUNDING), name
    held, added = delivered.told["heldout"], {one.id for one in delivered.proposed.effects}
    again = judge([delivered.held], delivered.models, delivered.band)
    assert again.floor_rms == pytest.approx(held["floor_rms"], rel=ROUNDING)
    assert again.floor_rms < again.after_rms
    gain = held["before_rms"] - held["after_rms"]
    wide = of_the_best(again.confidence_interval, again.before_rms - again.after_rms, 2 ** len(added))
    assert held["confidence_interval"] == pytest.approx(wide, abs=ROUNDING * gain)
    assert held["confidence_interval"][0] < gain < held["confidence_interval"][1]


def test_the_origin_of_the_card_says_the_same_errors_recordings_version_and_date(delivered: Delivered) -> None:
    held, origin, told = delivered.told["heldout"], delivered.better.origin, delivered.told["provenance"]
    evidence = str(origin["evidence"])
    assert f"{held['before_rms']:.4g} refitted, {held['after_rms']:.4g} with" in evidence
    assert len(re.findall(r"\d[\d.e+-]*", evidence)) == 2, "there is no other number in it"
    assert set(origin) == {"version", "date", "card", "recordings", "evidence", "operational_domain"}
    assert origin["operational_domain"]["speed"]["low"] == repr(delivered.told["improved"]["speed"][0])
    assert [origin["version"], origin["date"]] == [told["version"], told["date"]]
    assert origin["version"] == delivered.told["version"]
    assert origin["card"] == told["card"]["name"] == "card.toml"
    named = [{key: one[key] for key in ("name", "sha256", "role")} for one in told["recordings"]]
    assert origin["recordings"] == named
    roles = [("train_1", "train"), ("train_2", "train"), ("heldout", "heldout")]
    assert [(one["name"], one["role"]) for one in named] == roles


def test_the_parameters_and_their_ranges_are_those_of_the_written_card(delivered: Delivered) -> None:
    for told in in_model(delivered):
        (effect,) = (one for one in delivered.better.effects if one.id == told["effect"])
        written = {variable.name: variable.start for variable in parameters_of(effect)}
        assert {name: told["parameters"][name] for name in written} == pytest.approx(written, rel=ROUNDING)
        assert set(told["standard_errors"]) <= set(told["parameters"])
        for name, error in told["standard_errors"].items():
            low, high = told["ranges"][name]
            assert (low + high) / 2 == pytest.approx(told["parameters"][name], rel=ROUNDING)
            assert high - low == pytest.approx(2 * 1.96 * error, rel=ROUNDING)
    written = {variable.name: variable.start for variable in delivered.better.plant().parameters()}
    for name, (_, _, after) in delivered.told["base_parameters"].items():
        assert written[name] == pytest.approx(after, rel=ROUNDING), name
    assert set(free_parameters(delivered.card.plant())) <= set(written), "free numbers that the fit knows"


def test_each_gain_is_what_the_written_model_loses_without_the_effect(delivered: Delivered) -> None:
    problem, mount = _problem(delivered.train, delivered.card), delivered.better.plant()
    whole = energy(problem.weight, problem.fit(mount, 0).residual)
    for told in in_model(delivered):
        rest = tuple(one for one in mount.effects if one.id != told["effect"])
        without = problem.fit(replace(mount, effects=rest), 15)
        gain = 1 - whole / energy(problem.weight, without.residual)
        assert told["gain"] == pytest.approx(gain, abs=CONVERGED), told["effect"]
        assert f"removes {100 * told['gain']:.0f} % of the error energy" in told["evidence"]


def test_every_effect_has_a_bound_or_a_reason(delivered: Delivered) -> None:
    assert len(delivered.told["effects"]) >= 21
    for told in delivered.told["effects"]:
        bound = told["bound"]
        assert bound["value"] is not None or bound["reason"], told["effect"]
        if told["answer"] == "not_seen":
            assert bound["power"] >= 0.9
            assert bound["unit"]
            assert bound["range"]
            assert bound["band_hz"][1] > 0


def in_model(delivered: Delivered) -> list[dict[str, Any]]:
    """Effects that the written model holds."""
    return [e for e in delivered.told["effects"] if e["answer"] in ("found", "ambiguous") and e["where"] is not None]


def energy(weight: np.ndarray, residual: np.ndarray) -> float:
    return float(np.sum((weight * residual) ** 2))


OLD = Path(__file__).with_name("of_0_1_0")
"""What `cosim demo` of version 0.1.0 wrote, with four of its effects."""


def test_card_and_diagnosis_of_0_1_0_are_read_and_shown_and_a_missing_ledger_is_one_sentence() -> None:
    written = json.loads((OLD / "diagnosis.json").read_text("utf-8"))
    schema = json.loads((files("cosim.delivery") / "schema.json").read_text("utf-8"))
    card = read_card(OLD / "card.toml")
    assert card.origin["version"] == "0.1.0"
    assert [one.id for one in card.plant().effects] == ["friction_asymmetry", "cogging"]
    assert card.plant().model().parameters
    assert (written["version"], written["policy"]) == ("0.1.0", "evidence 2")
    Draft202012Validator(schema).validate(written)
    shown = cosim.show(OLD)
    assert shown.facts["missing"] == "friction_asymmetry, cogging"
    assert {row["effect"]: row["answer"] for row in shown.tables["effects"]} == {
        "friction_asymmetry": "detected",
        "cogging": "detected",
        "presliding": "not testable",
        "backlash": "not detected",
    }
    with pytest.raises(InputError, match=r"diagnosis.json holds no ledger; .* a version before 0\.2\. Diagnose again"):
        read_ledger(OLD)
