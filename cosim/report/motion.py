"""The next experiment in the words and units of the page: the motion with its speeds, stops and length."""

from collections.abc import Callable, Mapping
from math import pi
from typing import Any

from cosim.plots.quantities import FAMILIES, handy, joined, number, trimmed
from cosim.report.quantities import Scales


def motion(point: Mapping[str, Any], scales: Scales) -> str:
    """Say how the axis shall move, for example "a sine of 0.15 Hz and 35° to each side, up to 33°/s"."""
    kind = _KINDS.get(str(point.get("kind", "")))
    return kind(point, scales) if kind else ""


def _sine(point: Mapping[str, Any], scales: Scales) -> str:
    fastest = 2 * pi * float(point["frequency"]) * float(point["amplitude"])
    side = _length(float(point["amplitude"]), scales)
    return f"a sine of {_hertz(point['frequency'])} and {side} to each side, up to {scales.speed.text(fastest)}"


def _chirp(point: Mapping[str, Any], scales: Scales) -> str:
    side = _length(float(point["amplitude"]), scales)
    return f"a sine of {side} to each side that rises from {_hertz(point['start'])} to {_hertz(point['stop'])}"


def _multisine(point: Mapping[str, Any], scales: Scales) -> str:
    tones = list(point["frequencies"])
    return f"{len(tones)} tones at once between {_hertz(min(tones))} and {_hertz(max(tones))}"


def _slews(point: Mapping[str, Any], scales: Scales) -> str:
    places = scales.position.span(min(point["positions"]), max(point["positions"]))
    rests = list(point["dwell"])
    speed = scales.speed.text(float(point["max_velocity"]))
    return f"slews from {places} at up to {speed}, with rests of {min(rests):g} to {max(rests):g} s"


def _length(value: float, scales: Scales) -> str:
    """An angle or a length in a unit that needs no zeros: a chirp moves an axis by much less than its stroke."""
    family = next(family for family in FAMILIES.values() if scales.position in family)
    return handy(family, abs(value)).text(value)


def _hertz(value: Any) -> str:
    return joined(trimmed(number(float(value))), "Hz")


_KINDS: dict[str, Callable[[Mapping[str, Any], Scales], str]] = {
    "sine": _sine,
    "chirp": _chirp,
    "multisine": _multisine,
    "slews": _slews,
}
