"""What version 0.1.0 wrote is read, or refused in one sentence: `cosim demo` of 0.1.0, four of its effects."""

import json
from importlib.resources import files
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

import cosim
from cosim.api.why import read_ledger
from cosim.support.errors import InputError
from pyfmi_models.card import read_card

OLD = Path(__file__).with_name("of_0_1_0")
WRITTEN = json.loads((OLD / "diagnosis.json").read_text("utf-8"))
SCHEMA = json.loads((files("cosim.delivery") / "schema.json").read_text("utf-8"))


def test_card_and_diagnosis_of_0_1_0_are_read_and_shown_and_a_missing_ledger_is_one_sentence() -> None:
    card = read_card(OLD / "card.toml")
    assert card.origin is not None
    assert card.origin["version"] == "0.1.0"
    assert [one.id for one in card.plant().effects] == ["friction_asymmetry", "cogging"]
    assert card.plant().model().parameters
    assert (WRITTEN["version"], WRITTEN["policy"]) == ("0.1.0", "evidence 2")
    Draft202012Validator(SCHEMA).validate(WRITTEN)
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
