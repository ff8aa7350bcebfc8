"""What a diagnosis finds: plain data, the same for the JSON file, the terminal and the report.

Torques are in N m (forces in N for a linear axis), times in s, positions in rad (m). Residuals follow the protocol of
`residual.py`; "before" is the base with its parameters refitted, "after" the base with the missing physics.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Answer = Literal["found", "ambiguous", "not_proven", "not_seen", "not_testable"]
SPECIAL = {"torque_offset": ("friction_asymmetry", "cable_wrap")}
"""Effects that are a special case of others: what both explain, the special one predicts alike."""


def is_special(effect: str, rivals: Sequence[str]) -> bool:
    """Whether an effect is a special case of all its rivals: then it goes into a model, whichever is the cause."""
    return set(rivals) <= set(SPECIAL.get(effect, ()))


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where an effect acts: an axis ("position", "speed", "direction", "time", "everywhere", ...) and its regions."""

    axis: str
    description: str
    regions: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One effect that was looked for, and the answer."""

    effect: str
    title: str
    answer: Answer
    probability: float
    gain: float
    """Share of the cross-validated residual energy that this effect removes (0..1), on training data."""
    parameters: dict[str, Any] = field(default_factory=dict)
    """Numbers by name; those of the further waves of a ripple as a list under "harmonics"."""
    standard_errors: dict[str, float] = field(default_factory=dict)
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    """95 % ranges of the parameters, from a block bootstrap."""
    units: dict[str, str] = field(default_factory=dict)
    size: str = ""
    """Main number with unit, for example "0.42 N·m"; `size_range` its 95 % range, "0.39 to 0.45"."""
    size_range: str = ""
    statement: str = ""
    where: Where | None = None
    ruled_out: tuple[str, ...] = ()
    told_apart_by: str = ""
    action: str = ""
    evidence: str = ""
    visible_from: float | None = None
    """Smallest size of the main parameter that these recordings would have shown (unit as in `size`)."""


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """RMS of the torque residual on one recording that was not fitted."""

    name: str
    nominal_rms: float
    before_rms: float
    after_rms: float
    floor_rms: float
    confidence_interval: tuple[float, float]
    """95 % range of before_rms - after_rms from a block bootstrap."""
    sliding: dict[str, float] = field(default_factory=dict)
    """The same RMS values over samples in clear motion only, with the cutoff and the least speed used."""
    unvetoed_rms: float | None = None
    """RMS with all effects that training alone proposed, before this recording's veto."""
    black_box_rms: float | None = None
    """RMS that the refitted base leaves with a smooth black box beside it, learnt on the training recordings."""
    position: dict[str, float] = field(default_factory=dict)
    """Closed-loop position error RMS (set point driven), where the controller is known: nominal, before, after."""


@dataclass(frozen=True, kw_only=True)
class Trace:
    """Signals of one recording, one value a row, for pictures; residual = tau - model, filtered."""

    name: str
    heldout: bool
    t: Array
    q: Array
    v: Array
    tau: Array
    """Filtered measured torque."""
    before: Array
    after: Array
    missing: Array
    """Estimated missing torque of the base: filtered tau minus before."""
    band: Array
    """Half width of its 95 % band."""
    intervals: tuple[tuple[float, float], ...] = ()
    """Time spans where the missing torque is louder than the noise for long."""
    extras: dict[str, Array] = field(default_factory=dict)
    """User columns, one value a row: temperature, load, ..."""


@dataclass(frozen=True, kw_only=True)
class Region:
    """Mean missing torque over one coordinate: centres, mean, half 95 % band, samples; NaN where never visited."""

    axis: str
    unit: str
    centres: Array
    mean: Array
    band: Array
    count: Array
    measure: str = "mean missing"
    """What `mean` is of the missing torque: its mean, the mean of what resists the motion, or its RMS."""


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """The whole answer."""

    verdict: tuple[str, ...]
    """() nothing missing; ("unknown",); or ids of effects, largest first."""
    findings: tuple[Finding, ...]
    """All effects that were looked for, ranked."""
    heldout: HeldOut
    traces: tuple[Trace, ...]
    regions: tuple[Region, ...]
    """Before any effect is added: missing torque over position, speed, direction, ..."""
    regions_after: tuple[Region, ...]
    mount: str
    motion: Literal["rotary", "linear"]
    ambiguous_with: tuple[tuple[str, ...], ...] = ()
    next_experiment: dict[str, Any] = field(default_factory=dict)
    depends_on: tuple[str, ...] = ()
    data_quality: tuple[str, ...] = ()
    friction_law: dict[str, Any] = field(default_factory=dict)
    loop_bias: dict[str, Any] = field(default_factory=dict)
    """Whether the loop biased the fit: {"biased", "p_value", "moved": {parameter: relative move}}; {} if untested."""
    base_parameters: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Per base parameter: as delivered, refitted, with the missing physics."""
    provenance: dict[str, Any] = field(default_factory=dict)
    """version, command, date, recordings [{name, sha256, role, seconds, rate_hz}], card {name, sha256}."""
    improved: dict[str, Any] = field(default_factory=dict)
    """File names, and the range they are proven in: {"card", "fmu", "speed": [lo, hi], "position": [lo, hi]}."""
    seconds: float = 0.0
