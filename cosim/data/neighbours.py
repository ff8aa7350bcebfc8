"""Which columns of a recording are the motion of a neighbouring axis: told by names, then by units.

A neighbour has a number or a place in its name (`q2`, `joint2_position`, `axis2.q`, `dq_2`, `a2`, `elbow_pos`,
`q_neighbour`) and a word for position, speed or acceleration, or a unit of one. Columns of one number or place belong
together. Whether such a column is the axis itself in other units, or its set point, only its values tell.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal

from cosim.data.roles import is_named
from cosim.data.text.names import words_of
from cosim.data.text.unit_words import is_unit, spelled
from cosim.support.units import unit

Kind = Literal["position", "speed", "acceleration"]
KINDS: tuple[Kind, ...] = ("position", "speed", "acceleration")
PER = dict(zip(("", "/s", "/s2"), KINDS, strict=True))
UNITS: dict[str, Kind] = {f"{of}{per}": kind for of in ("rad", "m") for per, kind in PER.items()}
PLACES = frozenset(
    {
        *("neighbour", "neighbor", "other", "next", "elbow", "shoulder", "wrist", "hip", "knee", "ankle", "waist"),
        *("torso", "neck", "forearm", "boom", "stick", "bucket", "slew", "alt", "az", "altitude", "azimuth"),
        *("elevation", "ra", "dec", "declination", "pan", "tilt", "yaw", "pitch", "roll", "x", "y", "z"),
    }
)
"""Words that say which axis a column is of, in small letters."""
SENSORS, AXES = (
    frozenset({"enc", "encoder", "sensor", "channel", "ch", "adc", "raw"}),
    frozenset({"joint", "axis", "link"}),
)
"""A number beside the first counts sensors of one axis (`encoder_2`), unless one of the second stands there too."""
OTHER_KINDS = ("asked", "wrong", "torque", "current", "voltage", "temperature", "time")
"""What a column is named for that is no motion that was measured."""
OWN = frozenset({"t", "tau", "q", "v", "q_d", "temperature"})


@dataclass(frozen=True)
class Neighbour:
    """Columns of one neighbouring axis; "" where there is none."""

    position: str = ""
    speed: str = ""
    acceleration: str = ""
    turns: bool = True
    """Whether it turns, as far as units say: an axis without a unit does."""

    @property
    def name(self) -> str:
        """The column by which it is called."""
        return self.position or self.speed or self.acceleration


def neighbours(names: Collection[str], units: Mapping[str, str]) -> tuple[Neighbour, ...]:
    """Neighbours among the columns of a recording, in the order of their names; `units` are SI units that are known."""
    found: dict[str, dict[Kind, str]] = {}
    for name in sorted(set(names) - OWN):
        kind, place = _kind(name, units.get(name, "")), _place(name)
        if kind and place:
            found.setdefault(place, {}).setdefault(kind, name)
    return tuple(
        Neighbour(**columns, turns=not any(_is_straight(units.get(name, "")) for name in columns.values()))
        for columns in found.values()
    )


def _kind(name: str, text: str) -> Kind | None:
    """What of a motion a column is: by its unit, else by its name."""
    if any(is_named(name, kind) for kind in OTHER_KINDS):
        return None
    if text and is_unit(text):
        return UNITS.get(unit(spelled(text)).si)
    if "a" in words_of(name):
        return "acceleration"
    return next((kind for kind in reversed(KINDS) if is_named(name, kind)), None)  # `q_dot` is a speed


def _place(name: str) -> str:
    """The number or the place of the axis; "" where the name holds none."""
    words = words_of(name)
    if SENSORS & {*words} and not AXES & {*words}:
        return ""
    numbers = [str(int(word)) for word in words if word.isdigit()]
    places = [word for word in words if word in PLACES]
    return numbers[0] if len(numbers) == 1 else places[0] if places and not numbers else ""


def _is_straight(text: str) -> bool:
    return bool(text) and is_unit(text) and unit(spelled(text)).si.startswith("m")
