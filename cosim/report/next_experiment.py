"""What one more recording would tell, and how to take it: the motion with its speeds, stops and length."""

from collections.abc import Callable, Collection, Iterator, Mapping
from math import pi
from typing import Any

from cosim.diagnosis.answer.result import Diagnosis
from cosim.plots.quantities import FAMILIES, handy, joined, number, trimmed
from cosim.report import words
from cosim.report.quantities import Scales

SMALL = 0.1
"""A difference below this share of the noise takes longer to show than a recording lasts."""
FURTHER = "record motion that goes further or faster than in these recordings, if the axis allows it"
FURTHER_STILL = "If the axis allows it, record motion that goes further or faster than in these recordings instead."


def next_experiment(diagnosis: Diagnosis, scales: Scales) -> dict[str, object] | None:
    """Return its sentences and what to type; None where nothing is open."""
    plan = diagnosis.next_experiment
    if not plan:
        return None
    titles = {finding.name: words.lowered(finding.title) for finding in diagnosis.findings}
    names = [titles.get(str(name), str(name)) for name in plan.get("separates", ())]
    said = [words.started(words.closed(str(plan.get("description", ""))))]
    if how := motion(plan.get("set_point", {}), scales):
        said.append(words.closed(f"That is {how}, measured from the middle of what was visited"))
    said.append(_difference(diagnosis, " from ".join(names), scales) if len(names) > 1 else "")
    return {"sentences": [text for text in said if text], "steps": list(_steps(diagnosis))}


def is_weak(diagnosis: Diagnosis) -> bool:
    """Whether rivals would differ by too little, whatever motion within what was visited is recorded."""
    gap = float(diagnosis.next_experiment.get("expected_difference") or 0.0)
    return 0.0 < gap < SMALL * diagnosis.heldout.floor_rms


def to_record(diagnosis: Diagnosis) -> str:
    """Return what to record next, as an order; empty where nothing is open."""
    return FURTHER if is_weak(diagnosis) else str(diagnosis.next_experiment.get("description", ""))


def is_about(diagnosis: Diagnosis, effects: Collection[str]) -> bool:
    """Whether the next experiment is about these effects; one that separates no others is about whatever is open."""
    separates = diagnosis.next_experiment.get("separates", ())
    return not separates or not set(effects).isdisjoint(separates)


def _difference(diagnosis: Diagnosis, names: str, scales: Scales) -> str:
    gap, unit = float(diagnosis.next_experiment.get("expected_difference") or 0.0), scales.torque
    if not gap:
        return f"It separates {names}."
    ends = f"they then differ by {unit.text(gap)} RMS; noise is {unit.text(diagnosis.heldout.floor_rms)}"
    if is_weak(diagnosis):
        return f"Of motions within what was visited it best separates {names}, and hardly: {ends}. {FURTHER_STILL}"
    return f"It separates {names}: {ends}."


def _steps(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    """What to type: try the motion on the model, then diagnose again with the new recording."""
    plan, command = diagnosis.next_experiment, str(diagnosis.provenance.get("command", ""))
    if plan.get("command"):
        yield "Then", str(plan["command"])
    if plan.get("scenario"):
        yield "Try it on the model first", f"cosim run {plan['scenario']} --out next"
    if " --" in command:
        train, options = command.split(" --", 1)
        yield "With the new recording", f"{train} new_recording.parquet --{options} --force"


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
