"""Which column is time, torque, position: told by names, then by units; said where it is guessed, refused in doubt.

t            time
tau          torque or force; where there are several, the command
q            position, not its set point and not its error
v            speed
q_d          set point of the position
temperature  temperature
"""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from cosim.data.text.names import words_of
from cosim.data.text.unit_words import is_unit, spelled
from cosim.support.units import unit

Names = tuple[str, ...]
COUNTED = ("count", "counts", "ticks", "increments", "inc")
"""Words that say that a position is in counts of an encoder."""

SUITED: dict[str, Names] = {
    "t": ("s",),
    "tau": ("N.m", "N", "A", "1"),
    "q": ("rad", "m", "1"),
    "v": ("rad/s", "m/s", "1/s"),
    "q_d": ("rad", "m", "1"),
    "temperature": ("degC",),
}
"""What the unit of a column may become in SI; a current, counts and shares become it with a number of the machine's."""
STEMS: dict[str, Names] = {
    "time": ("timestamp", "zeit", "uhrzeit", "epoch"),
    "torque": ("torque", "moment", "effort", "kraft", "force"),
    "current": ("strom", "current", "ampere"),
    "position": ("position", "winkel", "angle", "encoder", "lage", "theta"),
    "speed": ("velocity", "speed", "drehzahl", "geschwindigkeit", "omega"),
    "temperature": ("temperatur",),
    "voltage": ("voltage", "spannung", "volt", "flux", "psi"),
    "acceleration": ("accel", "beschleunigung"),
    "asked": ("soll", "goal", "setpoint", "command", "reference", "desired", "target", "demand"),
    "wrong": (
        *("error", "fehler", "abweichung", "deviation", "schlepp", "following", "residual", "limit", "grenz"),
        *("status", "enable", "valid", "ready", "alarm", "inpos", "gain"),
    ),
    "measured": ("actual", "meas", "feedback", "istwert", "estimate"),
}
"""Parts of names in small letters, wherever they stand."""
WORDS: dict[str, Names] = {
    "time": ("t", "time", "times", "ts", "elapsed", "clock", "stamp", "date", "datetime", "millis", "micros", "nanos"),
    "torque": ("tau", "trq", "tq"),
    "current": ("iq", "isq", "i"),
    "position": ("q", "pos", "enc", "phi", *COUNTED),
    "speed": ("v", "vel", "velo", "n", "qd", "dq", "w", "rpm", "dps", "rps", "spd", "dot"),
    "temperature": ("temp", "temperature"),
    "voltage": ("uq", "ud", "vq", "vd", "vbus", "udc", "bat", "batt", "battery", "supply", "vin", "vout", "vcc", "vdd"),
    "acceleration": ("acc", "ddq", "qdd", "ddot"),
    "asked": ("set", "setp", "sp", "cmd", "ref", "des", "d", "input", "ziel"),
    "wrong": ("err", "diff", "lag", "delta", "max", "min", "mode", "flag", "state", "ok"),
    "measured": ("act", "ist", "fb", "fbk", "real", "enc", "encoder", "est"),
}
"""Whole words of names in small letters."""
OF_WINDINGS = re.compile(r"(?:^|[_.\s])(?:[a-z]|psi|duty|pwm)[_.\s-]?q(?:$|[_.\s])|\bq[-_ ]?axis\b", re.IGNORECASE)
"""A current, voltage or flux of the q axis of a motor's windings: `i_q`, `Vq`, `q-axis current`; no position."""
VOLTS = re.compile(r"(?:^|[^A-Za-z])V(?:$|[^A-Za-z])")
"""A capital V is volts, and no speed."""
OF_FLUX = re.compile(
    r"(?:^|[_.\s])(?:i[_.\s-]?s?d|(?:motor[_.\s-])?current[_.\s-]?d|d[_.\s-]?(?:axis[_.\s-]?)?current)(?:$|[_.\s])",
    re.IGNORECASE,
)
"""A current of the d axis, which makes flux and no torque."""
QUANTITIES = ("time", "torque", "current", "position", "speed", "temperature")
"""Kinds that the last part of a path tells alone: `pos_vel_mapper.pos_rel` is a position."""


@dataclass(frozen=True)
class Guess:
    """What may serve as one of our columns: `name` if one only does, else all of them; `current` if a current does."""

    role: str
    among: Names = ()
    current: bool = False

    @property
    def name(self) -> str:
        """The one column, or an empty text."""
        return self.among[0] if len(self.among) == 1 and not self.current else ""


def guess(role: str, names: Collection[str], units: Mapping[str, str]) -> Guess:
    """Guess which of the columns serves as `role`.

    Where some of the columns that are named for it are in a unit that becomes ours, the others are none of it.
    """
    names = [name for name in names if name]
    among, is_current = next(filter(None, _candidates(role, names, units)), ()), False
    if role == "tau" and not among:
        currents = (name for name in names if _is(name, "current", "!wrong", "!speed") and not OF_FLUX.search(name))
        among = _first(tuple(currents), "asked")
        is_current = bool(among)
    return Guess(role, tuple(name for name in among if suits(role, units.get(name, ""))) or among, is_current)


def suits(role: str, text: str) -> bool:
    """Whether a unit is none that is known, or becomes one of those of a column of ours."""
    return not is_unit(text) or unit(spelled(text)).si in SUITED[role]


def is_named(name: str, *kinds: str) -> bool:
    """Whether a name tells a quantity, or one of these kinds of it."""
    return any(_is(name, kind) for kind in kinds or QUANTITIES)


def is_speed(name: str) -> bool:
    """Whether a column is named as a speed that was measured."""
    return _is(name, *_SPEED)


def tell_an_axis(names: Collection[str], units: Mapping[str, str]) -> bool:
    """Whether columns tell of torque and of motion."""
    rules = (("tau",), ("q", "v"))
    return all(any(role in names or guess(role, names, units).among for role in rule) for rule in rules)


def counts(name: str, stated: str) -> bool:
    """Whether a position is in counts of an encoder."""
    return stated in ("count", "counts") or (not stated and any(word in COUNTED for word in words_of(name)))


def _is(name: str, *kinds: str) -> bool:
    """Whether a name is of every one of the kinds; `!kind` is of none such."""
    return all(_is_one(name, kind.removeprefix("!")) != kind.startswith("!") for kind in kinds)


def _is_one(name: str, kind: str) -> bool:
    last = re.split(r"[./]", name)[-1]
    name = last if kind in QUANTITIES and any(_names_kind(last, one) for one in QUANTITIES) else name
    return _names_kind(name, kind)


def _names_kind(name: str, kind: str) -> bool:
    words, whole = words_of(name), "".join(words_of(name))
    if kind == "current" and (any(one in whole for one in _NOUNS) or any(word in _NOUN_WORDS for word in words)):
        return False  # `current_position` is where it is now
    if kind == "position" and OF_WINDINGS.search(name):
        return False
    if kind == "speed" and VOLTS.search(name):
        words = tuple(word for word in words if word != "v")
    return any(word in WORDS[kind] for word in words) or any(stem in whole for stem in STEMS[kind])


def _of_unit(names: Collection[str], units: Mapping[str, str], *wanted: str) -> Names:
    stated = {name: spelled(units[name]) for name in names if units.get(name)}
    return tuple(name for name, text in stated.items() if is_unit(text) and unit(text).si in wanted)


_NOUNS = tuple(stem for kind in ("position", "speed", "torque") for stem in STEMS[kind])
_NOUN_WORDS = ("pos", "vel", "velo", "spd", "rpm", "trq", "tau", "temp", "temperature")
_SPEED = ("speed", "!asked", "!wrong", "!current", "!voltage", "!torque", "!acceleration")
_POSITION = ("position", "!wrong", "!speed", "!torque", "!current", "!voltage", "!acceleration", "!temperature")


def _candidates(role: str, names: Collection[str], units: Mapping[str, str]) -> Iterator[Names]:
    """What may serve as a role, the best first; each is taken only where those before it are empty."""

    def of(*kinds: str) -> Names:
        return tuple(name for name in names if _is(name, *kinds))

    if role == "t":
        yield tuple(name for name in names if name.lower() in ("t", "time"))
        yield of("time", "!wrong")
        yield _of_unit(names, units, "s")
    elif role == "tau":
        yield of("torque", "!wrong", "!temperature", "asked")
        yield of("torque", "!wrong", "!temperature")
        yield _of_unit(names, units, "N.m", "N")
    elif role == "q":
        yield _first(of(*_POSITION, "!asked"), "measured")
        yield _of_unit(of("!asked", "!wrong"), units, "rad", "m")
    elif role == "q_d":
        yield of(*_POSITION, "asked")
    elif role == "v":
        yield _first(tuple(name for name in of(*_SPEED) if suits("v", units.get(name, ""))), "measured")
        yield _of_unit(of("!asked", "!wrong"), units, "rad/s", "m/s")
    elif role == "temperature":
        yield of("temperature")


def _first(names: Names, kind: str) -> Names:
    """Return the names of a kind if there are any, else all."""
    return tuple(name for name in names if _is(name, kind)) or names
