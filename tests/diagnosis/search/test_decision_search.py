"""Effects that were found are challenged, swapped and proved held out; what each structure is worth is a table here."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from named_structures import Fitted, Named, Structure, Tables, candidate, fitted

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.search import proof as proofs
from cosim.diagnosis.search import rivals
from cosim.diagnosis.search.candidate_fit import CandidateFit
from cosim.diagnosis.search.proof import Proof, prove_sets
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined, examine, explains, grouped, margins
from cosim.diagnosis.search.stages import Stage
from pyfmi_models.effects import Cogging
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.load_dependent_friction import LoadDependentFriction
from pyfmi_models.effects.position_friction import PeriodicFriction

RULES = replace(POLICY, fair=3.0, clear=8.0)
ONCE = replace(RULES, most_effects=1)
Beside = Mapping[str, list[CandidateFit]]
"""What was tried beside structures, by the names of their effects in order."""


class Played:
    """Examine a structure of which evidence and rivals are given by name: capitals cannot be, "p" and "q" may be added.

    The evidence of an effect is less by what the structure without it leaves.
    """

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.patch, self.asked = patch, []

    def __call__(
        self,
        names: str,
        worth: Mapping[str, float],
        beside: Beside | None = None,
        *,
        misfits: Mapping[str, float] | None = None,
        counts: Mapping[str, int] | None = None,
        gain: float = 0.5,
        stages: tuple[Stage, ...] = (),
        full: bool = False,
        undecided: bool = False,
        policy: Any = RULES,
    ) -> Examined:
        def stage(comparison: Any, current: Fitted, refits: Any, stands: CandidateFit | None = None) -> Stage:
            self.asked.append((current.names, stands and stands.effect.id))
            return Stage(current, tuple((beside or {}).get("".join(sorted(current.names)), [])))

        def weighed(comparison: Any, chosen: Fitted, before: Fitted, effect: Named) -> CandidateFit:
            fit: Any = replace(chosen, count=(counts or {}).get(effect.id, 0))
            return CandidateFit(effect, fit, worth[effect.id] - before.left, 0.0, gain)

        def ahead(_: Any, own: CandidateFit, other: CandidateFit) -> float:
            return own.evidence - other.evidence

        stand_ins = {"stage": stage, "weighed": weighed, "margin": ahead, "is_full": lambda *_: full}
        stand_ins |= {
            "contest": (lambda *_: 0.0) if undecided else ahead,
            "misfits_of": lambda *_: misfits or {},
            "best_of": lambda _, beside, __: next((one for one in beside.tried if one.effect.id in "pq"), None),
            "_is_admissible": lambda _, one: not one.effect.id.isupper(),
            "_is_wave": lambda effect: effect.id == "w",
        }
        for name, stand_in in stand_ins.items():
            self.patch.setattr(rivals, name, stand_in)
        found: Any = SimpleNamespace(base=fitted("b"), chosen=fitted("b" + names), stages=stages)
        self.patch.setattr(Tables, "policy", policy)
        return examine(Tables(), found)


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch) -> Played:
    return Played(monkeypatch)


def names_of(found: Examined | Proof) -> str:
    return found.chosen.names


def test_what_nothing_challenges_stays_with_its_margins(play: Played) -> None:
    tried = [candidate("b" + name, worth) for name, worth in (("r", 20.0), ("s", 40.0), ("r", 30.0), ("x", 60.0))]
    found = play("x", {"x": 50.0}, {"b": tried})
    (one,) = found.effects
    assert names_of(found) == "bx"
    assert [r.effect.id for r in one.rivals] == ["s", "r"], "the best of each kind, the closest first; not itself"
    assert one.margins == {"s": 10.0, "r": 20.0}
    assert one.margin(one.rivals[1]) == 20.0
    assert one.without.mount.effects == (Named("b"),)
    assert found.last.current is found.chosen
    assert ("b", "x") in play.asked, "an effect that is fitted beside the others is not fitted there again"


def test_an_effect_without_evidence_beside_the_others_goes_and_the_last_one_stays(play: Played) -> None:
    assert names_of(play("xy", {"x": 50.0, "y": 8.0})) == "bxy"
    assert names_of(play("xy", {"x": 50.0, "y": 7.9})) == "bx"
    assert names_of(play("x", {"x": 1.0})) == "bx"
    little = play("x", {"x": RULES.sure - 1, "p": 900.0}, {"bx": [candidate("bxp", 900.0)]}, gain=RULES.small / 2)
    assert names_of(little) == "bx", "beside an effect that explains little nothing is added"


def test_an_effect_is_worth_what_it_adds_to_the_structure_that_was_asked_beside(play: Played) -> None:
    """A search may have fitted the structure without it already, and better than it is left by taking it out."""
    earlier: Any = fitted("b", left=9.0)
    (one,) = play("x", {"x": 50.0}, stages=(Stage(earlier, ()),)).effects
    assert (one.without, one.own.evidence) == (earlier, 41.0)


UNDECIDED = {"undecided": True}


@pytest.mark.parametrize(
    ("own", "rival", "more", "stands"),
    [
        pytest.param(("x", 20.0, 2), ("r", 20.5, 2), {}, "r", id="better"),
        pytest.param(("x", 20.0, 2), ("r", 20.0, 2), {}, "x", id="as good"),
        pytest.param(("x", 20.0, 2), ("r", 17.5, 1), {}, "r", id="near and simpler"),
        pytest.param(("x", 20.0, 2), ("r", 17.0, 1), {}, "x", id="simpler and too far"),
        pytest.param(("x", 20.0, 1), ("r", 23.0, 2), {}, "x", id="less simple and near"),
        pytest.param(("x", 20.0, 1), ("r", 23.5, 2), {}, "r", id="less simple and clearly better"),
        pytest.param(("x", 90.0, 5), ("r", 20.0, 1), UNDECIDED, "r", id="no contest of names: the simpler, far behind"),
        pytest.param(("x", 20.0, 1), ("r", 90.0, 5), UNDECIDED, "x", id="no contest of names: the simpler stays"),
        pytest.param(("x", 90.0, 2), ("r", 20.0, 2), UNDECIDED, "x", id="no contest of names, none simpler"),
        # Whatever goes with position a wave with some number of cycles follows, too; here with fewer numbers.
        pytest.param(("w", 20.0, 1), ("r", 17.1, 9), {}, "r", id="a wave gives way to what has one shape"),
        pytest.param(("w", 20.0, 1), ("r", 17.0, 9), {}, "w", id="a wave that beats it as a name"),
        pytest.param(("r", 20.0, 9), ("w", 22.9, 1), {}, "r", id="a wave takes no place"),
        pytest.param(("r", 20.0, 9), ("w", 23.1, 1), {}, "w", id="a wave that beats it takes it"),
        pytest.param(("x", 20.0, 0), ("R", 90.0, 0), {}, "x", id="what cannot be takes no place"),
        pytest.param(("x", 20.0, 0), ("r", 10.0, 0), {"misfits": {"x": 1e3, "r": 1}}, "r", id="the set point says it"),
        pytest.param(("x", 20.0, 0), ("r", 90.0, 0), {"misfits": {"x": 1.0, "r": 2}}, "x", id="it does: not evidence"),
    ],
)
def test_a_rival_takes_the_place(own, rival, more, stands, play):
    beside = {"b": [candidate("b" + name, worth, count) for name, worth, count in (rival, own)]}
    worth, counts = ({one[0]: one[place] for one in (own, rival)} for place in (1, 2))
    assert names_of(play(own[0], worth, beside, counts=counts, **more)) == "b" + stands


def test_waves_over_position_have_any_number_of_cycles() -> None:
    waves = (Cogging(cycles_per_rev=7.0, amplitude=1.0), PeriodicFriction(cycles_per_rev=3.0, relative_amplitude=0.1))
    assert all(map(rivals._is_wave, waves))
    assert not any(map(rivals._is_wave, (LoadDependentFriction(coulomb_per_Nm=0.1), CableWrap(stiffness=1.0))))


def test_swaps_that_go_in_a_circle_end(play: Played) -> None:
    found = play("x", {"x": 20.0, "r": 20.0}, {"b": [candidate("br", 30.0), candidate("bx", 30.0)]})
    assert names_of(found) in ("bx", "br")
    assert len(found.effects) == 1
    assert found.ended[0].startswith("Effects changed places 4 times"), "and it is said"


def test_a_search_stops_after_so_many_structures_and_says_what_was_not_asked(play: Played) -> None:
    """The bound is a count of structures, the same on each machine; what stands is examined as it is."""
    beside = {"b": [candidate("br", 60.0)], "br": [candidate("brp", 900.0)], "bpr": [candidate("brpq", 900.0)]}
    worth = {"x": 50.0, "r": 60.0, "p": 900.0, "q": 900.0}
    free = play("x", worth, beside)
    assert (names_of(free), free.ended) == ("brpq", ()), "what has evidence beside what was swapped in is added"
    assert names_of(play("x", worth, beside, full=True)) == "br", "unless the model holds as many as it may"
    stopped = play("x", worth, beside, policy=ONCE)
    assert names_of(stopped) == "brp", "what was found by then stands, what has evidence beside it is not asked for"
    assert [one.effect.id for one in stopped.effects] == ["r", "p"], "each is challenged"
    assert "beside 2 structures" in stopped.ended[0]
    assert (stopped.base.names, stopped.last.current) == ("b", stopped.chosen)


def accepted(
    name: str, beside: str = "", evidence: float = 100.0, removes: float = 0.5, **margins: float
) -> AcceptedEffect:
    """An effect beside others, and by how many nats its rivals are behind it."""
    others = tuple(candidate(f"b{beside}{one}", evidence - by) for one, by in margins.items())
    own, without = candidate(f"b{beside}{name}", evidence, removes=removes), fitted("b" + beside, left=1.0)
    return AcceptedEffect((Named(name),), own, without, others, margins, margins)


def test_margins_are_those_of_the_set_point_where_it_tells_and_what_raises_the_error_explains_nothing() -> None:
    one = replace(accepted("x", removes=0.4, r=30.0, s=40.0), margins={"r": 90.0, "s": 90.0})
    assert margins(one) == {"r": 30.0, "s": 40.0}
    assert margins(replace(one, misfits={"x": 4.0, "r": 12.0})) == {"r": 4.0, "s": 40.0}, "half of chi-squared is nats"
    one = replace(one, rivals=(one.rivals[0], replace(one.rivals[1], plain_gain=-0.2)))
    assert explains(one) == {"x": 0.4, "r": 0.5, "s": 0.0}


def test_effects_of_one_kind_are_one_group_shown_by_the_strongest_and_those_of_the_card_in_none(play: Played) -> None:
    waves = tuple(Named("x", amplitude) for amplitude in (0.1, 0.7, 0.3))
    assert replace(accepted("x"), effects=waves).effect == waves[1]
    one = Fitted(Structure((Named("b"), Named("x"), Named("y"), Named("x", 2.0))))
    groups = grouped(Tables(), one)
    assert [[effect.id for effect in group] for group in groups] == [["x", "x"], ["y"]]
    play("xx", {"x": 50.0})
    assert ("b", None) in play.asked, "of a ripple other multiples are tried once more"


# Held out: likelihoods and errors by the effects that are in.

PROVING = replace(POLICY, fair=3.0, clear=3.0, slight=0.1)
SMALL, SURE = PROVING.small, PROVING.sure


def in_order(one: Structure | Fitted) -> str:
    """Names of what stands beside the base, in the order of letters."""
    return "".join(sorted(one.names[1:]))


class Held(Tables):
    """Held-out recordings too."""

    policy = PROVING
    weight = np.ones(4)

    def __init__(self, nats: Mapping[str, float], errors: Mapping[str, float]) -> None:
        self.nats, self.errors = {"": 0.0, **nats}, {"": 1.0, **errors} if errors else {}

    def predicted(self, found: Fitted) -> float:
        return self.nats[in_order(found)]

    def plain_gains(self, before: Structure, after: Structure) -> tuple[float, float]:
        """By default what is more has a little less error."""
        old, new = (self.errors.get(in_order(one), 1.0 - 0.01 * len(one.effects)) for one in (before, after))
        return (old - new) / old, (old - new) / old

    def at_rest(self, *_: Structure) -> float:
        return 0.0

    def in_motion(self, *both: Structure) -> float:
        return self.plain_gains(*both)[0]


Prove = Callable[..., tuple[Examined, Proof, str]]


@pytest.fixture
def proven(monkeypatch: pytest.MonkeyPatch) -> Prove:
    """Prove effects that are only their names: none is anything else in disguise, and a size of all but "u" is told."""

    def proven(
        nats: Mapping[str, float], *effects: AcceptedEffect, errors: Mapping[str, float] | None = None
    ) -> tuple[Examined, Proof, str]:
        monkeypatch.setattr(proofs, "is_degenerate", lambda *_: False)
        monkeypatch.setattr(proofs, "tells", lambda problem, chosen, effect: effect.id != "u")
        monkeypatch.setattr(proofs, "contest", lambda _, one, two: one.evidence - two.evidence)
        whole: Any = fitted("b" + "".join(one.effect.id for one in effects))
        base: Any = fitted("b", left=1.0)
        tables: Any = Held(nats, errors or {})
        found, proof = prove_sets(tables, Examined(base, whole, effects, Stage(whole, ())), tables)
        standing = "".join(sorted(one.effect.id for one in proof.standing))
        assert "".join(sorted(names_of(proof)[1:])) == standing
        return found, proof, standing

    return proven


def listed(names: str, evidence: float = 100.0, removes: float = 0.5) -> list[AcceptedEffect]:
    """Effects of which each but the first has a little less evidence than the one before, the last first."""
    places = reversed(range(len(names)))
    return [accepted(names[k], names[:k] + names[k + 1 :], evidence - k, removes) for k in places]


def ids(effects: tuple[AcceptedEffect, ...]) -> str:
    return "".join(one.effect.id for one in effects)


@pytest.mark.parametrize(
    ("nats", "errors", "stands"),
    [
        pytest.param((10.0, 5.0, 17.0), (), "xy", id="both predict"),
        pytest.param((-1.0, -1.0, -2.0), (), "", id="nothing predicts: the base stays"),
        pytest.param((10.0, -4.0, 9.0), (), "x", id="one effect more that does not help"),
        pytest.param((10.0, -4.0, 9.0), (0.8, 0.8, 0.3), "xy", id="it halves the error"),
        pytest.param((60.0, 50.0, 52.0), (), "x", id="the first falls only because the second is there"),
        pytest.param((52.5, 54.0, 55.0), (), "y", id="of two ways the one that predicts better"),
        # Fast rows by the hundred are predicted a little better by the first, which takes nothing of the error away.
        pytest.param((134.0, 37.0, 219.0), (0.99, 0.4, 0.45), "y", id="one that halves the error goes first"),
        pytest.param((134.0, 37.0, 219.0), (0.99, 0.7, 0.78), "x", id="where none does, the likelihood"),
        # The first is spoilt by the second, which helps least beside it.
        pytest.param((910.0, 899.0, 927.0), (0.499, 0.2, 0.49), "y", id="one that halves what the other leaves"),
        pytest.param((910.0, 899.0, 927.0), (0.499, 0.3, 0.49), "x", id="it leaves more than half of it"),
        pytest.param((910.0, 860.0, 927.0), (0.499, 0.1, 0.49), "x", id="the likelihood contradicts"),
        pytest.param((910.0, 860.0, 927.0), (0.499, 0.04, 0.49), "y", id="hardly any error is left"),
    ],
)
def test_effects_stand_by_what_they_predict(nats, errors, stands, proven):
    ways = ("x", "y", "xy")
    given = dict(zip(ways, nats, strict=True)), dict(zip(ways, errors, strict=bool(errors)))
    _, proof, standing = proven(given[0], *listed("xy"), errors=given[1])
    assert standing == stands
    assert ids(proof.unproven) == "".join(name for name in "xy" if name not in stands)


def test_effects_are_worth_what_is_lost_without_them_and_the_list_ends_where_prediction_is_best(proven: Prove) -> None:
    assert proven({"x": 10.0, "xy": 17.0, "y": 5.0}, *listed("xy"))[1].predicted == {"x": 12.0, "y": 7.0}
    assert proven({"x": -1.0, "xy": -2.0, "y": -1.0}, *listed("xy"))[1].predicted == {"x": 0.0, "y": 0.0}
    _, proof, standing = proven({"x": -1.0, "xy": 20.0, "y": 22.0, "xyz": 19.0}, *listed("xyz"))
    assert standing == "y", "x raises nothing and predicts nothing: it is taken out; z is beyond the best"
    assert proof.predicted == {"x": -2.0, "y": 22.0, "z": 0.0}


@pytest.mark.parametrize(("more", "stands"), [(7.0, "x"), (29.0, "x"), (31.0, "ux")])
def test_an_effect_of_which_no_size_is_told_stands_only_if_it_surely_predicts(more, stands, proven):
    assert proven({"x": 10.0, "ux": 10.0 + more, "u": more}, *listed("xu"))[2] == stands


@pytest.mark.parametrize(
    ("names", "error", "nats", "removes", "evidence", "stands"),
    [
        ("x", 0.5, 50.0, 0.9 * SMALL, SURE - 1, "x"),
        ("x", 0.51, 50.0, 0.9 * SMALL, SURE - 1, ""),
        ("x", 0.5, 3.0, 0.9 * SMALL, SURE - 1, "x"),
        ("x", 0.5, 2.9, 0.9 * SMALL, SURE - 1, ""),
        ("xy", 0.51, 50.0, 0.9 * SMALL, SURE - 1, "xy"),
        ("x", 0.8, 50.0, 0.9 * SMALL, SURE, "x"),
        ("x", 0.8, 50.0, SMALL, SURE - 1, "x"),
    ],
)
def test_what_is_small_in_training_not_sure_and_alone_must_halve_the_held_out_error_and_predict(
    names: str, error: float, nats: float, removes: float, evidence: float, stands: str, proven: Prove
) -> None:
    likelihoods, errors = {"x": nats, "y": nats, "xy": 2 * nats}, {"x": error, "y": error, "xy": 0.3}
    assert proven(likelihoods, *listed(names, evidence, removes), errors=errors)[2] == stands


# What training leaves open, held-out recordings choose.


def test_a_rival_stands_where_the_first_does_not_predict(proven: Prove) -> None:
    found, proof, standing = proven({"x": -2.0, "y": 8.0}, accepted("x", y=0.5))
    assert (standing, names_of(found), ids(proof.unproven)) == ("y", "by", "x")
    assert proof.predicted["y"] == 8.0
    assert proven({"x": 4.0, "y": 80.0}, accepted("x", y=0.5))[2] == "x", "what stands gives way to nobody"
    _, proof, standing = proven({"x": -2.0, "y": -1.0}, accepted("x", y=0.5))
    assert (standing, ids(proof.unproven)) == ("", "x"), "where no rival predicts nothing stands"


@pytest.mark.parametrize(("behind", "own", "stands"), [(-0.01, 0.0, "y"), (0.0, 0.0, ""), (-0.01, -0.01, "")])
def test_only_what_training_has_near_it_with_evidence_of_its_own_is_asked(behind, own, stands, proven):
    refused = accepted("x", y=PROVING.clear + behind)
    refused = replace(refused, rivals=(replace(refused.rivals[0], evidence=PROVING.clear + own),))
    assert proven({"x": -2.0, "y": 8.0}, refused)[2] == stands


def test_of_several_members_the_one_that_predicts_best_and_its_own_rivals(proven: Prove) -> None:
    nats = {"x": -2.0, "y": 8.0, "z": 9.0, "w": -5.0}
    found, proof, standing = proven(nats, accepted("x", y=0.5, z=1.0, w=6.0))
    assert (standing, ids(proof.unproven)) == ("z", "x")
    assert found.effects[0].margins == {"y": -0.5, "w": 5.0}, "against the one that stands; what was refused is none"


def test_beside_what_stands_a_member_must_leave_it_standing(proven: Prove) -> None:
    effects = accepted("v", "x"), accepted("x", "v", y=0.5)
    nats = {"v": 30.0, "x": -2.0, "vx": 28.0, "y": 29.0, "vy": 40.0}
    assert proven(nats, *effects)[2] == "vy"
    assert proven(nats | {"vy": 31.0}, *effects)[2] == "v"
    listed_too = {"x": -2.0, "v": -1.0, "vx": -3.0, "vv": 40.0}
    assert proven(listed_too, accepted("x", "v", v=1.0), accepted("v"))[2] == "", "one that is listed takes no place"
