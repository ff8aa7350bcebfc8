"""Where a number says where an effect sets in, the bound is the last member that is found before one that is not."""

from types import SimpleNamespace
from typing import Any

import pytest

from cosim.diagnosis.measure.bounds import tested as seen_from


def bound(easiest: int, found: dict[float, bool], nameless: tuple[float, ...] = ()) -> Any:
    """The bound over members at places, of which some are found in both ways in which they can be concealed."""
    members = [
        (SimpleNamespace(easiest=easiest, place=at, has_name=at not in nameless, directions=(1, -1), instance=at), at)
        for at in found
    ]
    concealment: Any = SimpleNamespace(is_found=lambda at, way: found[at] or way < 0)
    return seen_from(concealment, {"kind": members}).get("kind")  # type: ignore[dict-item]


@pytest.mark.parametrize(("easiest", "last"), [(-1, 20.0), (1, 30.0)])
def test_members_that_are_easier_to_find_come_first_and_the_last_found_is_left_out(easiest: int, last: float) -> None:
    """A stiff spring shows at low frequencies, a play where it is wide; what is not found ends it."""
    places = [30.0, 10.0, 40.0, 20.0, 50.0]
    seen = bound(easiest, {at: at < 35 if easiest < 0 else at > 15 for at in places})
    assert seen.size == last
    assert seen.places == ((10.0, 20.0) if easiest < 0 else (30.0, 50.0))
    assert (seen.power, seen.instance) == (1.0, 10.0 if easiest < 0 else 50.0)


def test_one_that_is_found_alone_is_the_bound_and_none_has_none() -> None:
    assert bound(-1, {10.0: True, 20.0: False, 30.0: True}).size == 10.0
    assert bound(-1, {10.0: False, 20.0: True}) is None
    assert bound(1, {10.0: True, 20.0: True}, nameless=(20.0,)) is None, "it would not be given its name"
