"""Which effects stand, where all but the choice is a table: likelihoods and errors by the effects that are in."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from named_structures import Fitted, Named, Structure, Tables, fitted

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.search.proof import Proof, prove, prove_sets
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined
from cosim.diagnosis.search.stages import CandidateFit

RULES = replace(POLICY, fair=3.0, clear=3.0, slight=0.1)


@pytest.fixture(autouse=True)
def all_are_what_they_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """Effects that are only their names are never anything else in disguise, and their sizes are told."""
    monkeypatch.setattr("cosim.diagnosis.search.proof.is_degenerate", lambda *_: False)
    monkeypatch.setattr("cosim.diagnosis.search.proof.tells", lambda *_: True)
    monkeypatch.setattr("cosim.diagnosis.search.proof.contest", lambda _, one, two: one.evidence - two.evidence)


@dataclass(frozen=True)
class Candidate:
    evidence: float
    fit: Fitted
    plain_gain: float = 0.5


class Held(Tables):
    """Held-out recordings too."""

    policy = RULES
    weight = np.ones(4)

    def __init__(self, nats: Mapping[str, float], errors: Mapping[str, float] | None = None) -> None:
        self.nats, self.errors = nats, errors or {}

    def predicted(self, found: Fitted) -> float:
        return self.nats[found.mount.names]

    def plain_gains(self, before: Structure, after: Structure) -> tuple[float, float]:
        """By default what is more has a little less error."""
        old, new = (self.errors.get(one.names, 1.0 - 0.01 * len(one.effects)) for one in (before, after))
        return (old - new) / old, (old - new) / old

    def at_rest(self, *_: Structure) -> float:
        """None of the effects remembers."""
        return 0.0

    def in_motion(self, *both: Structure) -> float:
        """As everywhere else."""
        return self.plain_gains(*both)[0]


def proven(tables: Held, names: str, removed: float = 0.5, evidence: float = 100.0) -> Proof:
    """Effects in the order of their evidence, each of which removes a share of what the base leaves."""
    whole = fitted("b" + names)
    effects = []
    for place, name in enumerate(names):
        own = Candidate(evidence - place, fitted("b" + names, left=np.sqrt(1 - removed)), removed)
        without = fitted("b" + names.replace(name, ""), left=1.0)
        effects.append(AcceptedEffect((Named(name),), own, without, (), {}, {}))  # type: ignore[arg-type]
    examined = Examined(fitted("b", left=1.0), whole, tuple(reversed(effects)), None)  # type: ignore[arg-type]
    return prove(tables, examined, tables)  # type: ignore[arg-type]


def standing(proof: Proof) -> str:
    return "".join(one.effect.id for one in proof.standing)


def test_effects_that_predict_stand_and_are_worth_what_is_lost_without_them() -> None:
    tables = Held({"b": 0.0, "bx": 10.0, "bxy": 17.0, "by": 5.0})
    proof = proven(tables, "xy")
    assert standing(proof) == "xy"
    assert proof.predicted == {"x": 12.0, "y": 7.0}
    assert proof.unproven == ()
    assert proof.chosen.mount.names == "bxy"  # type: ignore[attr-defined]


def test_where_nothing_predicts_the_base_stays() -> None:
    proof = proven(Held({"b": 0.0, "bx": -1.0, "bxy": -2.0, "by": -1.0}), "xy")
    assert standing(proof) == ""
    assert proof.chosen.mount.names == "b"  # type: ignore[attr-defined]
    assert proof.predicted == {"x": 0.0, "y": 0.0}
    assert [one.effect.id for one in proof.unproven] == ["x", "y"]


@pytest.mark.parametrize(("more", "left"), [(7.0, "x"), (29.0, "x"), (31.0, "xy")])
def test_an_effect_of_which_no_size_is_told_stands_only_if_it_surely_predicts(
    more: float, left: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.diagnosis.search.proof.tells", lambda problem, chosen, effect: effect.id != "y")
    proof = proven(Held({"b": 0.0, "bx": 10.0, "bxy": 10.0 + more, "by": more}), "xy")
    assert standing(proof) == left
    assert proof.chosen.mount.names == "b" + left  # type: ignore[attr-defined]
    assert [one.effect.id for one in proof.unproven] == [name for name in "xy" if name not in left]


def test_the_list_ends_where_prediction_is_best_and_one_that_does_not_help_loses_no_later_one() -> None:
    tables = Held({"b": 0.0, "bx": -1.0, "bxy": 20.0, "by": 22.0, "bxyz": 19.0})
    proof = proven(tables, "xyz")
    assert standing(proof) == "y", "x raises nothing and predicts nothing: it is taken out; z is beyond the best"
    assert proof.predicted == {"x": -2.0, "y": 22.0, "z": 0.0}


def test_one_effect_more_that_halves_the_error_is_tried_where_the_likelihood_cannot_tell() -> None:
    nats = {"b": 0.0, "bx": 10.0, "bxy": 9.0, "by": -4.0}
    assert standing(proven(Held(nats), "xy")) == "x"
    assert standing(proven(Held(nats, {"b": 1.0, "bx": 0.8, "bxy": 0.3, "by": 0.8}), "xy")) == "xy"


def test_of_two_ways_the_one_that_predicts_better_is_taken() -> None:
    """The first falls only because the second is there; alone it predicts more than both."""
    tables = Held({"b": 0.0, "bx": 60.0, "by": 50.0, "bxy": 52.0})
    proof = proven(tables, "xy")
    assert standing(proof) == "x"
    tables = Held({"b": 0.0, "bx": 52.5, "by": 54.0, "bxy": 55.0})
    assert standing(proven(tables, "xy")) == "y"


def test_of_two_ways_one_that_halves_the_error_goes_before_one_that_leaves_it() -> None:
    """Fast rows by the hundred are predicted a little better by the first, which takes nothing of the error away."""
    nats = {"b": 0.0, "bx": 134.0, "by": 37.0, "bxy": 219.0}
    assert standing(proven(Held(nats, {"b": 1.0, "bx": 0.99, "by": 0.4, "bxy": 0.45}), "xy")) == "y"
    assert standing(proven(Held(nats, {"b": 1.0, "bx": 0.99, "by": 0.7, "bxy": 0.78}), "xy")) == "x"


def test_of_two_ways_that_halve_the_error_one_that_halves_what_the_other_leaves_goes_first() -> None:
    """The first is spoilt by the second, which helps least beside it."""

    def left(error: float, nats: float = 899.0) -> str:
        tables = Held({"b": 0, "bx": 910, "by": nats, "bxy": 927}, {"b": 1, "bx": 0.499, "by": error, "bxy": 0.49})
        return standing(proven(tables, "xy"))

    assert (left(0.2), left(0.3)) == ("y", "x")
    assert (left(0.1, 860.0), left(0.04, 860.0)) == ("x", "y"), "the likelihood contradicts, unless hardly any is left"


@pytest.mark.parametrize(
    ("names", "left", "nats", "expected"),
    [("x", 0.5, 50.0, "x"), ("x", 0.51, 50.0, ""), ("x", 0.5, 3.0, "x"), ("x", 0.5, 2.9, ""), ("xy", 0.51, 50.0, "xy")],
)
def test_what_is_small_in_training_and_alone_must_halve_the_held_out_error_and_predict(
    names: str, left: float, nats: float, expected: str
) -> None:
    small, sure = 0.9 * RULES.small, RULES.sure
    likelihoods = {"b": 0.0, "bx": nats, "by": nats, "bxy": 2 * nats}
    tables = Held(likelihoods, {"b": 1.0, "bx": left, "by": left, "bxy": 0.3})
    assert standing(proven(tables, names, small, sure - 1)) == expected


def test_what_is_small_and_sure_need_not() -> None:
    tables = Held({"b": 0.0, "bx": 50.0}, {"b": 1.0, "bx": 0.8})
    assert standing(proven(tables, "x", 0.9 * RULES.small, RULES.sure)) == "x"
    assert standing(proven(tables, "x", RULES.small, RULES.sure - 1)) == "x"


# What training leaves open, held-out recordings choose, where all but the choice is a table.


def candidate(names: str, evidence: float) -> CandidateFit:
    fit = fitted("b" + names, left=np.sqrt(0.5))
    return CandidateFit(Named(names[-1]), fit, evidence, 0.0, 0.5)  # type: ignore[arg-type]


def accepted(name: str, beside: str = "", **margins: float) -> AcceptedEffect:
    """An effect beside others, and by how many nats its rivals are behind it."""
    rivals = tuple(candidate(beside + one, 100.0 - by) for one, by in margins.items())
    without = fitted("b" + beside, left=1.0)
    return AcceptedEffect((Named(name),), candidate(beside + name, 100.0), without, rivals, margins, margins)  # type: ignore[arg-type]


def chosen(nats: Mapping[str, float], *effects: AcceptedEffect) -> tuple[Examined, Proof, str]:
    whole = fitted("b" + "".join(one.effect.id for one in effects))
    examined = Examined(fitted("b", left=1.0), whole, effects, None)  # type: ignore[arg-type]
    tables = Held(nats)
    found, proof = prove_sets(tables, examined, tables)  # type: ignore[arg-type]
    return found, proof, "".join(one.effect.id for one in proof.standing)


def test_a_rival_stands_where_the_first_does_not_predict() -> None:
    found, proof, names = chosen({"b": 0.0, "bx": -2.0, "by": 8.0}, accepted("x", y=0.5))
    assert names == "y"
    assert proof.predicted["y"] == 8.0
    assert [one.effect.id for one in proof.unproven] == ["x"]
    assert found.chosen.mount.names == "by"  # type: ignore[attr-defined]


def test_what_stands_gives_way_to_nobody() -> None:
    assert chosen({"b": 0.0, "bx": 4.0, "by": 80.0}, accepted("x", y=0.5))[2] == "x"


@pytest.mark.parametrize(("behind", "own", "expected"), [(-0.01, 0.0, "y"), (0.0, 0.0, ""), (-0.01, -0.01, "")])
def test_only_what_training_has_near_it_with_evidence_of_its_own_is_asked(
    behind: float, own: float, expected: str
) -> None:
    refused = accepted("x", y=RULES.clear + behind)
    (rival,) = refused.rivals
    refused = replace(refused, rivals=(replace(rival, evidence=RULES.clear + own),))
    assert chosen({"b": 0.0, "bx": -2.0, "by": 8.0}, refused)[2] == expected


def test_an_effect_that_is_in_the_list_takes_no_other_place() -> None:
    nats = {"b": 0.0, "bx": -2.0, "bv": -1.0, "bxv": -3.0, "bvv": 40.0}
    assert chosen(nats, accepted("x", "v", v=1.0), accepted("v"))[2] == ""


def test_of_several_members_the_one_that_predicts_best_and_its_own_rivals() -> None:
    found, proof, names = chosen(
        {"b": 0.0, "bx": -2.0, "by": 8.0, "bz": 9.0, "bw": -5.0}, accepted("x", y=0.5, z=1.0, w=6.0)
    )
    assert names == "z"
    own = found.effects[0]
    assert own.margins == {"y": -0.5, "w": 5.0}, "against the one that stands; what was refused is none of them"
    assert [one.effect.id for one in proof.unproven] == ["x"]


def test_where_no_member_predicts_nothing_stands() -> None:
    _, proof, names = chosen({"b": 0.0, "bx": -2.0, "by": -1.0}, accepted("x", y=0.5))
    assert names == ""
    assert [one.effect.id for one in proof.unproven] == ["x"]


def test_beside_what_stands_a_member_must_leave_it_standing() -> None:
    effects = accepted("v", "x"), accepted("x", "v", y=0.5)
    nats = {"b": 0.0, "bv": 30.0, "bx": -2.0, "bvx": 28.0, "bxv": 28.0, "by": 29.0, "bvy": 40.0, "byv": 40.0}
    assert sorted(chosen(nats, *effects)[2]) == ["v", "y"]
    spoilt = nats | {"bvy": 31.0, "byv": 31.0}
    assert chosen(spoilt, *effects)[2] == "v"
