"""What is said of the base's numbers is judged on the model that is delivered."""

from typing import Any

from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.trust import doubts
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount


def card(**origin: Any) -> Any:
    """What is asked of a card here: where its numbers come from."""
    return type("Card", (), {"origin": origin})


def axis(inertia: float) -> Mount:
    return Mount(name="axis", axis=Axis(inertia=inertia), friction=Coulomb(Fc=1.0))


def test_an_inertia_that_stood_in_for_a_weight_is_no_doubt_once_the_weight_is_there(monkeypatch: Any) -> None:
    monkeypatch.setattr(doubts, "edges_of", lambda *_: {})
    problem: Any = type(
        "Problem",
        (),
        {"mount": axis(5.0), "top_speed": 1.0, "prepared": type("P", (), {"pieces": (), "names": ("run",)})},
    )
    before = (
        Sanity(finding="base_far_from_card", statement="Refitted, the inertia is 8 times the card's."),
        Sanity(finding="no_set_point", statement="No set point was recorded."),
    )
    assert [one.finding for one in doubts.of_delivered(before, card(), problem, axis(5.5))] == ["no_set_point"]
    said = doubts.of_delivered(before[1:], card(), problem, axis(45.0))
    assert [one.finding for one in said] == ["base_far_from_card", "no_set_point"]
    own = card(estimated_by="mount-cosim", recordings=["run"])
    assert [one.finding for one in doubts.of_delivered(before, own, problem, axis(45.0))] == ["no_set_point"]


def test_a_card_is_no_witness_of_its_own_recordings_and_their_parts_alone() -> None:
    own = card(estimated_by="mount-cosim", recordings=["run1"])
    assert doubts.is_estimated(own, ["run1"])
    assert doubts.is_estimated(own, ["run1 (begin)"])
    assert not doubts.is_estimated(own, ["run10", "run2"])
    assert not doubts.is_estimated(card(recordings=["run1"]), ["run1"])
