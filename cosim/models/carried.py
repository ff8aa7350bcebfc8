"""What an FMU of a card carries along: where its numbers are from, where it is proven, and its maps."""

from cosim.models.maps import related_maps
from pyfmi_models.card import Card
from pyfmi_models.export.related import Related, identified


def related_of(card: Card, name: str) -> tuple[Related, ...]:
    """The files that go with the plant of a card, whose FMU is called `name`."""
    return (*identified(name, card.origin, b""), *related_maps(card))
