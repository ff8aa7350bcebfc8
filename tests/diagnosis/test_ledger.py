"""The ledger of a diagnosis: what was fitted, by which rule it was taken or refused, and how that is printed."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from commands import call

import cosim
from cosim.diagnosis.answer.ledger import Gain, Ledger, Rule, Trial, at_least, error_of_sum, until_refused
from cosim.diagnosis.answer.why import BASE, decisive, ranked
from cosim_studies.proof.generator import make_case, write_given


@pytest.fixture(autouse=True)
def _wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, cosim.DiagnosisResult]:
    """A diagnosis of a mount that conceals a cogging, and the folder in which it lies."""
    folder = tmp_path_factory.mktemp("ledger")
    write_given(make_case(3, ["cogging"], duration=25.0, rate_hz=500), folder)
    train = [folder / f"train_{k}.parquet" for k in (1, 2)]
    found = cosim.diagnose(train, folder / "heldout.parquet", folder / "card.toml", folder / "out", quick=True)
    return folder / "out", found


@pytest.fixture(scope="module")
def rows(diagnosed: tuple[Path, Any]) -> list[dict[str, Any]]:
    return list(json.loads((diagnosed[0] / "diagnosis.json").read_text("utf-8"))["ledger"])


def test_the_trial_of_the_effect_that_is_named_passes_every_rule(
    diagnosed: tuple[Path, Any], rows: list[dict[str, Any]]
) -> None:
    assert diagnosed[1].missing == ("cogging",)
    one = decisive([Trial.of_json(row) for row in rows], "cogging", ("cogging",))
    assert one is not None
    assert one.refused_by is None
    assert {"predicts held-out recordings", "probability"} <= {rule.name for rule in one.rules}
    assert one.heldout is not None
    assert one.heldout.nats > 10


def test_a_trial_that_is_not_taken_names_what_refuses_it_and_one_that_loses_in_training_is_not_scored_elsewhere(
    rows: list[dict[str, Any]],
) -> None:
    for row in rows:
        refused = [rule for rule in row["rules"] if not rule["outcome"]]
        taken = {*row["effects"], row["effect"]} == {"cogging"}
        assert refused or taken or row["effect"] == "unknown" or not row["rules"], row
        for rule in refused:
            if rule["value"] is not None and rule["limit"] is not None and row["effect"] != "unknown":
                assert rule["value"] != rule["limit"]
        assert (row["nats_heldout"] is None) == (row["nats_train"] <= 0)


def test_the_ledger_is_a_data_frame(diagnosed: tuple[Path, Any], rows: list[dict[str, Any]]) -> None:
    table = diagnosed[1].ledger
    assert isinstance(table, pd.DataFrame)
    assert len(table) == len(rows)
    assert {"effects", "nats_train", "nats_heldout", "refused_by"} <= set(table.columns)


def test_why_ranks_structures_and_gives_a_sentence_for_every_effect_and_every_rule_of_one(
    diagnosed: tuple[Path, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = diagnosed[0]
    assert call("why", folder) == 0
    said = capsys.readouterr().out
    assert "cogging: detected" in said
    assert BASE in said
    for entry in json.loads((folder / "diagnosis.json").read_text("utf-8"))["effects"]:
        assert f"\n{entry['effect']}: " in said
    assert "\nunknown: nothing unknown is left" in said
    assert call("why", folder / "diagnosis.json", "cogging") == 0
    assert "predicts held-out recordings" in capsys.readouterr().out
    assert call("why", folder, "cogging", "--json") == 0
    assert {one["effect"] for one in json.loads(capsys.readouterr().out)} == {"cogging"}
    assert call("why", folder, "coging") == 2
    assert "Did you mean cogging?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no diagnosis is there"),
        ("{}", "holds no ledger"),
        ("not JSON", "holds no ledger"),
        ("[" * 100_000, "nested too deeply"),
        ('{"ledger": [{}], "effects": []}', "holds no ledger"),
        ('{"ledger": 3, "effects": []}', "holds no ledger"),
    ],
)
def test_why_refuses_what_is_no_diagnosis(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None, words: str
) -> None:
    if content is not None:
        (tmp_path / "diagnosis.json").write_text(content, "utf-8")
    assert call("why", tmp_path) == 2
    said = capsys.readouterr().err
    assert words in said
    assert "Traceback" not in said


def test_rules_are_asked_up_to_the_first_that_refuses() -> None:
    asked = until_refused(at_least(str(limit), 2.0, limit) for limit in (1.0, 3.0, 0.0))
    assert [rule.outcome for rule in asked] == [True, False]


def test_a_rule_that_is_asked_again_has_the_last_word_and_others_stay() -> None:
    ledger, key = Ledger(), ("delay", ("delay.delay_ms",), b"")
    ledger.add(key, lambda: Trial(("delay",), "delay", {}, Gain(1.0, 0.1)))
    ledger.judge(key, [at_least("evidence", 1.0, 2.0), Rule("shows", True)])
    ledger.judge(key, [at_least("evidence", 3.0, 2.0)])
    ((_, trial),) = ledger.items()
    assert {rule.name: rule.outcome for rule in trial.rules} == {"shows": True, "evidence": True}


def test_a_trial_is_the_same_once_written_and_read() -> None:
    rules = (
        at_least("evidence", 1.5, 15.0, "nats", "a note"),
        Rule("shows", False),
        at_least("loud", float("inf"), 5.0),
    )
    one = Trial(("a", "b"), "b", {"b.x": 0.25}, Gain(3.0, 0.5), Gain(2.0, 0.25), 0.5, rules)
    again = Trial.of_json(json.loads(json.dumps(one.as_json())))
    assert again == replace(one, rules=(*rules[:2], replace(rules[2], value=None)))


def test_weights_of_the_ranked_structures_add_up_to_one_and_the_base_is_among_them() -> None:
    trials = [Trial((name,), name, {}, Gain(nats, 1.0)) for name, nats in (("a", 2.0), ("b", -1.0), ("a", 1.0))]
    table = ranked(trials)
    assert [row.structure for row in table] == ["a", BASE, "b"]
    assert sum(row.weight for row in table) == pytest.approx(1.0)


def test_the_standard_error_of_a_sum_grows_with_the_root_of_its_blocks() -> None:
    assert error_of_sum(pd.Series([1.0, -1.0] * 50).to_numpy()) == pytest.approx(10.05, abs=0.01)
