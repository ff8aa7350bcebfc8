"""Numbers as a mechanic reads them: SI inside, degrees and milli-units only on the page."""

import re
from dataclasses import dataclass
from math import floor, isfinite, log10, pi

_TIGHT = ("°", "′", "″")


@dataclass(frozen=True)
class Scale:
    """A display unit: shown value = factor * SI value."""

    factor: float
    unit: str

    def number(self, value: float, digits: int = 2) -> str:
        """Return the number alone, with `digits` significant digits."""
        return number(value * self.factor, digits)

    def text(self, value: float, digits: int = 2) -> str:
        """Return number and unit."""
        return joined(self.number(value, digits), self.unit)

    def span(self, low: float, high: float) -> str:
        """Return a range, for example 20 to 90 °/s, both ends with the same decimals."""
        ends = decimals((low * self.factor, high * self.factor))
        return f"{ends[0]} to {joined(ends[1], self.unit)}"


TORQUE = (Scale(1.0, "N·m"), Scale(1e3, "mN·m"), Scale(1e6, "µN·m"))
FORCE = (Scale(1.0, "N"), Scale(1e3, "mN"), Scale(1e6, "µN"))
ANGLE = (Scale(180 / pi, "°"), Scale(10800 / pi, "′"), Scale(648000 / pi, "″"))
TURNING = tuple(Scale(scale.factor, f"{scale.unit}/s") for scale in ANGLE)
LENGTH = (Scale(1.0, "m"), Scale(1e3, "mm"), Scale(1e6, "µm"))
MOVING = (Scale(1.0, "m/s"), Scale(1e3, "mm/s"), Scale(1e6, "µm/s"))
FAMILIES = {"rad": ANGLE, "rad/s": TURNING, "m": LENGTH, "m/s": MOVING, "N.m": TORQUE, "N": FORCE}
"""Display units by SI unit."""


def joined(value: str, unit: str) -> str:
    """Join number and unit; an angle's sign sticks, other units follow a hard space."""
    return f"{value}{unit}" if not unit or unit.startswith(_TIGHT) else f"{value}\N{NO-BREAK SPACE}{unit}"


def labelled(name: str, unit: str) -> str:
    """Return a name with its unit behind it in brackets, if it has one."""
    return f"{name} [{unit}]" if unit else name


def number(value: float, digits: int = 2) -> str:
    """Return a value with `digits` significant digits and a true minus sign, without an exponent where readable."""
    if not isfinite(value):
        return "–"
    if value == 0:
        return "0"
    places = digits - 1 - floor(log10(abs(value)))
    if not -5 <= places <= 7:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    return _fixed(round(value, places), max(places, 0))


def spelled(text: str) -> str:
    """Return text whose numbers with an exponent from -4 to 6 are written out: 2.32e+06 as 2,320,000."""
    return re.sub(r"(?<![\w.])([-−]?\d(?:\.(\d+))?)e([+-]\d{2})(?!\d)", _spelled, text)


def _spelled(found: re.Match[str]) -> str:
    power = int(found[3])
    if not -4 <= power <= 6:
        return found[0]
    return _fixed(float(f"{found[1]}e{power}".replace("−", "-")), max(len(found[2] or "") - power, 0))


def raised(unit: str) -> str:
    """Return a unit as it is printed: N.m.s2/rad2 with points and powers."""
    powers = re.sub(r"(?<=[A-Za-z])\d", lambda found: "⁰¹²³⁴⁵⁶⁷⁸⁹"[int(found[0])], unit)
    return powers.replace(".", "·")


def trimmed(text: str) -> str:
    """Return a number without zeros at its end: a limit is no measurement."""
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text


def minus(text: str) -> str:
    """Return text whose negative numbers have a true minus sign."""
    return re.sub(r"(?<![\w.])-(?=[\d.])", "−", text)


def decimals(values: tuple[float, ...], digits: int = 2) -> tuple[str, ...]:
    """Return values that share a scale, all with the decimals that the largest needs."""
    largest = max((abs(value) for value in values if isfinite(value)), default=0.0)
    places = max(0, digits - 1 - floor(log10(largest))) if largest else 0
    return tuple(_fixed(value, min(places, 7)) if isfinite(value) else "–" for value in values)


def _fixed(value: float, places: int) -> str:
    text = f"{value:,.{places}f}"
    zero = not text.strip("-0.,")
    return text.lstrip("-") if zero else text.replace("-", "−")


def handy(scales: tuple[Scale, ...], largest: float) -> Scale:
    """Return the first unit in which the largest value exceeds a tenth (or the last unit)."""
    return next((scale for scale in scales if largest * scale.factor > 0.1), scales[0] if largest == 0 else scales[-1])


def scale_of(unit: str, largest: float) -> Scale:
    """Return the handiest display unit for values in an SI unit up to `largest`; units without one stay."""
    return handy(FAMILIES.get(unit, (Scale(1.0, "" if unit == "1" else unit.replace(".", "·")),)), largest)
