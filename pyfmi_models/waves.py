"""Waves over a quantity: the shapes of learned tables, and what a table may go over.

    cos(pi k x),   x = (p(s) - p(lo)) / (p(hi) - p(lo)), held between 0 and 1

[lo, hi] is the range in which the quantity was seen. All waves are level at both ends, so beyond them a sum keeps its
last value and its slope is continuous. For speed, acceleration and command p(s) = s / (|s| + w), w a share of the
largest size seen (`WARP`): half of the waves' room belongs to what is smaller than w, as most happens near zero. Over
a turn the waves are cosine and sine of the angle's multiples.
"""

from collections.abc import Sequence
from math import isfinite, pi

import casadi as ca

from pyfmi_models.model import Scalar, Variable

WARP = {"speed": 0.05, "command": 0.05, "acceleration": 0.3}
"""Share of the largest value seen, below which the waves lie dense: friction and dead bands bend at a small one, what
an acceleration does grows with it up to the largest."""
UNITS = {
    "position": "rad",
    "turn": "rad",
    "speed": "rad/s",
    "payload": "N.m",
    "temperature": "degC",
    "command": "N.m",
    "acceleration": "rad/s2",
    "way": "rad",
}
"""What a table may go over, beside inputs of any name, and its unit for a rotary axis."""
INPUT = "input."
"""Before the name of any other input of the plant."""


def waves(value: Scalar, name: str, seen: Sequence[float], count: int) -> list[Scalar]:
    """Waves 0 to `count` of a quantity; over a turn cosine and sine of each."""
    if name == "turn":
        cosines, sine = _cosines(ca.cos(value), count), ca.sin(value)
        sines = [sine * one for one in _seconds(ca.cos(value), count)]
        return [cosines[0], *(one for pair in zip(cosines[1:], sines, strict=True) for one in pair)]
    if not count:
        return [1.0]
    low, high = (_dense(edge, name, seen) for edge in seen)
    place = (_dense(value, name, seen) - low) / (high - low)
    return _cosines(ca.cos(pi * ca.fmin(ca.fmax(place, 0.0), 1.0)), count)


def input_of(name: str, seen: Sequence[float]) -> tuple[Variable, ...]:
    """The plant input that a quantity is, if it is one."""
    if name == "temperature":
        return (Variable(name=name, unit="degC", description="Temperature of the bearing", start=20.0),)
    if name.startswith(INPUT):
        own, middle = name.removeprefix(INPUT), (seen[0] + seen[1]) / 2
        return (Variable(name=own, unit="1", description=f"Recorded column {own}", start=middle),)
    return ()


def broken_range(name: str, key: str, seen: Sequence[float]) -> str:
    """Say what is wrong with a quantity or its range; empty if nothing."""
    own = name.removeprefix(INPUT)
    if name not in UNITS and not (name.startswith(INPUT) and own.isidentifier() and own.isascii()):
        return f'"{name}" is no quantity; quantities are: {", ".join(UNITS)}, {INPUT}NAME'
    if name == "turn":
        return f"{key} is not for the turn, which has been seen whole" if seen else ""
    if len(seen) != 2 or not all(map(isfinite, seen)) or not seen[0] < seen[1]:
        return f"{key} must be two numbers, the lowest and the highest {spoken(name)} seen, the lower one first"
    return ""


def spoken(name: str) -> str:
    """A quantity in words."""
    return {"turn": "position over the turn", "way": "way travelled"}.get(name, name.removeprefix(INPUT))


def span(name: str, seen: Sequence[float], linear: bool = False) -> str:
    """A quantity and its range in words."""
    if name == "turn":
        return "the whole turn"
    unit = f" {UNITS[name]}" if name in UNITS else ""
    unit = unit.replace("rad", "m").replace("N.m", "N") if linear else unit
    return f"{spoken(name)} {seen[0]:.4g} to {seen[1]:.4g}{unit}"


def _dense(value: Scalar, name: str, seen: Sequence[float]) -> Scalar:
    """A quantity, spread out near zero where most of it happens there."""
    if name not in WARP:
        return value
    return value / (ca.fabs(value) + WARP[name] * max(abs(seen[0]), abs(seen[1])))


def _cosines(c: Scalar, count: int) -> list[Scalar]:
    """cos(k x) for k from 0 to `count`, from c = cos x (Chebyshev)."""
    found: list[Scalar] = [1.0, c]
    while len(found) <= count:
        found.append(2 * c * found[-1] - found[-2])
    return found[: count + 1]


def _seconds(c: Scalar, count: int) -> list[Scalar]:
    """sin((k + 1) x) / sin x for k from 0 to `count` - 1."""
    found: list[Scalar] = [1.0, 2 * c]
    while len(found) < count:
        found.append(2 * c * found[-1] - found[-2])
    return found[:count]
