"""Unit strings of the vocabulary as products of SI base units.

A unit is written as in Modelica: factors joined by dots, an integer exponent directly behind its symbol, at most one
denominator, which is in brackets if it has several factors: `N.m`, `kg.m2`, `N.m.s/rad`, `kg/(m.s2)`, `1/s`, `1`.
"""

import re
from dataclasses import dataclass
from math import pi

from pyfmi_models.errors import ExportError

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Unit:
    """`value in base units = factor * value + offset`, with the exponents of `BASE`; display maps names to factors."""

    name: str
    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0

    @property
    def display(self) -> dict[str, float]:
        """Units that a person may want to read instead, each with the factor from this unit to it."""
        return _DISPLAY.get(self.name, {})

    def display_for(self, size: float) -> str | None:
        """The unit in which a person would read values of this size: the coarsest in which it is no small number."""
        fits = [name for name, factor in self.display.items() if size * factor >= _SMALL]
        return next(iter([*fits, *reversed(self.display)]), None)


_SMALL = 0.02
_DISPLAY = {
    "rad": {"deg": 180 / pi, "arcsec": 648000 / pi},
    "rad/s": {"deg/s": 180 / pi, "arcsec/s": 648000 / pi},
    "rad/s2": {"deg/s2": 180 / pi, "arcsec/s2": 648000 / pi},
    "s": {"s": 1.0, "ms": 1e3},
    "m": {"m": 1.0, "mm": 1e3, "um": 1e6},
    "m/s": {"m/s": 1.0, "mm/s": 1e3, "um/s": 1e6},
    "N.m": {"N.m": 1.0, "mN.m": 1e3},
}
"""From the coarsest to the finest."""

# symbol: (factor to base units, exponents)
_SYMBOLS: dict[str, tuple[float, dict[str, int]]] = {
    **{name: (1.0, {name: 1}) for name in BASE},
    "1": (1.0, {}),
    "%": (0.01, {}),
    "count": (1.0, {}),
    "g": (1e-3, {"kg": 1}),
    "min": (60.0, {"s": 1}),
    "h": (3600.0, {"s": 1}),
    "deg": (pi / 180, {"rad": 1}),
    "arcmin": (pi / 10800, {"rad": 1}),
    "arcsec": (pi / 648000, {"rad": 1}),
    "rev": (2 * pi, {"rad": 1}),
    "Hz": (1.0, {"s": -1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "Pa": (1.0, {"kg": 1, "m": -1, "s": -2}),
    "J": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "C": (1.0, {"A": 1, "s": 1}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "Ohm": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
    "H": (1.0, {"kg": 1, "m": 2, "s": -2, "A": -2}),
    "T": (1.0, {"kg": 1, "s": -2, "A": -1}),
    "Wb": (1.0, {"kg": 1, "m": 2, "s": -2, "A": -1}),
    "degC": (1.0, {"K": 1}),
}
_PREFIXES = {"u": 1e-6, "m": 1e-3, "k": 1e3}
_SYMBOLS |= {
    name: (_PREFIXES[name[0]], _SYMBOLS[name[1:]][1])
    for name in ("mm", "um", "km", "ms", "us", "mrad", "urad", "kHz", "kN", "mN", "mA")
}


def parse_unit(text: str) -> Unit:
    """Read a unit string.

    `degC` alone has the offset 273.15 K; in a product it is a difference of temperatures and has none.
    Raises ExportError naming the unit that cannot be read and why.
    """
    if text == "degC":
        return Unit(text, _exponents({"K": 1}), offset=273.15)
    numerator, slash, denominator = text.partition("/")
    if slash and denominator.startswith("(") and denominator.endswith(")"):
        denominator = denominator[1:-1]
    elif "." in denominator:
        raise ExportError(f'unit "{text}": a denominator of several factors needs brackets, as in "kg/(m.s2)"')
    above, over = _product(numerator, text), _product(denominator, text) if slash else (1.0, {})
    combined = {name: above[1].get(name, 0) - over[1].get(name, 0) for name in BASE}
    return Unit(text, _exponents(combined), above[0] / over[0])


def _exponents(powers: dict[str, int]) -> tuple[int, ...]:
    return tuple(powers.get(name, 0) for name in BASE)


def _product(text: str, unit: str) -> tuple[float, dict[str, int]]:
    factor, powers = 1.0, dict.fromkeys(BASE, 0)
    for part in text.split("."):
        scale, exponents, exponent = _factor(part, unit)
        factor *= scale**exponent
        for name, power in exponents.items():
            powers[name] += power * exponent
    return factor, powers


def _factor(part: str, unit: str) -> tuple[float, dict[str, int], int]:
    match = re.fullmatch(r"(1|%|[A-Za-z]+)(-?\d+)?", part)
    if match is None or match[1] not in _SYMBOLS:
        raise ExportError(f'unit "{unit}": "{part}" is not known; symbols are: {", ".join(sorted(_SYMBOLS))}')
    scale, exponents = _SYMBOLS[match[1]]
    return scale, exponents, int(match[2] or 1)
