"""Effects that were found are taken out, challenged and swapped; what each structure is worth is a table here."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import pytest
from named_structures import Fitted, Named, Structure, Tables, fitted

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.search import rivals
from cosim.diagnosis.search.rivals import AcceptedEffect, Examined, examine, explains, grouped, margins
from pyfmi_models.effects import Cogging
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.load_dependent_friction import LoadDependentFriction
from pyfmi_models.effects.position_friction import PeriodicFriction

RULES = replace(POLICY, fair=3.0, clear=8.0)


@dataclass(frozen=True)
class Candidate:
    effect: Named
    fit: Fitted
    evidence: float
    plain_gain: float = 0.5
    adds: bool = False
    is_rough: bool = False


@dataclass(frozen=True)
class Tried:
    current: Fitted
    tried: tuple[Candidate, ...] = ()


@dataclass(frozen=True)
class Found:
    base: Fitted
    chosen: Fitted
    stages: tuple[Tried, ...] = ()


class Ruled(Tables):
    policy = RULES


Play = Callable[..., Examined]


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch) -> Play:
    """Examine a structure of which evidence and rivals are given by name."""

    def examined(
        names: str,
        evidence: dict[str, float],
        tried: dict[str, list[Candidate]] | None = None,
        misfits: dict[str, float] | None = None,
        counts: dict[str, int] | None = None,
        gains: dict[str, float] | None = None,
        undecided: tuple[str, ...] = (),
    ) -> Examined:
        def stage(comparison: Any, current: Fitted, told: Any, stands: Any = None) -> Tried:
            return Tried(current, tuple((tried or {}).get("".join(sorted(current.names)), [])))

        def weighed(comparison: Any, chosen: Fitted, before: Fitted, effect: Named) -> Candidate:
            fit, gain = replace(chosen, count=(counts or {}).get(effect.id, 0)), (gains or {}).get(effect.id, 0.5)
            return Candidate(effect, fit, evidence[effect.id], gain)

        monkeypatch.setattr(rivals, "stage", stage)
        monkeypatch.setattr(rivals, "weighed", weighed)
        monkeypatch.setattr(rivals, "margin", lambda _, own, other: own.evidence - other.evidence)
        monkeypatch.setattr(
            rivals,
            "contest",
            lambda _, own, other: (
                0.0 if own.effect.id + other.effect.id in undecided else own.evidence - other.evidence
            ),
        )
        monkeypatch.setattr(rivals, "_is_admissible", lambda _, one: not one.effect.id.isupper())
        monkeypatch.setattr(rivals, "misfits_of", lambda *_: misfits or {})
        monkeypatch.setattr(rivals, "best_of", lambda _, beside, __: next(filter(adds, beside.tried), None))
        monkeypatch.setattr(rivals, "is_full", lambda *_: False)
        monkeypatch.setattr(rivals, "_is_wave", lambda effect: effect.id == "w")
        return examine(Ruled(), Found(fitted("b"), fitted("b" + names)))  # type: ignore[arg-type]

    return examined


def adds(one: Candidate) -> bool:
    return one.adds


def rival(name: str, evidence: float, count: int = 0, beside: str = "b") -> Candidate:
    return Candidate(Named(name), fitted(beside + name, count), evidence)


def chosen(found: Examined) -> str:
    return found.chosen.names  # type: ignore[attr-defined, no-any-return]


def test_what_nothing_challenges_stays_with_its_margins(play: Play) -> None:
    found = play("x", {"x": 50.0}, {"b": [rival("r", 20.0), rival("s", 40.0), rival("r", 30.0), rival("x", 60.0)]})
    (one,) = found.effects
    assert chosen(found) == "bx"
    assert [r.effect.id for r in one.rivals] == ["s", "r"], "the best of each kind, the closest first; not itself"
    assert one.margins == {"s": 10.0, "r": 20.0}
    assert one.margin(one.rivals[1]) == 20.0
    assert one.without.mount.effects == (Named("b"),)  # type: ignore[comparison-overlap]
    assert found.last.current is found.chosen


def test_an_effect_without_evidence_beside_the_others_goes_and_the_last_one_stays(play: Play) -> None:
    assert chosen(play("xy", {"x": 50.0, "y": 8.0})) == "bxy"
    assert chosen(play("xy", {"x": 50.0, "y": 7.9})) == "bx"
    assert chosen(play("x", {"x": 1.0})) == "bx"


@pytest.mark.parametrize(
    ("own", "other", "counts", "expected"),
    [
        (20.0, 20.5, (2, 2), "br"),
        (20.0, 20.0, (2, 2), "bx"),
        (20.0, 17.5, (2, 1), "br"),
        (20.0, 17.0, (2, 1), "bx"),
        (20.0, 23.0, (1, 2), "bx"),
        (20.0, 23.5, (1, 2), "br"),
    ],
)
def test_a_rival_takes_the_place_where_it_is_better_or_near_and_simpler(
    own: float, other: float, counts: tuple[int, int], expected: str, play: Play
) -> None:
    tried = {"b": [rival("r", other, counts[1]), rival("x", own, counts[0])]}
    found = play("x", {"x": own, "r": other}, tried, counts={"x": counts[0], "r": counts[1]})
    assert chosen(found) == expected


@pytest.mark.parametrize(("counts", "expected"), [((5, 1), "br"), ((1, 5), "bx"), ((2, 2), "bx")])
def test_where_no_contest_of_names_decides_the_simpler_stands_however_far_the_other_is_ahead(
    counts: tuple[int, int], expected: str, play: Play
) -> None:
    """More numbers fit what an equation misses, too: friction that goes with the load was one over position."""
    ahead = {"x": 90.0, "r": 20.0} if counts[0] >= counts[1] else {"x": 20.0, "r": 90.0}
    tried = {"b": [rival(name, ahead[name], count) for name, count in zip("xr", counts, strict=True)]}
    found = play("x", ahead, tried, counts=dict(zip("xr", counts, strict=True)), undecided=("xr", "rx"))
    assert chosen(found) == expected


@pytest.mark.parametrize(
    ("first", "other", "behind", "expected"),
    [("w", "r", 2.9, "br"), ("w", "r", 3.0, "bw"), ("r", "w", -2.9, "br"), ("r", "w", -3.1, "bw")],
)
def test_a_wave_gives_way_to_what_has_one_shape_unless_it_beats_it_as_a_name(
    first: str, other: str, behind: float, expected: str, play: Play
) -> None:
    """Whatever goes with position a wave with some number of cycles follows, too; here with fewer numbers."""
    worth = {first: 20.0, other: 20.0 - behind}
    counts = {"w": 1, "r": 9}
    tried = {"b": [rival(name, worth[name], counts[name]) for name in worth]}
    assert chosen(play(first, worth, tried, counts=counts)) == expected


def test_waves_over_position_have_any_number_of_cycles() -> None:
    waves = (Cogging(cycles_per_rev=7.0, amplitude=1.0), PeriodicFriction(cycles_per_rev=3.0, relative_amplitude=0.1))
    assert all(map(rivals._is_wave, waves))
    assert not any(map(rivals._is_wave, (LoadDependentFriction(coulomb_per_Nm=0.1), CableWrap(stiffness=1.0))))


def test_a_rival_that_cannot_be_takes_no_place(play: Play) -> None:
    assert chosen(play("x", {"x": 20.0}, {"b": [rival("R", 90.0)]})) == "bx"


def test_where_the_set_point_speaks_of_both_it_decides(play: Play) -> None:
    tried = {"b": [rival("r", 10.0)]}
    assert chosen(play("x", {"x": 20.0, "r": 99.0}, tried, {"x": 1000.0, "r": 1.0})) == "br"
    assert chosen(play("x", {"x": 20.0}, {"b": [rival("r", 90.0)]}, {"x": 1.0, "r": 2.0})) == "bx", "not by evidence"


def test_swaps_that_go_in_a_circle_end(play: Play) -> None:
    tried = {"b": [rival("r", 30.0), rival("x", 30.0)]}
    found = play("x", {"x": 20.0, "r": 20.0}, tried)
    assert chosen(found) in ("bx", "br")
    assert len(found.effects) == 1
    assert found.ended[0].startswith("Effects changed places 4 times"), "and it is said"


def test_a_search_stops_after_so_many_structures_and_says_what_was_not_asked(
    play: Play, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bound is a count of structures, the same on each machine; what stands is examined as it is."""
    p, q = (replace(rival(name, 900.0, beside=beside), adds=True) for name, beside in (("p", "br"), ("q", "brp")))
    beside = {"b": [rival("r", 60.0)], "br": [p], "bpr": [q]}
    worth = {"x": 50.0, "r": 60.0, "p": 900.0, "q": 900.0}
    free = play("x", worth, beside)
    assert (chosen(free), free.ended) == ("brpq", ()), "what has evidence beside what was swapped in is added"
    monkeypatch.setattr(Ruled, "policy", replace(RULES, most_effects=1))
    stopped = play("x", worth, beside)
    assert chosen(stopped) == "brp", "what was found by then stands, what has evidence beside it is not asked for"
    assert [one.effect.id for one in stopped.effects] == ["r", "p"], "each is challenged"
    assert "beside 2 structures" in stopped.ended[0]


def accepted(**more: Any) -> AcceptedEffect:
    told = {"effects": (Named("x"),), "own": Candidate(Named("x"), fitted("bx"), 50.0, 0.4), "without": fitted("b")}
    told |= {
        "rivals": (rival("r", 20.0), replace(rival("s", 10.0), plain_gain=-0.2)),
        "margins": {"r": 90.0, "s": 90.0},
        "contests": {"r": 30.0, "s": 40.0},
    }
    return AcceptedEffect(**(told | more))  # type: ignore[arg-type]


def test_margins_are_those_of_the_set_point_where_it_tells_the_two_apart() -> None:
    assert margins(accepted()) == {"r": 30.0, "s": 40.0}
    assert margins(accepted(misfits={"x": 4.0, "r": 12.0})) == {"r": 4.0, "s": 40.0}, "half of chi-squared is nats"


def test_what_raises_the_error_explains_nothing() -> None:
    assert explains(accepted()) == {"x": 0.4, "r": 0.5, "s": 0.0}


def test_of_a_ripple_the_strongest_wave_is_shown() -> None:
    waves = tuple(Named("x", amplitude) for amplitude in (0.1, 0.7, 0.3))
    assert accepted(effects=waves).effect == waves[1]  # type: ignore[comparison-overlap]


def test_effects_of_one_kind_are_one_group_and_those_of_the_card_in_none() -> None:
    one = Fitted(Structure((Named("b"), Named("x"), Named("y"), Named("x", 2.0))))
    groups = grouped(Ruled(), one)  # type: ignore[arg-type]
    assert [[effect.id for effect in group] for group in groups] == [["x", "x"], ["y"]]


def test_beside_an_effect_that_explains_little_nothing_is_added(play: Play) -> None:
    least = RULES.sure - 1
    beside = {"b": [], "bx": [replace(rival("p", 900.0, beside="bx"), adds=True)]}
    found = play("x", {"x": least, "p": 900.0}, beside, gains={"x": RULES.small / 2})
    assert chosen(found) == "bx"
