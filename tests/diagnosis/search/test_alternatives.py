"""What training leaves open, held-out recordings choose, where all but the choice is a table."""

from collections.abc import Mapping

import numpy as np
import pytest
from test_decision_proof import RULES, Named, Tables, structure

from cosim.diagnosis.search.alternatives import prove_sets
from cosim.diagnosis.search.proof import Proof
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined
from cosim.diagnosis.search.stages import CandidateFit


@pytest.fixture(autouse=True)
def all_are_what_they_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """Effects that are only their names are never anything else in disguise, and their sizes are told."""
    monkeypatch.setattr("cosim.diagnosis.search.proof.is_degenerate", lambda *_: False)
    monkeypatch.setattr("cosim.diagnosis.search.proof.tells", lambda *_: True)
    monkeypatch.setattr("cosim.diagnosis.search.alternatives.contest", lambda _, one, two: one.evidence - two.evidence)


class Recorded(Tables):
    """The same with recordings of which nothing is asked."""

    prepared = None


def candidate(names: str, evidence: float) -> CandidateFit:
    fit = structure("b" + names, left=np.sqrt(0.5))
    return CandidateFit(Named(names[-1]), fit, evidence, 0.0, 0.5)  # type: ignore[arg-type]


def accepted(name: str, beside: str = "", **margins: float) -> AcceptedEffect:
    """An effect beside others, and by how many nats its rivals are behind it."""
    rivals = tuple(candidate(beside + one, 100.0 - by) for one, by in margins.items())
    without = structure("b" + beside, left=1.0)
    return AcceptedEffect((Named(name),), candidate(beside + name, 100.0), without, rivals, margins, margins)  # type: ignore[arg-type]


def proven(nats: Mapping[str, float], *effects: AcceptedEffect) -> tuple[Examined, Proof, str]:
    whole = structure("b" + "".join(one.effect.id for one in effects))
    examined = Examined(structure("b", left=1.0), whole, effects, None)  # type: ignore[arg-type]
    tables = Recorded(nats)
    found, proof = prove_sets(tables, examined, tables)  # type: ignore[arg-type]
    return found, proof, "".join(one.effect.id for one in proof.standing)


def test_a_member_of_the_set_stands_where_the_first_does_not_predict() -> None:
    found, proof, names = proven({"b": 0.0, "bx": -2.0, "by": 8.0}, accepted("x", y=0.5))
    assert names == "y"
    assert proof.predicted["y"] == 8.0
    assert [one.effect.id for one in proof.unproven] == ["x"]
    assert found.chosen.mount.names == "by"  # type: ignore[attr-defined]


def test_what_stands_gives_way_to_nobody() -> None:
    assert proven({"b": 0.0, "bx": 4.0, "by": 80.0}, accepted("x", y=0.5))[2] == "x"


@pytest.mark.parametrize(("behind", "expected"), [(RULES.fair - 0.01, "y"), (RULES.fair, "")])
def test_only_what_training_leaves_open_is_asked(behind: float, expected: str) -> None:
    assert proven({"b": 0.0, "bx": -2.0, "by": 8.0}, accepted("x", y=behind))[2] == expected


def test_of_several_members_the_one_that_predicts_best_and_its_own_rivals() -> None:
    found, proof, names = proven(
        {"b": 0.0, "bx": -2.0, "by": 8.0, "bz": 9.0, "bw": -5.0}, accepted("x", y=0.5, z=1.0, w=6.0)
    )
    assert names == "z"
    own = found.effects[0]
    assert own.margins == {"y": -0.5, "w": 5.0}, "against the one that stands; what was refused is none of them"
    assert [one.effect.id for one in proof.unproven] == ["x"]


def test_where_no_member_predicts_nothing_stands() -> None:
    _, proof, names = proven({"b": 0.0, "bx": -2.0, "by": -1.0}, accepted("x", y=0.5))
    assert names == ""
    assert [one.effect.id for one in proof.unproven] == ["x"]


def test_beside_what_stands_a_member_must_leave_it_standing() -> None:
    effects = accepted("v", "x"), accepted("x", "v", y=0.5)
    nats = {"b": 0.0, "bv": 30.0, "bx": -2.0, "bvx": 28.0, "bxv": 28.0, "by": 29.0, "bvy": 40.0, "byv": 40.0}
    assert sorted(proven(nats, *effects)[2]) == ["v", "y"]
    spoilt = nats | {"bvy": 31.0, "byv": 31.0}
    assert proven(spoilt, *effects)[2] == "v"
