"""Calibration of a foreign FMU, or of a whole system: numbers found from recordings by output error in open loop.

names -> free        checked against the model (`free`)
recordings -> experiments    matched, converted, laid on ticks (`experiment`)
points -> outputs    in processes of their own (`processes`, `simulation`)
fit -> uncertainty   least squares over several starts (`fit`), and what it is worth (`uncertainty`)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from cosim.data.recording import Recording
from cosim.support.errors import InputError
from cosim_calibration.experiment import Array, Experiment, Matching, experiment_of, matching, record_of
from cosim_calibration.fit import LOSSES, Fit, Loss, fit
from cosim_calibration.free import Free, free_of
from cosim_calibration.initial import INITIALS, from_first_row, states_of, with_free_starts
from cosim_calibration.processes import TIMEOUT, Processes
from cosim_calibration.residuals import Residuals, Rows
from cosim_calibration.simulation import Job, Outputs, Point
from cosim_calibration.store import Store
from cosim_calibration.subject import Subject, unknown
from cosim_calibration.uncertainty import Uncertainty, uncertainty_of
from cosim_calibration.windows import windows_of

INTERPOLATIONS = ("hold", "linear")
DERIVATIVES = ("differences", "directional")
OF_WINDOWS = (
    "Each window starts from single readings: their noise is not in the standard errors, and moves the numbers."
)


@dataclass(frozen=True)
class Options:
    """How a calibration is done.

    Args:
        free: names of the numbers that may change.
        given: values of other numbers, or starts of free ones, by name.
        bounds: least and greatest value by name, where the model's min and max are not meant.
        columns: variable to column, where names differ.
        step: of the simulation [s]; None is that of the rows.
        interpolation: of inputs between rows: "hold" or "linear".
        window: seconds after which a simulation starts anew from the recording; None simulates each as a whole.
        initial: "recorded" starts a window from the readings there; "free" finds the start values of each window, or
            of each recording where there are no windows, like the other numbers.
        starts: starts of the fit, of which two that agree are enough.
        seed: of the random starts.
        loss: "linear", or "soft_l1" for recordings with outliers.
        workers: processes; None is one a core.
        timeout: seconds that the first simulation may take.
        cluster: address of a Dask scheduler whose workers simulate; "" for processes of this machine.
        derivatives: "differences", or "directional" for those that the FMU gives, where they agree with differences.
    """

    free: tuple[str, ...]
    given: Point = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    step: float | None = None
    interpolation: str = "hold"
    window: float | None = None
    initial: str = "recorded"
    starts: int = 4
    seed: int = 0
    loss: Loss = "linear"
    workers: int | None = None
    timeout: float = TIMEOUT
    cluster: str = ""
    derivatives: str = "differences"


@dataclass(frozen=True)
class Trace:
    """One output of one recording: what was measured, and what the model gives before and after."""

    recording: str
    output: str
    unit: str
    times: Array
    measured: Array
    before: Array
    after: Array
    held_out: bool

    def rms(self, simulated: Array) -> float:
        """RMS of simulated minus measured, in the output's unit."""
        rest = (simulated - self.measured)[np.isfinite(self.measured)]
        return float(np.sqrt(np.mean(rest**2)))


@dataclass(frozen=True)
class Calibrated:
    """What a calibration found: numbers, how well they are known, and how well the model follows the recordings."""

    subject: Subject
    free: tuple[Free, ...]
    values: Mapping[str, float]
    uncertainty: Uncertainty
    traces: tuple[Trace, ...]
    fit: Fit
    evaluations: int
    lost: tuple[str, ...]
    notes: tuple[str, ...]
    initial: Mapping[str, float] = field(default_factory=dict)
    """Start values that were free, by name."""
    shown: Experiment | None = None
    """The first recording kept out, else the last one fitted, as it was simulated to judge the numbers."""
    shown_with: Mapping[str, float] = field(default_factory=dict)
    """What it is simulated with beside the numbers: other values that were given, and start values, by variable."""


def calibrate(
    subject: Subject,
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    options: Options,
    say: Callable[[str], None] = lambda text: None,
    store: Store | None = None,
) -> Calibrated:
    """Find the numbers of a model with which it follows recordings, and judge them on recordings kept out.

    What `store` has is not simulated again.

    Raises:
        InputError: a name, a column, a unit or an option does not fit; or the model cannot be simulated at its start.
    """
    _check(options, subject)
    _check_recordings(train, heldout, options.columns)
    _check_set(subject, options)
    free = free_of(subject, options.free, options.given, options.bounds)
    matched = _matched(subject, (*train, *heldout), options)
    laid = [
        experiment_of(subject, one, match, options.step, options.interpolation)
        for one, match in zip((*train, *heldout), matched, strict=True)
    ]
    whole, fitted, own = _experiments(subject, laid, len(train), options)
    numbers = (*free, *own)
    noted = () if options.window is None or own else (OF_WINDOWS,)
    start = np.array([one.start / one.scale for one in numbers])
    before = {one.name: one.start for one in numbers}
    notes = (*dict.fromkeys(note for match in matched for note in match.notes), *noted)
    again = options.window is not None  # else what is fitted stands first in `whole`
    job = Job(subject, (*whole, *fitted) if again else whole, options.given)
    all_, part = slice(0, len(whole)), slice(len(whole), None) if again else slice(0, len(train))
    with Processes(job, options.workers, options.timeout, options.cluster, store) as processes:
        say("first simulation")
        old = processes.first(before, all_)
        _check_numbers(subject, whole, old)
        rows = Rows.of(fitted)
        _check_rows(rows, len(numbers))
        residuals = Residuals(processes, numbers, rows, 1 / rows.spread, part)
        if not again:
            residuals.know(start, old[: len(train)])
        found = fit(
            residuals, start, options.starts, options.seed, options.loss, say, options.derivatives == "directional"
        )
        values = residuals.point(found.x)
        notes += (*residuals.notes, *_on_roughness(residuals.rough))
        new = _afterwards(processes, values, all_, None if again else residuals.outputs(found.x))
        evaluations, lost = processes.evaluations, tuple(processes.reasons)
    if new is None:
        text = f"{subject.source} cannot be simulated on all recordings with the numbers that were found"
        raise InputError(f"{text}: {lost[-1]}", culprit="heldout")
    uncertainty, remarks = uncertainty_of(found, numbers, residuals.scales, rows).of_shared(numbers)
    values = {**values, **{name: before[name] for one in uncertainty.not_determined if one.idle for name in one.parts}}
    traces = _traces(subject, whole, len(train), old, new)
    initial = {one.name: values.pop(one.name) for one in own}
    shown = whole[len(train)] if heldout else whole[-1]
    last = (initial, shown, _other_values(shown, options.given, values, initial))
    return Calibrated(subject, free, values, uncertainty, traces, found, evaluations, lost, (*notes, *remarks), *last)


def _other_values(shown: Experiment, given: Point, values: Point, initial: Point) -> dict[str, float]:
    """What an experiment is simulated with beside the numbers that were found."""
    others = {name: value for name, value in given.items() if name not in values}
    return {**others, **(shown.starts or {}), **{variable: initial[number] for variable, number in shown.own.items()}}


def _check_columns(columns: Mapping[str, str], recordings: Sequence[Recording]) -> None:
    """Refuse the name of a column that no recording has; each may call its columns in its own way (InputError)."""
    left_out = " ".join(note for one in recordings for note in one.notes)
    for name, column in columns.items():
        known = name == "t" or f'column "{column}" was left out' in left_out  # which has its own sentence
        if not known and not any(column in one for one in recordings):
            have = tuple(dict.fromkeys(each for one in recordings for each in one.columns if each != "t"))
            text = f'--columns {name}={column}: no recording has a column "{column}"; they have: {", ".join(have)}.'
            raise InputError(text, culprit=column, value=column, choices=have)


def _afterwards(processes: Processes, values: Point, all_: slice, fitted: Outputs | None) -> Outputs | None:
    """Outputs with the numbers that were found; those of recordings that were fitted may be known."""
    known = fitted or []
    if len(known) == all_.stop:
        return known
    (rest,) = processes.at([values], slice(len(known), all_.stop))
    return None if rest is None else [*known, *rest]


def _check_set(subject: Subject, options: Options) -> None:
    """Refuse other values that are no numbers, or of nothing that the model has (InputError)."""
    for name, value in options.given.items():
        if not isfinite(value):
            raise InputError(f"--set {name}={value:g}: it must be a finite number.", culprit=name, value=value)
        if name not in subject.known:
            raise unknown("--set", name, subject.source, subject.known, "what can be set")


def _matched(subject: Subject, recordings: Sequence[Recording], options: Options) -> list[Matching]:
    """Match columns; refuse another value of an input that a column feeds, where it would do nothing (InputError)."""
    matched = [matching(subject, one, options.columns) for one in recordings]
    for one, match in zip(recordings, matched, strict=True):
        for name in options.given.keys() & match.inputs.keys():
            column = match.inputs[name]
            text = f'--set {name}: the column "{column}" of {one.name} feeds it, so another value would do nothing.'
            raise InputError(text, culprit=name)
    return matched


def _experiments(
    subject: Subject, laid: Sequence[Experiment], trained: int, options: Options
) -> tuple[tuple[Experiment, ...], list[Experiment], tuple[Free, ...]]:
    """Recordings as a whole, what is fitted, and the start values that are free."""
    whole, fitted, free = list(laid), list(laid[:trained]), options.free
    if options.window is not None:
        fitted = [part for one in fitted for part in windows_of(subject, one, options.window, free)]
    if options.initial != "free":
        return tuple(whole), fitted, ()
    if options.window is None:
        whole = [from_first_row(one, states_of(subject, one, free, "--initial free")) for one in laid]
        fitted = whole[:trained]
    fitted, own = with_free_starts(subject, fitted, free)
    if options.window is None:
        whole[:trained] = fitted
    return tuple(whole), fitted, own


def _check(options: Options, subject: Subject) -> None:
    for name, value, choices in (
        ("--loss", options.loss, LOSSES),
        ("--interpolation", options.interpolation, INTERPOLATIONS),
        ("--initial", options.initial, INITIALS),
        ("--derivatives", options.derivatives, DERIVATIVES),
    ):
        if value not in choices:
            text = f'{name} "{value}": there are: {", ".join(choices)}.'
            raise InputError(text, culprit=name, value=value, choices=choices)
    for name, number in (("--step", options.step), ("--window", options.window), ("--timeout", options.timeout)):
        if number is not None and not 0 < number < float("inf"):
            raise InputError(f"{name} {number:g}: it must be above 0.", culprit=name, value=number)
    if options.derivatives == "directional" and not subject.alone:
        text = f"--derivatives directional is of one FMU, and {subject.source} is a system; leave it out."
        raise InputError(text, culprit="--derivatives", value=options.derivatives)


def _check_recordings(train: Sequence[Recording], heldout: Sequence[Recording], columns: Mapping[str, str]) -> None:
    _check_kept_out(train, heldout)
    _check_columns(columns, (*train, *heldout))


def _check_kept_out(train: Sequence[Recording], heldout: Sequence[Recording]) -> None:
    """Refuse a recording that is fitted and kept out."""
    fitted = {one.sha256 for one in train}
    for one in heldout:
        if one.sha256 in fitted:
            text = f"{one.name} is fitted and kept out; a recording that is kept out must be another one."
            raise InputError(text, culprit="heldout", value=one.name)


def _on_roughness(names: Sequence[str]) -> tuple[str, ...]:
    """A note on numbers for which differences over no two steps agreed; none where there are none."""
    if not names:
        return ()
    said = "what was recorded does not change smoothly (an output jumps, or events fall on steps of the model)"
    return (f"With {', '.join(names)} {said}: standard errors may be too small there.",)


def _check_numbers(subject: Subject, experiments: Sequence[Experiment], outputs: Outputs) -> None:
    for experiment, columns in zip(experiments, outputs, strict=True):
        for name, values in zip(experiment.outputs, columns, strict=True):
            bad = np.flatnonzero(~np.isfinite(values))
            if len(bad):
                at = float(experiment.times[bad[0]])
                text = f"{subject.source} gives no number for {name} at {at:g} s with the numbers it starts from."
                raise InputError(text, culprit=name)


def _check_rows(rows: Rows, count: int) -> None:
    if len(rows.measured) <= count:
        text = f"{len(rows.measured)} measured numbers cannot determine {count}; more rows are needed."
        raise InputError(text, culprit="recordings")


def _traces(
    subject: Subject, experiments: Sequence[Experiment], trained: int, old: Outputs, new: Outputs
) -> tuple[Trace, ...]:
    found = []
    for k, (one, before, after) in enumerate(zip(experiments, old, new, strict=True)):
        for (name, measured), a, b in zip(one.outputs.items(), before, after, strict=True):
            port = subject.ports.get(name) or subject.ports.get(record_of(subject, name))
            unit = port.unit if port else ""
            found.append(Trace(one.name, name, unit, one.times, measured, a, b, k >= trained))
    return tuple(found)
