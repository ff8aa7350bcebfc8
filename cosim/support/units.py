"""Units as text: what they are in SI, and whether two of them fit.

    value in SI = factor * value + offset

A unit is a product of names with integer powers: `N.m`, `mN m`, `Ncm`, `arcsec/s`, `rad/s^2`, `J/(kg.K)`, `%`, `1`.
Names take the usual prefixes; a number and a blank may stand before, as in `0.5 rad/s`, and brackets around, as in
`[m]`. Angles are dimensionless (rad = 1). Temperatures are degC inside, as in every recording. An empty text means
"unknown" and fits everything.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import pi

import numpy as np

from cosim.support.errors import UnitError

Dimension = tuple[int, int, int, int, int]
"""Powers of m, kg, s, A, K."""

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""Base units of FMI and SSP, in the order in which they are given there."""
_NONE: Dimension = (0, 0, 0, 0, 0)
_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}
_PREFIXED: dict[str, Dimension] = {
    "m": (1, 0, 0, 0, 0),
    "s": (0, 0, 1, 0, 0),
    "A": (0, 0, 0, 1, 0),
    "rad": _NONE,
    "N": (1, 1, -2, 0, 0),
    "J": (2, 1, -2, 0, 0),
    "W": (2, 1, -3, 0, 0),
    "V": (2, 1, -3, -1, 0),
    "Pa": (-1, 1, -2, 0, 0),
    "Hz": (0, 0, -1, 0, 0),
    "C": (0, 0, 1, 1, 0),
    "F": (-2, -1, 4, 2, 0),
    "H": (2, 1, -2, -2, 0),
    "T": (0, 1, -2, -1, 0),
}
_PLAIN: dict[str, tuple[float, Dimension, str]] = {
    "1": (1.0, _NONE, "1"),
    "%": (0.01, _NONE, "1"),
    "count": (1.0, _NONE, "1"),
    "counts": (1.0, _NONE, "1"),
    "deg": (pi / 180, _NONE, "rad"),
    "arcmin": (pi / 10800, _NONE, "rad"),
    "arcsec": (pi / 648000, _NONE, "rad"),
    "mas": (pi / 648000000, _NONE, "rad"),
    "rev": (2 * pi, _NONE, "rad"),
    "turn": (2 * pi, _NONE, "rad"),
    "rpm": (pi / 30, (0, 0, -1, 0, 0), "rad/s"),
    "kg": (1.0, (0, 1, 0, 0, 0), "kg"),
    "g": (1e-3, (0, 1, 0, 0, 0), "kg"),
    "min": (60.0, (0, 0, 1, 0, 0), "s"),
    "h": (3600.0, (0, 0, 1, 0, 0), "s"),
    "bar": (1e5, (-1, 1, -2, 0, 0), "Pa"),
    "mbar": (100.0, (-1, 1, -2, 0, 0), "Pa"),
    "L": (1e-3, (3, 0, 0, 0, 0), "m3"),
    "l": (1e-3, (3, 0, 0, 0, 0), "m3"),
    "Ohm": (1.0, (2, 1, -3, -2, 0), "Ohm"),
    "degC": (1.0, (0, 0, 0, 0, 1), "degC"),
    "degF": (5 / 9, (0, 0, 0, 0, 1), "degC"),
    "K": (1.0, (0, 0, 0, 0, 1), "degC"),
}
_OFFSETS = {"degF": -160 / 9, "K": -273.15}
_SPELLINGS = {"µ": "u", "μ": "u", "·": ".", "**": "", "*": ".", "²": "2", "³": "3", "^": "", "°C": "degC", "°": "deg"}
_ENCLOSED = re.compile(r"\[([^\[\]]*)\]$")
_BRACKETS = re.compile(r"/\(([^()]*)\)")
_NUMBER = re.compile(r"(\d\S*) +(?=[A-Za-z%])")
_FACTOR = re.compile(r"([A-Za-z%]+|1(?!\d))(-?\d+)?$")


@dataclass(frozen=True)
class Unit:
    """A unit in SI terms; `si` is the text of the SI unit that its values become."""

    factor: float
    offset: float
    dimension: Dimension
    si: str

    def to_si(self, values: np.ndarray) -> np.ndarray:
        """Convert values of any shape to SI."""
        return values if self.factor == 1.0 and self.offset == 0.0 else values * self.factor + self.offset


@lru_cache(maxsize=1024)
def unit(text: str) -> Unit:
    """Read a unit.

    Raises:
        UnitError: a name in the text is not a unit.
    """
    enclosed = _ENCLOSED.match(text.strip())
    number, normal = _number((enclosed[1] if enclosed else text).strip())
    for spelling, meaning in _SPELLINGS.items():
        normal = normal.replace(spelling, meaning)
    names: list[str] = []
    normal = _BRACKETS.sub(lambda found: "/" + found[1].replace(".", "/"), normal)
    factor, dimension = number, _NONE
    for sign, token in re.findall(r"([./ ]?)\s*([^./\s]+)", normal):
        one, powers, name = _factor(token, text)
        inverse = -1 if sign == "/" else 1
        factor *= one**inverse
        dimension = _times(dimension, powers, inverse)
        names.append(("/" if sign == "/" else "." if names else "") + name)
    return Unit(factor, _OFFSETS.get(normal, 0.0), dimension, "".join(names) or "1")


def in_base_units(name: str, powers: Mapping[str, int], factor: float, offset: float) -> str:
    """Write a unit that is not known here as its definition in base units says: `U/min` becomes `0.1047 rad/s`.

    A known name stays; so does one whose definition says nothing.
    """
    try:
        unit(name)
    except UnitError:
        base = ".".join(f"{one}{power if power != 1 else ''}" for one, power in powers.items() if power)
        if base and not offset and all(one in _PLAIN or one in _PREFIXED for one, power in powers.items() if power):
            return base if factor == 1 else f"{factor!r} {base}"
    return name


def conversion(source: str, target: str) -> tuple[float, float]:
    """Return (gain, offset) that turn a value in `source` into one in `target`; (1, 0) where one of them is unknown.

    Raises:
        UnitError: the units are of different kinds.
    """
    if not source or not target or source == target:
        return 1.0, 0.0
    have, need = unit(source), unit(target)
    if have.dimension != need.dimension:
        raise UnitError(f'"{source}" cannot become "{target}": they are different kinds of quantity.', value=source)
    return have.factor / need.factor, (have.offset - need.offset) / need.factor


def _number(text: str) -> tuple[float, str]:
    """Part a text such as `0.5 rad/s` into its number (1 where there is none) and the rest."""
    found = _NUMBER.match(text)
    try:
        return (float(found[1]), text[found.end() :]) if found else (1.0, text)
    except ValueError:
        return 1.0, text


def _factor(token: str, text: str) -> tuple[float, Dimension, str]:
    matched = _FACTOR.match(token)
    if matched is None:
        raise _unknown(text)
    name, power = matched[1], int(matched[2] or 1)
    scale, dimension, si = _name(name) or _pair(name, text)
    return scale**power, _times(_NONE, dimension, power), f"{si}{power}" if power != 1 else si


def _name(name: str) -> tuple[float, Dimension, str] | None:
    if name in _PLAIN:
        return _PLAIN[name]
    if name in _PREFIXED:
        return 1.0, _PREFIXED[name], name
    if name[0] in _PREFIXES and name[1:] in _PREFIXED:
        return _PREFIXES[name[0]], _PREFIXED[name[1:]], name[1:]
    return None


def _pair(name: str, text: str) -> tuple[float, Dimension, str]:
    """Read a torque written without a dot: Nm, Ncm, mNm, kNm."""
    split = name.find("N") + 1
    first, second = _name(name[:split]) if split else None, _name(name[split:]) if split < len(name) else None
    if first is None or second is None:
        raise _unknown(text)
    return first[0] * second[0], _times(first[1], second[1], 1), f"{first[2]}.{second[2]}"


def _times(one: Dimension, other: Dimension, power: int) -> Dimension:
    m, kg, s, a, k = (x + power * y for x, y in zip(one, other, strict=True))
    return m, kg, s, a, k


def _unknown(text: str) -> UnitError:
    known = (*_PLAIN, *_PREFIXED)
    return UnitError(f'"{text}" is no unit known here; known are: {", ".join(known)}.', value=text, choices=known)
