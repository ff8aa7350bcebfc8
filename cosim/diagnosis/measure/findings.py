"""From structures to sentences: findings of effects that stand, that rival them, or that were not proven.

What to do about an effect is its own advice, less what holds only where the improved model has the effect. A
random disturbance is a row among them: what shakes the machine all the time, and follows nothing that was recorded.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import ceil, floor, log10
from typing import Any

import numpy as np

from cosim.diagnosis.answer.entries import BroadbandEntry
from cosim.diagnosis.answer.result import Finding, Trace
from cosim.diagnosis.decide.calibration import calibrated
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of, named
from cosim.diagnosis.effects.candidates import at_own_level
from cosim.diagnosis.evidence.shaking import Shaken
from cosim.diagnosis.measure.locate import where
from cosim.diagnosis.search.admissibility import Numbers, numbers_of
from cosim.diagnosis.search.candidate_fit import CandidateFit, is_renamed
from cosim.diagnosis.search.rivals import AcceptedEffect
from cosim.estimation.prepare import Array
from cosim.support.statistics import Z95, rms
from pyfmi_models.effects import CATALOGUE, Effect
from pyfmi_models.model import parameters_of
from pyfmi_models.mount import LINEAR_UNITS, Mount

CYCLES = "cycles_per_rev"
"""How often a ripple comes round: in a turn, or on a linear axis in a metre."""


def accepted(
    one: AcceptedEffect,
    mount: Mount,
    errors: Mapping[str, float],
    traces: Sequence[Trace],
    members: Sequence[str],
    probability: float,
    predicted: float,
    is_detected: bool,
) -> Finding:
    """Describe an effect that stands, with the further waves of a ripple; `members` are rivals that stay open."""
    alike = [effect for effect in mount.effects if effect.name == one.effect.name][-len(one.effects) :]
    effect = max(alike, key=lambda own: float(getattr(own, "amplitude", 0.0)))
    harmonics = [other for other in alike if other is not effect]
    effect, numbers = _at_own_level(effect, numbers_of(effect, mount, errors), mount)
    own = hypothesis_of(effect)
    ranges = {n: (numbers.values[n] - Z95 * e, numbers.values[n] + Z95 * e) for n, e in numbers.errors.items()}
    size, size_range = _size(effect, numbers, mount)
    return Finding(
        effect=effect.id,
        source=effect.source,
        title=titled(effect),
        answer="found" if is_detected else "ambiguous",
        probability=probability,
        gain=one.own.plain_gain,
        parameters=numbers.values,
        harmonics=tuple(numbers_of(other, mount, errors).values for other in harmonics),
        standard_errors=numbers.errors,
        ranges=ranges,
        units=_units(effect, mount),
        size=size,
        size_range=size_range,
        statement=effect.statement(unit_on("N.m", mount)) + own.further(harmonics),
        where=where(effect, traces),
        ruled_out=tuple(_behind(one, members, True)),
        less_likely=tuple(_behind(one, members, False)),
        told_apart_by=_apart(one, members),
        action=advice(effect, True, mount.motion),
        evidence=f"removes {100 * one.own.plain_gain:.0f} % of the error energy in training "
        f"(evidence {one.own.evidence:.0f} nats; {predicted:.0f} nats on the held-out recordings){own.caveat}",
        visible_from=visible_from(effect, numbers),
    )


def titled(effect: Effect) -> str:
    """Its title, and its source where it has one."""
    return f"{effect.title} ({effect.source})" if effect.source else effect.title


def _apart(one: AcceptedEffect, members: Sequence[str]) -> str:
    """How the effect is told from its rivals; from another name of itself first, and alone where that is all."""
    same = [rival.effect for rival in one.rivals if rival.effect.name in members and is_renamed(rival.effect)]
    own = [one.effect.told_apart_by] if len(members) > len(same) or not same else []
    return "; ".join([*(other.told_apart_by for other in same), *own])


def _behind(one: AcceptedEffect, members: Sequence[str], far: bool) -> Iterator[str]:
    """Say by how much the rivals outside the set are behind: those far behind by both measures, or the others."""
    for rival in one.rivals:
        margin, lead = one.margin(rival), one.own.plain_gain - rival.plain_gain
        if rival.effect.id not in (*one.effect.rivals, one.effect.id) or rival.effect.name in members:
            continue
        if (margin >= POLICY.clear and lead >= POLICY.negligible) == far:
            both = f"{100 * rival.plain_gain:.1f} % of the error energy, this {100 * one.own.plain_gain:.1f} %"
            yield f"{titled(rival.effect)}: removes {both} ({margin:.0f} nats behind)"


def visible_from(effect: Effect, numbers: Numbers) -> float | None:
    """Size that would still stand out three standard errors from nothing."""
    main = effect.leading()
    told = main.parameter in numbers.errors and main.is_size
    return 3 * main.factor * numbers.errors[main.parameter] if told else None


def rival_finding(rival: CandidateFit, probability: float, mount: Mount) -> Finding:
    """Describe a rival that could not be excluded, or an effect that the held-out recordings do not confirm."""
    effect = rival.effect
    values = {variable.name: float(variable.start) for variable in parameters_of(effect)}
    size, _ = _size(effect, Numbers(values, {}), mount)
    return Finding(
        effect=effect.id,
        source=effect.source,
        title=titled(effect),
        answer="ambiguous",
        probability=probability,
        gain=rival.plain_gain,
        parameters=values,
        units=_units(effect, mount),
        size=size,
        statement=effect.statement(unit_on("N.m", mount)),
        told_apart_by=effect.told_apart_by,
        action=advice(effect, False, mount.motion),
    )


def _at_own_level(effect: Effect, numbers: Numbers, mount: Mount) -> tuple[Effect, Numbers]:
    """Return an effect and its numbers relative to the fitted level of friction."""
    relative = at_own_level(effect, mount)
    if relative is effect:
        return effect, numbers
    values = {variable.name: float(variable.start) for variable in parameters_of(relative)}
    errors = {name: error * values[name] / numbers.values[name] for name, error in numbers.errors.items()}
    return relative, Numbers(values, errors)


def measured_as(row: Finding, first: Finding, mount: Mount) -> Finding:
    """A rival that is the first by another name has its numbers, with their errors; any other stays as it is."""
    if named(row.effect).same_as != first.effect:
        return row
    names = dict(zip(first.parameters, row.parameters, strict=True))
    tables = (first.parameters, first.standard_errors, first.ranges)
    values, errors, ranges = ({names[name]: one for name, one in table.items()} for table in tables)
    known: Any = {"parameters": values, "standard_errors": errors, "ranges": ranges, "size": first.size}
    said = CATALOGUE[row.effect][0](**values).statement(unit_on("N.m", mount))
    return replace(row, **known, size_range=first.size_range, statement=said)


def taken_finding(one: CandidateFit, quantity: str, mount: Mount) -> Finding:
    """Describe an effect in whose place something without a name explains more."""
    evidence = f"what goes with {quantity} explains more in its place"
    return replace(rival_finding(one, 0.0, mount), answer="not_proven", evidence=evidence)


def _size(effect: Effect, numbers: Numbers, mount: Mount) -> tuple[str, str]:
    name, factor, unit, _ = effect.leading()
    value, error = factor * numbers.values[name], factor * numbers.errors.get(name, float("nan"))
    text = f"{abs(value):.3g} {unit_on(unit, mount)}"
    ends = sorted((abs(value) - Z95 * error, abs(value) + Z95 * error))
    return text, between(*ends) if np.isfinite(error) else ""


def between(low: float, high: float) -> str:
    """Write a range with as many digits as tell its ends apart by three steps at least, both alike: 5.995 to 6.005.

    Three digits of the larger end at least; nothing is written with a power of ten.
    """
    larger, width = max(abs(low), abs(high)), high - low
    digits = 2 - floor(log10(larger)) if larger > 0 else 0
    finer = ceil(log10(3 / width)) if width > 0 else digits
    places = min(max(digits, finer, 0), 12)
    return f"{low:.{places}f} to {high:.{places}f}"


def _units(effect: Effect, mount: Mount) -> dict[str, str]:
    units = {v.name: mount.in_axis_units(v).unit for v in parameters_of(effect)}
    return units | ({CYCLES: "1/m"} if mount.motion == "linear" and CYCLES in units else {})


def unit_on(unit: str, mount: Mount) -> str:
    """A unit as it is printed: that of force and length on a linear axis."""
    return (LINEAR_UNITS.get(unit, unit) if mount.motion == "linear" else unit).replace("N.m", "N·m")


NAMES_MODEL = re.compile(r"(?:(?P<clause>[;,])|(?<=\.))[^.;,]*\buse the improved model\b[^.;,]*\.?$", re.IGNORECASE)


def advice(effect: Effect, in_model: bool, motion: str) -> str:
    """Return the action on a "rotary" or "linear" axis; an effect that the improved model lacks is not sent to it."""
    linear = motion == "linear" and effect.action_linear
    action = effect.action_linear if linear else effect.action
    return action if in_model else without_model(action)


def without_model(action: str) -> str:
    """Return an action that does not send to the improved model."""
    return NAMES_MODEL.sub(lambda found: "." if found["clause"] else "", action)


ID = "broadband_disturbance"
"""Its id in diagnosis.json: the verdict calls it unknown."""
ACTION = "record at rest, with all around it off and on, and look for what shakes it: floor, wind, pump, another axis"


def broadband_entry(found: Shaken, residual: Array, friction: float, motion: str) -> BroadbandEntry:
    """Describe a disturbance; its probability is that of an effect that removes as much of the residual energy.

    `residual` is what the model leaves of the held-out recordings, `friction` the RMS of the friction [N m, N].
    """
    unit = "N" if motion == "linear" else "N·m"
    share = float(np.clip((found.level / max(rms(residual), 1e-300)) ** 2, 0.0, 1.0))
    return BroadbandEntry(
        level=found.level,
        relative=found.level / friction,
        low_hz=found.low,
        high_hz=found.high,
        probability=calibrated(share),
        statement=f"Broad-band disturbance of {found.level:.2g} {unit} RMS, {found.low:.2g} to {found.high:.2g} Hz, "
        "that is there at any motion and not caused by it.",
    )


def broadband_finding(entry: BroadbandEntry, motion: str) -> Finding:
    """The same as a row among the effects: as a name it is only possible, as what makes it is not known."""
    unit = "N" if motion == "linear" else "N.m"
    return Finding(
        effect=ID,
        title="Broad-band disturbance",
        answer="ambiguous",
        probability=entry["probability"],
        gain=0.0,
        parameters={name: entry[name] for name in ("level", "low_hz", "high_hz")},
        units={"level": unit, "low_hz": "Hz", "high_hz": "Hz"},
        size=f"{entry['level']:.2g} {unit.replace('.', '·')}",
        statement=entry["statement"],
        evidence=f"its level at any motion is {entry['relative']:.2g} of the friction, in training and held out",
        action=ACTION[:1].upper() + ACTION[1:] + ".",
    )
