"""The ledger of a diagnosis: what was fitted, by which rule it was taken or refused, and how that is printed."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest
from commands import call
from wandering import axis

import cosim
from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.answer.ledger import Gain, Ledger, Rule, Trial, at_least, error_of_sum, until_refused
from cosim.diagnosis.answer.why import BASE, decisive, ranked
from cosim.diagnosis.decide.decision import Decision
from cosim.diagnosis.effects.tuning import ANY
from cosim.diagnosis.search import delivered
from cosim.diagnosis.trust import doubts
from cosim_studies.proof.generator import make_case, write_given
from pyfmi_models.effects import Cogging, Delay, FrictionAsymmetry, TorqueOffset
from pyfmi_models.mount import Mount

Diagnosed = tuple[Path, cosim.DiagnosisResult]
Rows = list[dict[str, Any]]
Printed = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    """A diagnosis of a mount that conceals a cogging, and the folder in which it lies."""
    folder = tmp_path_factory.mktemp("ledger")
    write_given(make_case(3, ["cogging"], duration=25.0, rate_hz=500), folder)
    train = [folder / f"train_{k}.parquet" for k in (1, 2)]
    found = cosim.diagnose(train, folder / "heldout.parquet", folder / "card.toml", folder / "out", quick=True)
    return folder / "out", found


@pytest.fixture(scope="module")
def rows(diagnosed: Diagnosed) -> Rows:
    return list(json.loads((diagnosed[0] / "diagnosis.json").read_text("utf-8"))["ledger"])


def test_the_trial_of_the_effect_that_is_named_passes_every_rule(diagnosed: Diagnosed, rows: Rows) -> None:
    assert diagnosed[1].missing == ("cogging",)
    one = decisive([Trial.of_json(row) for row in rows], "cogging", ("cogging",))
    assert one is not None
    assert one.refused_by is None
    assert {"predicts held-out recordings", "probability"} <= {rule.name for rule in one.rules}
    assert one.heldout is not None
    assert one.heldout.nats > 10


def test_a_trial_that_is_not_taken_names_what_refuses_it(rows: Rows) -> None:
    for row in rows:
        refused = [rule for rule in row["rules"] if not rule["outcome"]]
        taken = {*row["effects"], row["effect"]} == {"cogging"}
        assert refused or taken or row["effect"] == "unknown" or not row["rules"], row
        # What loses in training is not scored on held-out recordings.
        assert (row["nats_heldout"] is None) == (row["nats_train"] <= 0)


def test_the_ledger_is_a_data_frame(diagnosed: Diagnosed, rows: Rows) -> None:
    table = diagnosed[1].ledger
    assert isinstance(table, pd.DataFrame)
    assert len(table) == len(rows)
    assert {"effects", "nats_train", "nats_heldout", "refused_by"} <= set(table.columns)


def test_why_ranks_structures_and_gives_every_effect_a_sentence(diagnosed: Diagnosed, capsys: Printed) -> None:
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
def test_why_refuses_what_is_no_diagnosis(tmp_path: Path, capsys: Printed, content: str | None, words: str) -> None:
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


# What counts as detected, and what the delivered structure holds.

BARE = axis(effects=(Delay(delay_ms=1.0),))
ADDED = (
    TorqueOffset(torque=1.0),
    Cogging(amplitude=0.1, cycles_per_rev=8.0),
    Cogging(amplitude=0.1, cycles_per_rev=16.0),
)


@dataclass(frozen=True)
class Problem:
    """A problem whose fits leave a structure as it is."""

    mount: Mount = BARE
    held: tuple[str, ...] = ()
    prepared: Any = field(default_factory=lambda: SimpleNamespace(pieces=()))

    def fit(self, mount: Mount, _: int) -> Any:
        return SimpleNamespace(mount=mount, held=self.held)


COMPARISON: Any = SimpleNamespace(problem=Problem())


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ({}, True),
        ({"probability": 0.49}, False),
        ({"members": ("cable_wrap",)}, False),
        ({"doubtful": ("torque_offset",)}, False),
        ({"is_told": False}, False),
    ],
)
def test_detected_is_what_is_alone_more_likely_than_not_and_of_a_size_that_is_told(
    changed: dict[str, Any], found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = {"probability": 0.5, "members": (), "doubtful": (), "is_told": True} | changed
    monkeypatch.setattr(delivered, "tells", lambda *_: given["is_told"])
    name, doubtful = "torque_offset", given["doubtful"]
    told = {name: {name: given["probability"]}}
    decision = Decision({name: given["members"]}, told, bool(doubtful), (), doubtful)
    one = SimpleNamespace(effect=ADDED[0], within=lambda mount: ADDED[0])
    proof: Any = SimpleNamespace(standing=(one,), chosen=SimpleNamespace(mount=BARE))
    assert delivered.detected(COMPARISON, proof, decision) == ({name} if found else set())


def test_what_is_not_detected_leaves_the_structure_and_the_cards_own_effects_stay() -> None:
    whole = SimpleNamespace(mount=replace(BARE, effects=(*BARE.effects, *ADDED)))
    proof: Any = SimpleNamespace(chosen=whole)
    assert delivered.with_only(COMPARISON, proof, {"torque_offset", "cogging"}) is whole, "nothing is fitted again"
    kept = delivered.with_only(COMPARISON, proof, {"cogging"}).mount.effects
    assert kept == (*BARE.effects, *ADDED[1:]), "a ripple with all its waves"
    assert delivered.with_only(COMPARISON, proof, ()).mount.effects == BARE.effects


@pytest.mark.parametrize(
    ("first", "second", "doubtful", "held"),
    [(0.3, 0.2, (), True), (0.3, 0.19, (), False), (0.6, 0.4, ("cogging",), False)],
)
def test_of_a_set_of_which_one_is_there_the_likelier_is_delivered(
    first: float, second: float, doubtful: tuple[str, ...], held: bool
) -> None:
    told = {"cogging": {"cogging": first, "cable_wrap": second}, "delay": {"delay": 0.9}}
    decision = Decision({"cogging": ("cable_wrap",), "delay": ()}, told, bool(doubtful), (), doubtful)
    assert delivered.likelier(decision) == ({"cogging"} if held else set())


def test_a_size_that_only_a_bound_has_made_is_none_in_the_card(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivered, "recorded_by", lambda _: ANY)
    for viscous, kept in ((0.95, 0.0), (-0.95, 0.0), (0.2, 0.2)):
        sides = FrictionAsymmetry(level_asymmetry=0.33, viscous_asymmetry=viscous)
        found: Any = SimpleNamespace(mount=replace(BARE, effects=(*BARE.effects, sides)))
        effect: Any = delivered.without_ended(COMPARISON, found).mount.effects[-1]
        assert (effect.level_asymmetry, effect.viscous_asymmetry) == (0.33, kept)


# What is said of the base's numbers is judged on the model that is delivered.


def card(**origin: Any) -> Any:
    """What is asked of a card here: where its numbers come from."""
    return SimpleNamespace(origin=origin)


OWN = card(estimated_by="mount-cosim", recordings=["run1"])


def test_an_inertia_that_stood_in_for_a_weight_is_no_doubt_once_the_weight_is_there(monkeypatch: Any) -> None:
    monkeypatch.setattr(doubts, "edges_of", lambda *_: {})
    prepared = SimpleNamespace(pieces=(), names=("run1",))
    problem: Any = SimpleNamespace(mount=axis(5.0), top_speed=1.0, prepared=prepared)
    far = Sanity(finding="base_far_from_card", statement="Refitted, the inertia is 8 times the card's.")
    blind = Sanity(finding="no_set_point", statement="No set point was recorded.")
    for before, given, inertia, after in (
        ((far, blind), card(), 5.5, ["no_set_point"]),
        ((blind,), card(), 45.0, ["base_far_from_card", "no_set_point"]),
        ((far, blind), OWN, 45.0, ["no_set_point"]),
    ):
        found = doubts.of_delivered(before, given, problem, axis(inertia))
        assert [one.finding for one in found] == after


def test_a_card_is_no_witness_of_its_own_recordings_and_their_parts_alone() -> None:
    assert doubts.is_estimated(OWN, ["run1"])
    assert doubts.is_estimated(OWN, ["run1 (begin)"])
    assert not doubts.is_estimated(OWN, ["run10", "run2"])
    assert not doubts.is_estimated(card(recordings=["run1"]), ["run1"])
