"""Which column is time, torque, position: told by names, then by units; said where it is guessed, refused in doubt.

t            time
tau          torque or force; where there are several, the command
q            position, not its set point and not its error
v            speed
q_d          set point of the position
temperature  temperature
"""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from cosim.data.text.names import is_unit, spelled
from cosim.support.units import unit

Names = tuple[str, ...]
COUNTED = ("count", "counts", "ticks", "increments", "inc")
"""Words that say that a position is in counts of an encoder."""

STEMS: dict[str, Names] = {
    "time": ("timestamp", "zeit", "uhrzeit", "epoch"),
    "torque": ("torque", "moment", "effort", "kraft", "force"),
    "current": ("strom", "current", "ampere"),
    "position": ("position", "winkel", "angle", "encoder", "lage", "theta"),
    "speed": ("velocity", "speed", "drehzahl", "geschwindigkeit", "omega"),
    "temperature": ("temperatur",),
    "asked": ("soll", "setpoint", "command", "reference", "desired", "target", "demand"),
    "wrong": ("error", "fehler", "abweichung", "deviation", "schlepp", "following", "residual", "limit", "grenz"),
    "measured": ("actual", "meas", "feedback", "istwert", "estimate"),
}
"""Parts of names in small letters, wherever they stand."""
WORDS: dict[str, Names] = {
    "time": ("t", "time", "times", "ts", "elapsed", "clock", "stamp", "date", "datetime", "millis", "micros", "nanos"),
    "torque": ("tau", "trq", "tq"),
    "current": ("iq", "isq", "i"),
    "position": ("q", "pos", "enc", "phi", *COUNTED),
    "speed": ("v", "vel", "velo", "n", "qd", "dq", "w"),
    "temperature": ("temp", "temperature"),
    "asked": ("set", "setp", "sp", "cmd", "ref", "des", "d", "input", "ziel"),
    "wrong": ("err", "diff", "lag", "delta", "max", "min"),
    "measured": ("act", "ist", "fb", "fbk", "real", "enc", "encoder", "est"),
}
"""Whole words of names in small letters."""
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
    """Guess which of the columns serves as `role`."""
    return _GUESSES[role]([name for name in names if name], units)


def counts(name: str, stated: str) -> bool:
    """Whether a position is in counts of an encoder."""
    return stated in ("count", "counts") or (not stated and any(word in COUNTED for word in words_of(name)))


def words_of(name: str) -> Names:
    """Cut a name into words in small letters: `MAIN.fActPos_2` becomes main, f, act, pos, 2."""
    return tuple(word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-zäöüß]+|\d+", name))


def _is(name: str, *kinds: str) -> bool:
    """Whether a name is of every one of the kinds; `!kind` is of none such."""
    return all(_is_one(name, kind.removeprefix("!")) != kind.startswith("!") for kind in kinds)


def _is_one(name: str, kind: str) -> bool:
    last = re.split(r"[./]", name)[-1]
    name = last if kind in QUANTITIES and any(_told(last, one) for one in QUANTITIES) else name
    return _told(name, kind)


def _told(name: str, kind: str) -> bool:
    words, whole = words_of(name), "".join(words_of(name))
    return any(word in WORDS[kind] for word in words) or any(stem in whole for stem in STEMS[kind])


def _of_unit(names: Collection[str], units: Mapping[str, str], *wanted: str) -> Names:
    stated = {name: spelled(units[name]) for name in names if name in units}
    return tuple(name for name, text in stated.items() if is_unit(text) and unit(text).si in wanted)


def _time(names: Collection[str], units: Mapping[str, str]) -> Guess:
    exact = tuple(name for name in names if name.lower() in ("t", "time"))
    named = tuple(name for name in names if _is(name, "time", "!wrong"))
    for among in (exact, named, _of_unit(names, units, "s")):
        if among:
            return Guess("t", among)
    return Guess("t")


def _torque(names: Collection[str], units: Mapping[str, str]) -> Guess:
    named = tuple(name for name in names if _is(name, "torque", "!wrong"))
    asked = tuple(name for name in named if _is(name, "asked"))
    current = tuple(name for name in names if _is(name, "current", "!wrong", "!position", "!speed"))
    for among in (asked, named, _of_unit(names, units, "N.m", "N")):
        if among:
            return Guess("tau", among)
    return Guess("tau", _first(current, "asked"), current=True) if current else Guess("tau")


def _position(names: Collection[str], units: Mapping[str, str]) -> Guess:
    named = tuple(name for name in names if _is(name, "position", "!asked", "!wrong", "!speed", "!torque"))
    plain = [name for name in names if not _is(name, "asked") and not _is(name, "wrong")]
    return Guess("q", _first(named, "measured") or _of_unit(plain, units, "rad"))


def _set_point(names: Collection[str], units: Mapping[str, str]) -> Guess:
    return Guess("q_d", tuple(name for name in names if _is(name, "position", "asked", "!wrong", "!speed", "!torque")))


def _speed(names: Collection[str], units: Mapping[str, str]) -> Guess:
    named = tuple(name for name in names if _is(name, "speed", "!asked", "!wrong"))
    return Guess("v", _first(named, "measured") or _of_unit(names, units, "rad/s"))


def _temperature(names: Collection[str], units: Mapping[str, str]) -> Guess:
    return Guess("temperature", tuple(name for name in names if _is(name, "temperature")))


def _first(names: Names, kind: str) -> Names:
    """Return the names of a kind if there are any, else all."""
    return tuple(name for name in names if _is(name, kind)) or names


_GUESSES: dict[str, Callable[[Collection[str], Mapping[str, str]], Guess]] = {
    "t": _time,
    "tau": _torque,
    "q": _position,
    "v": _speed,
    "q_d": _set_point,
    "temperature": _temperature,
}
