"""What counts as detected, and what the delivered structure holds."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import pytest
from wandering import axis

from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.decide.decision import Decision
from cosim.diagnosis.effects.tuning import ANY
from cosim.diagnosis.search import delivered
from cosim.diagnosis.trust import doubts
from pyfmi_models.effects import Cogging, Delay, FrictionAsymmetry, TorqueOffset
from pyfmi_models.mount import Mount

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
    ("probability", "members", "doubtful", "is_told", "found"),
    [
        (0.5, (), (), True, True),
        (0.49, (), (), True, False),
        (0.9, ("cable_wrap",), (), True, False),
        (0.9, (), ("torque_offset",), True, False),
        (0.9, (), (), False, False),
    ],
)
def test_detected_is_what_is_alone_more_likely_than_not_and_of_a_size_that_is_told(
    probability: float,
    members: tuple[str, ...],
    doubtful: tuple[str, ...],
    is_told: bool,
    found: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(delivered, "tells", lambda *_: is_told)
    name = "torque_offset"
    decision = Decision({name: members}, {name: {name: probability}}, bool(doubtful), (), doubtful)
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


@pytest.mark.parametrize(
    ("given", "names", "is_own"),
    [
        (OWN, ["run1"], True),
        (OWN, ["run1 (begin)"], True),
        (OWN, ["run10", "run2"], False),
        (card(recordings=["run1"]), ["run1"], False),
    ],
)
def test_a_card_is_no_witness_of_its_own_recordings_and_their_parts_alone(
    given: Any, names: list[str], is_own: bool
) -> None:
    assert doubts.is_estimated(given, names) is is_own
