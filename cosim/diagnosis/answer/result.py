"""What a diagnosis finds: plain data, the same for the JSON file, the terminal and the report.

Torques are in N m (forces in N for a linear axis), times in s, positions in rad (m). Residuals follow the protocol of
`protocol.py`; "before" is the base with its parameters refitted, "after" the base with the missing physics.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.answer.entries import (
    BiasEntry,
    BroadbandEntry,
    Improved,
    LawProposal,
    LearnedEntry,
    NextExperiment,
    NotLearnedEntry,
    Provenance,
)
from cosim.diagnosis.answer.ledger import Trial
from cosim.diagnosis.answer.scores import Scores
from cosim.estimation.determined import NotDetermined
from pyfmi_models.effects import CATALOGUE, Effect

Array = npt.NDArray[np.float64]
Answer = Literal["found", "ambiguous", "not_proven", "not_decided", "not_seen", "not_testable"]
POLICY_VERSION = "9"
"""Of the constants by which is decided; it is raised when one of them changes."""
POLICY = f"evidence {POLICY_VERSION}"
"""Name and version of the constants by which is decided."""


def is_special(effect: str, rivals: Sequence[str]) -> bool:
    """Whether an effect is a special case of all its rivals: then it goes into a model, whichever is the cause."""
    return all(set(rivals) <= set(form.special_case_of) for form in CATALOGUE.get(effect, (Effect,)))


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where an effect acts: an axis ("position", "speed", "direction", "time", "everywhere", ...) and its regions."""

    axis: str
    description: str
    regions: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Bound:
    """How large an effect may be that was not seen: concealed in these recordings at `value`, it is found."""

    value: float | None
    """Of the main number, in `unit`; None where no size is found."""
    unit: str
    band_hz: tuple[float, float]
    range: dict[str, tuple[float, float]]
    """What the bound holds for: cycles, frequencies, positions, speeds."""
    power: float | None = None
    """Share of the concealed effects that were found at it, in all phases and signs."""
    reason: str = ""
    """Why there is no value, or what cannot be tested beside it."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One effect that was looked for, and the answer."""

    effect: str
    source: str = ""
    """Of a coupling the neighbour."""
    alone: bool = False
    """Whether no other of its id is in question: then its id is its name."""
    title: str
    answer: Answer
    probability: float
    gain: float
    """Share of the cross-validated residual energy that this effect removes (0..1), on training data."""
    parameters: dict[str, float] = field(default_factory=dict)
    harmonics: tuple[dict[str, float], ...] = ()
    """Parameters of the further waves of a ripple."""
    standard_errors: dict[str, float] = field(default_factory=dict)
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    """95 % ranges of the parameters: 1.96 standard errors either way, robust to blocks (sandwich estimate)."""
    units: dict[str, str] = field(default_factory=dict)
    size: str = ""
    """Main number with unit, for example "0.42 N·m"; `size_range` its 95 % range, "0.39 to 0.45"."""
    size_range: str = ""
    statement: str = ""
    where: Where | None = None
    ruled_out: tuple[str, ...] = ()
    """Rivals that are far behind, in evidence and in the error that they remove ..."""
    less_likely: tuple[str, ...] = ()
    """... and those that the evidence is against, but that remove nearly as much."""
    told_apart_by: str = ""
    rival: str = ""
    """Of an effect that is not decided: the one that stands in its place."""
    action: str = ""
    evidence: str = ""
    visible_from: float | None = None
    """Smallest size of the main parameter that these recordings would have shown (unit as in `size`)."""
    bound: Bound | None = None
    """Of an effect that was not seen or cannot be tested."""

    @property
    def name(self) -> str:
        """What the ledger calls it: its id, and its source where it has one."""
        return f"{self.effect}:{self.source}" if self.source and not self.alone else self.effect


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """RMS of the torque residual on one recording that was not fitted."""

    name: str
    nominal_rms: float
    before_rms: float
    after_rms: float
    floor_rms: float
    confidence_interval: tuple[float, float]
    """95 % range of before_rms - after_rms from a block bootstrap, as wide as the choice of effects there asks."""
    sliding: dict[str, float] = field(default_factory=dict)
    """The same RMS values over samples in clear motion only, with the cutoff and the least speed used."""
    cutoff_hz: float = 30.0
    motion_hz: float = 30.0
    """Cutoff of the low-pass in front of these RMS values [Hz]."""
    unvetoed_rms: float | None = None
    """RMS with all effects that training alone proposed, before this recording's veto."""
    possible_rms: float | None = None
    """RMS with the effects that are only possible too, where there are some that stand; they are not delivered."""
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
class Part:
    """A part of the held-out recordings: RMS error before and after, and what may be said about the change."""

    label: str
    """Name of a recording, "standing", "forward", "backward" or "speed"."""
    before: float
    after: float
    change: Literal["better", "no clear change", "worse"]
    """From a bootstrap over seconds."""
    speeds: tuple[float, float] | None = None
    """Least and largest speed of a class of speeds [rad/s or m/s]."""


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
    parts: tuple[Part, ...]
    """The held-out proof: every recording, then standing, classes of speed and directions over all of them."""
    regions: tuple[Region, ...]
    """Before any effect is added: missing torque over position, speed, direction, ..."""
    regions_after: tuple[Region, ...]
    mount: str
    motion: Literal["rotary", "linear"]
    delivered: tuple[str, ...] = ()
    """Names of the effects that the delivered card holds beside its base."""
    ambiguous_with: tuple[tuple[str, ...], ...] = ()
    next_experiment: NextExperiment = field(default_factory=NextExperiment)
    depends_on: tuple[str, ...] = ()
    learned: LearnedEntry = field(default_factory=LearnedEntry)
    """The term that was learned for what has no name; {} where there is none or it is not proven."""
    not_learned: NotLearnedEntry = field(default_factory=NotLearnedEntry)
    """Where the verdict holds "unknown" and nothing was learned: what was tried, and why it is not in the model."""
    broadband: BroadbandEntry = field(default_factory=BroadbandEntry)
    """What shakes the machine all the time; {} where nothing does."""
    data_quality: tuple[str, ...] = ()
    sanity: tuple[Sanity, ...] = ()
    """Doubts about the recordings themselves, gravest first."""
    global_test: dict[str, float] = field(default_factory=dict)
    """Is anything missing at all: {"statistic", "threshold", "p"}; {} where it was not asked."""
    policy: str = POLICY
    not_determined: tuple[NotDetermined, ...] = ()
    """Numbers of the delivered base that the recordings do not determine."""
    friction_law: LawProposal = field(default_factory=LawProposal)
    loop_bias: BiasEntry = field(default_factory=BiasEntry)
    base_parameters: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Per base parameter: as delivered, refitted, with the missing physics."""
    ledger: tuple[Trial, ...] = ()
    """Every structure that was fitted, with the rules by which it was judged."""
    scores: Scores | None = None
    """What was decided from; None where nothing is named, as the recordings are in doubt."""
    provenance: Provenance = field(default_factory=Provenance)
    improved: Improved = field(default_factory=Improved)
    files: tuple[str, ...] = ("report.html",)
    """Files for the reader that are written beside those in `improved`."""
    seconds: float = 0.0

    @property
    def in_model(self) -> tuple[Finding, ...]:
        """Effects that the delivered model holds: those detected, the likelier of sets, or what was asked for."""
        return tuple(one for one in self.findings if one.name in self.delivered)

    @property
    def adds_physics(self) -> bool:
        """Whether the delivered model holds more than the refitted base."""
        return bool(self.in_model or self.learned)
