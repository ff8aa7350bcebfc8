"""Numbers as a mechanic reads them: SI inside, degrees and milli-units only on the page."""

import re
from dataclasses import dataclass
from math import floor, isfinite, log10, pi

import numpy as np

from cosim.diagnosis.result import Diagnosis

_TIGHT = ("°", "′", "″", "%")


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


_TORQUE = (Scale(1.0, "N·m"), Scale(1e3, "mN·m"), Scale(1e6, "µN·m"))
_FORCE = (Scale(1.0, "N"), Scale(1e3, "mN"), Scale(1e6, "µN"))
_ANGLE = (Scale(180 / pi, "°"), Scale(10800 / pi, "′"), Scale(648000 / pi, "″"))
_TURNING = tuple(Scale(scale.factor, f"{scale.unit}/s") for scale in _ANGLE)
_LENGTH = (Scale(1.0, "m"), Scale(1e3, "mm"), Scale(1e6, "µm"))
_MOVING = (Scale(1.0, "m/s"), Scale(1e3, "mm/s"), Scale(1e6, "µm/s"))


@dataclass(frozen=True)
class Scales:
    """The display units of one report."""

    torque: Scale
    position: Scale
    speed: Scale

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> "Scales":
        """Choose units in which the recordings of a diagnosis have handy numbers."""
        rotary = diagnosis.motion == "rotary"
        torque = max((_largest(trace.tau) for trace in diagnosis.traces), default=1.0)
        position = max((float(np.ptp(trace.q)) for trace in diagnosis.traces if trace.q.size), default=1.0)
        speed = max((_largest(trace.v) for trace in diagnosis.traces), default=1.0)
        return cls(
            _handy(_TORQUE if rotary else _FORCE, torque),
            _handy(_ANGLE if rotary else _LENGTH, position),
            _handy(_TURNING if rotary else _MOVING, speed),
        )

    def of_unit(self, unit: str) -> Scale:
        """Return the display unit for an SI unit."""
        known = {"rad": self.position, "m": self.position, "rad/s": self.speed, "m/s": self.speed}
        known |= {"N.m": self.torque, "N·m": self.torque, "N": self.torque}
        return known.get(unit, Scale(1.0, "" if unit == "1" else unit))

    def of_axis(self, axis: str) -> Scale:
        """Return the display unit for an axis of `Where`."""
        return {"position": self.position, "speed": self.speed, "time": Scale(1.0, "s")}.get(axis, Scale(1.0, ""))


def joined(value: str, unit: str) -> str:
    """Join number and unit; a narrow degree sign sticks, other units follow a hard space."""
    return f"{value}{unit}" if not unit or unit.startswith(_TIGHT) else f"{value}\N{NO-BREAK SPACE}{unit}"


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


def _largest(values: np.ndarray) -> float:
    return float(np.nanmax(np.abs(values))) if values.size else 0.0


def _handy(scales: tuple[Scale, ...], largest: float) -> Scale:
    """Return the first unit in which the largest value exceeds a tenth (or the last unit)."""
    return next((scale for scale in scales if largest * scale.factor > 0.1), scales[0] if largest == 0 else scales[-1])
