"""Learned terms of a card as maps: breakpoints, values and units, as data and as curves of text.

An FMU of the card carries them as maps.json beside its other related files (FMI-LS-REF). As array variables, which
FMI-LS-STRUCT (1.0.0-rc.1) describes, they are not in the FMU: its equations hold sums of waves, and the map is their
values at breakpoints.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cosim.fmi.description import complaint_of
from cosim.support.archive import read
from cosim.support.plain import Json, JsonObject
from pyfmi_models.card import Card
from pyfmi_models.effects.learned_base import LearnedEffect
from pyfmi_models.export.related import Related

BLOCKS = "▁▂▃▄▅▆▇█"
WIDTH = 24
"""Most blocks of a curve: its table then fits a terminal of 80 columns."""
FILE, FORMAT = "maps.json", "mount-cosim maps 1"
LARGEST = 2**24
"""Bytes of a file with maps that is read."""


def maps_of(card: Card) -> list[JsonObject]:
    """Learned terms: name, kind, `over` and `at` (breakpoints), `by` and `by_at` where there are two, `value`, `unit`.

    A term that remembers the motion has the numbers of its elements instead.
    """
    unit = "N.m" if card.mount.motion == "rotary" else "N"
    parts = card.plant().components().items()
    found: list[Any] = [{"name": name, **one.for_reader(unit)} for name, one in parts if isinstance(one, LearnedEffect)]
    return found


def related_maps(card: Card) -> tuple[Related, ...]:
    """The maps as a file of an FMU; nothing where the card has none."""
    maps = maps_of(card)
    if not maps:
        return ()
    content = json.dumps({"format": FORMAT, "maps": maps}, indent=1).encode()
    said = "Learned terms as maps: breakpoints, values, units"
    return (Related("application/json", FILE, "meta-data", said, content),)


def curves_in(path: Path, member: str) -> list[dict[str, Json]]:
    """The maps in a file of an FMU as `curves`; nothing where it is not as ours are, whatever its name."""
    try:
        document = json.loads(read(path, member, complaint_of(path), LARGEST))
        return curves(document["maps"]) if document["format"] == FORMAT else []
    except (ValueError, KeyError, TypeError, IndexError, AttributeError):
        return []


def curves(maps: list[JsonObject]) -> list[dict[str, Json]]:
    """A row a map of one quantity, or a value of the second one: range, values, and the curve in blocks."""
    return [row for one in maps if "value" in one for row in _rows(one)]


def _rows(one: JsonObject) -> Iterator[dict[str, Json]]:
    found: Any = one
    at, second = found["at"], found.get("by_at", [None])
    for k, by in enumerate(second):
        values = found["value"] if by is None else [row[k] for row in found["value"]]
        where = "" if by is None else f", at {found['by']} {by:.3g}"
        yield {
            "map": str(found["name"]),
            "kind": str(found["kind"]),
            "over": f"{found['over']}, {at[0]:.3g} to {at[-1]:.3g}{where}",
            "values": f"{min(values):.3g} to {max(values):.3g} {found['unit']}",
            "curve": curve(values),
        }


def curve(values: list[float]) -> str:
    """Draw values as blocks from the lowest to the highest, evenly taken where there are more than `WIDTH`."""
    if len(values) > WIDTH:
        values = [values[round(k * (len(values) - 1) / (WIDTH - 1))] for k in range(WIDTH)]
    low, high = min(values), max(values)
    size = high - low or 1.0
    return "".join(BLOCKS[min(len(BLOCKS) - 1, int((value - low) / size * len(BLOCKS)))] for value in values)
