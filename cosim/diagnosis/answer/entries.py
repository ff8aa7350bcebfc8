"""Entries of diagnosis.json that are objects, and what each of them holds; an empty one says that it was not asked."""

from typing import TypedDict

from cosim.support.plain import JsonObject
from pyfmi_models.effects.learned_table import LearnedTable


class LawProposal(TypedDict, total=False):
    """The friction law that would serve better as the base, and the share of the energy left that it would remove."""

    base: str
    proposed: str
    gain: float
    curve: float
    """Share of that energy which a free curve over speed would remove."""


class BiasEntry(TypedDict, total=False):
    """Whether the control loop biased the fit: p value of "no bias", and relative moves of parameters."""

    biased: bool
    p_value: float
    moved: dict[str, float]


class BinsEntry(TypedDict, total=False):
    """What training recordings leave without a term: mean and 95 % band of bins, (at,) or (at, by_at); None: empty."""

    at: list[float]
    by_at: list[float]
    value: list[float | None] | list[list[float | None]]
    band: list[float | None] | list[list[float | None]]


class TableEntry(LearnedTable, total=False):
    """A learned term, and what the training recordings say beside it."""

    data: BinsEntry


class NumberEntry(TypedDict):
    """A number of a formula, its 95 % range and unit."""

    value: float
    interval: list[float]
    unit: str


class FormulaEntry(TypedDict, total=False):
    """A closed form that is as good on unseen recordings as table number `table`."""

    table: int
    kind: str
    over: list[str]
    equation: str
    parameters: dict[str, NumberEntry]


class LearnedEntry(TypedDict, total=False):
    """The term learned for what has no name, and the held-out error before and after it [N m or N]."""

    quantities: list[str]
    size: float
    table: list[TableEntry]
    formula: list[FormulaEntry]
    before: float
    after: float
    interval: list[float]
    cutoff_hz: float
    range: list[str]
    evidence: list[float]
    predicted: list[float]
    statement: str


class NotLearnedEntry(TypedDict, total=False):
    """The term that was tried for what has no name and that the held-out recordings do not prove, with its errors."""

    quantities: list[str]
    before: float
    after: float
    cutoff_hz: float
    statement: str


class BroadbandEntry(TypedDict, total=False):
    """A random disturbance at any motion: RMS [N m, N], relative to the friction, its band, how likely it is there."""

    level: float
    relative: float
    low_hz: float
    high_hz: float
    probability: float
    statement: str


class NextExperiment(TypedDict, total=False):
    """The recording that would tell most: which effects it separates, by how much torque [N m], and how to take it."""

    separates: list[str]
    expected_difference: float
    description: str
    set_point: JsonObject
    scenario: str
    command: str


class Source(TypedDict, total=False):
    """A recording that a diagnosis read; `role` is "train" or "heldout"."""

    name: str
    sha256: str
    role: str
    seconds: float
    rate_hz: float


class CardSource(TypedDict, total=False):
    """The card that a diagnosis started from; no hash where it was no file, no kind of machine where it says none."""

    name: str
    path: str
    sha256: str
    machine: str


class Provenance(TypedDict, total=False):
    """Where a diagnosis comes from; `base_fmu` names the FMU in whose place the card stands."""

    version: str
    command: str
    date: str
    seed: int
    recordings: list[Source]
    card: CardSource
    base_fmu: str


class Improved(TypedDict, total=False):
    """Files of the improved model, and the ranges [rad/s, rad; m/s, m] in which it is proven."""

    card: str
    fmu: str
    fmu_fmi2: str
    correction: str
    base_fmu: str
    ssp: str
    no_ssp: str
    not_in_correction: list[str]
    speed: list[float]
    position: list[float]
