"""From structures to sentences: one finding for every effect that was looked for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import sqrt
from typing import Any

import numpy as np

from cosim.diagnosis.calibration import calibrated
from cosim.diagnosis.candidates import columns_of
from cosim.diagnosis.challenge import Place
from cosim.diagnosis.evidence import Blocks, sandwich
from cosim.diagnosis.families import TRIED, candidates
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.locate import where
from cosim.diagnosis.prepare import Array, Prepared
from cosim.diagnosis.result import Finding, Trace
from cosim.diagnosis.shaken import heard
from cosim.diagnosis.structure import nuisances, projected
from cosim.diagnosis.trial import LEAST_GAIN, Trial
from pyfmi_models.effects import CATALOGUE, DriveEffect, Effect, GravityUnbalance
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.torque_offset import TorqueOffset
from pyfmi_models.friction import MemorylessLaw
from pyfmi_models.model import Variable, parameters_of
from pyfmi_models.mount import LINEAR_UNITS, Mount

Z95 = 1.96
MAIN = {
    "friction_asymmetry": ("level_asymmetry", 200.0, "%"),
    "torque_offset": ("torque", 1.0, "N.m"),
    "delay": ("delay_ms", 1.0, "ms"),
    "actuator_lag": ("time_constant_ms", 1.0, "ms"),
    "cogging": ("amplitude", 1.0, "N.m"),
    "stribeck": ("Fs", 1.0, "N.m"),
    "gravity_unbalance": ("mgl", 1.0, "N.m"),
    "position_friction": ("relative_amplitude", 100.0, "%"),
    "load_dependent_friction": ("coulomb_per_Nm", 100.0, "% of the load"),
    "dwell_breakaway": ("torque_per_efold", 1.0, "N.m"),
    "thermal_viscosity": ("viscous_per_degC", 100.0, "%/K"),
    "presliding": ("sigma0", 1.0, "N.m/rad"),
    "cable_wrap": ("stiffness", 1.0, "N.m/rad"),
    "quadratic_drag": ("coefficient", 1.0, "N.m.s2/rad2"),
    "torque_saturation": ("knee_torque", 1.0, "N.m"),
    "periodic_disturbance": ("amplitude", 1.0, "N.m"),
    "clock_skew": ("offset_ms", 1.0, "ms"),
    "inertia_variation": ("relative_amplitude", 100.0, "%"),
    "compliance": ("resonance_hz", 1.0, "Hz"),
    "backlash": ("gap_rad", 1.0, "rad"),
    "encoder_eccentricity": ("amplitude_rad", 1.0, "rad"),
}
"""The number that says how large an effect is: parameter, factor and unit of the text."""
NOTES = {
    "periodic_disturbance": "; its phase is that of each recording, told by the recording itself, by the one not "
    "fitted too; card and FMU hold that of the first"
}
"""What must be said beside the evidence."""
PLACES = ("stribeck", "presliding", "torque_saturation", "clock_skew", "compliance", "backlash")
"""Effects whose number says where they set in, not how large they are: no smallest size can be told."""


@dataclass(frozen=True)
class Numbers:
    """Parameters of one effect, and what the recordings say of their precision."""

    values: dict[str, float]
    errors: dict[str, float]


def standard_errors(chosen: Fit, blocks: Blocks, weight: Array) -> dict[str, float]:
    """Block-robust standard errors of all fitted parameters (sandwich with blocks as clusters)."""
    slopes = chosen.slopes * weight[:, None]
    scale = np.sqrt((slopes**2).sum(0)) + 1e-300
    covariance = sandwich(slopes / scale, chosen.residual * weight, blocks, rcond=1e-10)
    return dict(zip(chosen.free, (np.sqrt(np.maximum(np.diag(covariance), 0)) / scale).tolist(), strict=True))


def numbers_of(effect: Effect, mount: Mount, errors: Mapping[str, float]) -> Numbers:
    """Parameters of an effect of a fitted mount with their standard errors, by the effect's own names."""
    prefix = next(name for name, part in mount.components().items() if part is effect)
    values = {variable.name: float(variable.start) for variable in parameters_of(effect)}
    return Numbers(values, {name: errors[f"{prefix}.{name}"] for name in values if f"{prefix}.{name}" in errors})


def accepted(
    place: Place,
    harmonics: Sequence[Place],
    mount: Mount,
    errors: Mapping[str, float],
    traces: Sequence[Trace],
    proven: bool,
) -> Finding:
    """Describe an effect that stands; its further harmonics are told with it."""
    numbers, effect = numbers_of(place.effect, mount, errors), place.effect
    rivals = place.ambiguous_with
    answer = "not_proven" if not proven else "ambiguous" if rivals else "found"
    parameters: dict[str, Any] = dict(numbers.values)
    if harmonics:
        parameters["harmonics"] = [numbers_of(other.effect, mount, errors).values for other in harmonics]
    tones = sorted(other.effect.frequency_hz for other in harmonics if isinstance(other.effect, PeriodicDisturbance))
    further = f" Further tones: {', '.join(f'{hertz:.4g}' for hertz in tones)} Hz." if tones else ""
    ranges = {n: (numbers.values[n] - Z95 * e, numbers.values[n] + Z95 * e) for n, e in numbers.errors.items()}
    size, size_range = _size(effect, numbers, mount)
    general = {rival.effect.id: rival.effect.title.lower() for rival in place.more_general}
    simpler = f"; {' and '.join(general.values())} can look the same: the simpler one is named" if general else ""
    excluded = [rival for rival in place.rivals if rival.effect.id not in (*rivals, *general)]
    return Finding(
        effect=effect.id,
        title=effect.title,
        answer=answer,  # type: ignore[arg-type]
        probability=place.probabilities[place.effect.id],
        gain=place.trial.gain,
        parameters=parameters,
        standard_errors=numbers.errors,
        ranges=ranges,
        units=_units(effect, mount),
        size=size,
        size_range=size_range,
        statement=effect.statement("N" if mount.motion == "linear" else "N·m") + further,
        where=where(effect, traces),
        ruled_out=tuple(
            f"{rival.effect.title}: removes {rival.gain:.1%} of the error energy, this {place.trial.gain:.1%}"
            for rival in excluded
        ),
        told_apart_by=effect.told_apart_by,
        action=effect.action,
        evidence=f"removes {place.trial.gain:.0%} of the error energy on data left out of the fit "
        f"(t = {place.trial.t:.1f} over blocks){NOTES.get(effect.id, '')}{simpler}",
        visible_from=_visible_from(effect, numbers),
    )


def _visible_from(effect: Effect, numbers: Numbers) -> float | None:
    """Size that would still stand out three standard errors from nothing."""
    name, factor, _ = MAIN[effect.id]
    return 3 * factor * numbers.errors[name] if name in numbers.errors and effect.id not in PLACES else None


def rival_finding(rival: Trial, place: Place, mount: Mount) -> Finding:
    """Describe a rival that could not be excluded."""
    effect = rival.effect
    values = {variable.name: float(variable.start) for variable in parameters_of(effect)}
    size, _ = _size(effect, Numbers(values, {}), mount)
    return Finding(
        effect=effect.id,
        title=effect.title,
        answer="ambiguous",
        probability=place.probabilities.get(effect.id, calibrated(place.shares[effect.id])),
        gain=rival.gain,
        parameters=values,
        units=_units(effect, mount),
        size=size,
        statement=effect.statement("N" if mount.motion == "linear" else "N·m"),
        told_apart_by=effect.told_apart_by,
        action=effect.action,
    )


def not_found(
    chosen: Fit, prepared: Prepared, weight: Array, looked_at: Mapping[str, Trial], named: Sequence[str]
) -> list[Finding]:
    """One finding for each effect that is tried and not named: not seen from which size, or not testable."""
    nuisance = nuisances(chosen, prepared)
    tried = candidates(chosen.mount, prepared, chosen.residual, np.abs(nuisance.level))
    columns = columns_of(chosen.mount, tried, prepared, chosen.values)
    known = np.column_stack([chosen.slopes, nuisance.columns]) * weight[:, None]
    smallest: dict[str, float] = {}
    for candidate, column in zip(tried, columns, strict=True):
        size = _smallest(chosen, column[:, 0] * weight, known)
        if candidate.finite:
            size *= abs(getattr(candidate.instances[0], MAIN[candidate.effect][0]))
        smallest[candidate.effect] = min(size, smallest.get(candidate.effect, np.inf))
    rest = [name for name in TRIED if name not in named]
    return [_absent(name, smallest.get(name), looked_at.get(name), chosen.mount, prepared) for name in rest]


def _smallest(chosen: Fit, column: Array, known: Array) -> float:
    """Size whose column would hold `LEAST_GAIN` of the residual energy beyond what the structure can imitate."""
    own = float(np.sum(projected(column, known) ** 2))
    rest = float(np.sum(chosen.residual**2))
    return sqrt(LEAST_GAIN / (1 - LEAST_GAIN) * rest / own) if own > 0 else float("inf")


def _absent(name: str, smallest: float | None, trial: Trial | None, mount: Mount, prepared: Prepared) -> Finding:
    form = CATALOGUE[name][0]
    _, factor, unit = MAIN[name]
    high = next(v.high for v in _parameters(form) if v.name == MAIN[name][0])
    torque = float(np.abs(prepared.stacked("tau")).max())
    most = min(high, 10 * torque if unit == "N.m" else np.inf)
    testable = smallest is not None and smallest < most
    reason = _where_looked(name, prepared) if testable else _why_not(name, mount, prepared)
    return Finding(
        effect=name,
        title=form.title,
        answer="not_seen" if testable else "not_testable",
        probability=0.0,
        gain=max(0.0, trial.gain) if trial else 0.0,
        units={MAIN[name][0]: _unit(unit, mount)},
        visible_from=factor * smallest if testable and smallest is not None and name not in PLACES else None,
        evidence=reason,
        action="" if testable else reason,
    )


def _parameters(form: type[Effect]) -> list[Variable]:
    return [replace(f.metadata["variable"], name=f.name) for f in fields(form) if "variable" in f.metadata]


def _where_looked(name: str, prepared: Prepared) -> str:
    """Where an effect would have been seen, if not everywhere."""
    if name != "periodic_disturbance":
        return ""
    slowest, fastest = heard(prepared)
    return f"between {slowest:.2g} and {fastest:.3g} Hz"


def _why_not(name: str, mount: Mount, prepared: Prepared) -> str:
    if name == "gravity_unbalance" and mount.motion == "linear":
        return "a linear axis has no unbalance"
    if name == "gravity_unbalance" and any(isinstance(effect, GravityUnbalance) for effect in mount.effects):
        return "the card has it already"
    if name == "stribeck" and getattr(mount.friction, "Fs", None) is not None:
        return "the card's friction law has it already"
    if name == "periodic_disturbance":
        return "too short, or the motion repeats itself or turns steadily; record a motion that wanders"
    if not prepared.has_position and name in ("cogging", "position_friction", "gravity_unbalance"):
        return "no position was recorded; record q"
    if name == "friction_asymmetry" and isinstance(mount.friction, MemorylessLaw) and mount.of_kind(TorqueOffset):
        return "alike to the torque offset that was found where the law says nothing of rest; take lugre in the card"
    if name in ("delay", "actuator_lag", "clock_skew") and not any(piece.asked for piece in prepared.pieces):
        return "nothing asks for a change of torque; record a speed that changes, and the set point"
    if name in ("delay", "actuator_lag") and any(isinstance(effect, DriveEffect) for effect in mount.effects):
        return "alike to what was found in the drive; record faster reversals to tell them apart"
    return "the model has it already, or these recordings do not excite it"


def _size(effect: Effect, numbers: Numbers, mount: Mount) -> tuple[str, str]:
    name, factor, unit = MAIN[effect.id]
    if effect.id == "friction_asymmetry" and abs(numbers.values["viscous_asymmetry"]) > abs(numbers.values[name]):
        name, unit = "viscous_asymmetry", "% viscous"
    value, error = factor * numbers.values[name], factor * numbers.errors.get(name, float("nan"))
    text = f"{abs(value):.3g} {_unit(unit, mount)}"
    ends = sorted((abs(value) - Z95 * error, abs(value) + Z95 * error))
    return text, f"{ends[0]:.3g} to {ends[1]:.3g}" if np.isfinite(error) else ""


def _units(effect: Effect, mount: Mount) -> dict[str, str]:
    return {v.name: mount.in_axis_units(v).unit for v in parameters_of(effect)}


def _unit(unit: str, mount: Mount) -> str:
    return (LINEAR_UNITS.get(unit, unit) if mount.motion == "linear" else unit).replace("N.m", "N·m")
