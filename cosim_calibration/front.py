"""`cosim.identify` of a foreign FMU or of a system: recordings to numbers, and the FMU with these."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from hashlib import sha256
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.api.identify import ForModels
from cosim.api.recordings import Source, read
from cosim.data.recording import Recording
from cosim.models.cache import with_fmus
from cosim.plots.quantities import number
from cosim.support.files import sha256 as sha256_of
from cosim.support.html import table as html_table
from cosim.support.plain import JsonObject
from cosim.support.version import __version__
from cosim.system.portable_job import files_of
from cosim.system.scenario import Scenario, read_scenario
from cosim_calibration import deliver
from cosim_calibration.calibrate import Calibrated, Options
from cosim_calibration.calibrate import calibrate as find
from cosim_calibration.page import number_rows
from cosim_calibration.store import stored
from cosim_calibration.subject import Subject, of_fmu, of_system

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class CalibrateResult:
    """What was identified of an FMU or a system: numbers with standard errors, and how well outputs are followed."""

    calibrated: Calibrated
    files: Mapping[str, Path] = field(default_factory=dict)
    """What was written, by kind: json, report, parameter_set, fmu."""

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers by name, in the model's units."""
        return dict(self.calibrated.values)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors by name; inf where a number is not determined."""
        names = [one.name for one in self.calibrated.free]
        return dict(zip(names, self.calibrated.uncertainty.standard_errors, strict=True))

    @property
    def not_determined(self) -> tuple[str, ...]:
        """Sentences on what the recordings do not determine."""
        return tuple(one.statement for one in self.calibrated.uncertainty.not_determined)

    def frame(self) -> "pd.DataFrame":
        """Return a data frame: a row a number, its start, value and standard error (inf: not determined)."""
        import pandas as pd

        free = self.calibrated.free
        rows = {one.name: (one.start, self.numbers[one.name], self.standard_errors[one.name]) for one in free}
        return pd.DataFrame.from_dict(rows, orient="index", columns=["start", "value", "standard_error"])

    def as_json(self) -> JsonObject:
        """Return everything but the columns as plain data, as identified.json holds it."""
        return deliver.as_json(self.calibrated)

    def __str__(self) -> str:
        return "\n".join(_lines(self.calibrated))

    def __repr__(self) -> str:
        return f"CalibrateResult({', '.join(f'{name}={value:.6g}' for name, value in self.numbers.items())})"

    def _repr_html_(self) -> str:
        return html_table("Numbers", number_rows(self.calibrated))


def identify(
    recordings: Source | Sequence[Source],
    model: ForModels,
    how: Mapping[str, Any],
    out: Path | None,
    *,
    units: Mapping[str, str] | None = None,
    force: bool = False,
    on_progress: Callable[[str], None] = lambda text: None,
) -> CalibrateResult:
    """Find numbers of an FMU or a system and write the files; see `cosim.identify`."""
    options = _options(model, Options(**how))
    subject = subject_of(model.get("fmu"), model.get("system"), on_progress)
    if out:
        deliver.check_out(out, subject.source, subject.alone, force)
    train, kept = _read(recordings, "recording", units), _read(model.get("heldout"), "heldout", units)
    if out is None:
        return CalibrateResult(find(subject, train, kept, options, on_progress))
    with stored(out, _identity(subject, (*train, *kept), options), force) as store:
        if store.found:
            on_progress(f"{store.found:,} simulations were done before")
        done = find(subject, train, kept, options, on_progress, store)
        from cosim_calibration.identified_fmu import carry  # what exports FMUs: without a folder nothing is written

        files = deliver.deliver(done, (*train, *kept), out, force, partial(carry, done, options.timeout, on_progress))
    return CalibrateResult(done, files)


def _options(model: ForModels, options: Options) -> Options:
    """Join what is said of a model with what is said of any."""
    return replace(
        options,
        given=model.get("set") or {},
        bounds=model.get("bounds") or {},
        step=model.get("step"),
        interpolation=model.get("interpolation", options.interpolation),
        window=model.get("window"),
        initial=model.get("initial", options.initial),
        loss=model.get("loss", options.loss),
        workers=model.get("workers"),
        timeout=model.get("timeout", options.timeout),
        cluster=model.get("cluster", options.cluster),
        derivatives=model.get("derivatives", options.derivatives),
    )


def _identity(subject: Subject, recordings: Sequence[Recording], options: Options) -> dict[str, str]:
    """What simulations depend on, by what it is called in a message."""
    components = {name: repr(one.model_dump()) for name, one in subject.scenario.components.items()}
    same = replace(options, workers=None, timeout=0, cluster="", starts=0, seed=0, loss="linear")
    units = [(one.sha256, sorted(one.units.items())) for one in recordings]
    texts = {"model": subject.scenario.text + repr(components), "options": repr(same), "recordings": repr(units)}
    hashes = {name: sha256(text.encode()).hexdigest() for name, text in texts.items()}
    files = {f"file of {name}": sha256_of(path) for name, path in files_of(subject.scenario).items()}
    return {"version": __version__} | hashes | files


def subject_of(
    fmu: str | Path | None, system: str | Path | Scenario | None, on_build: Callable[[str], None]
) -> Subject:
    """Read what is calibrated.

    Raises:
        FmuError, ScenarioError: it cannot be read.
    """
    if fmu is not None:
        return of_fmu(Path(fmu))
    scenario = system if isinstance(system, Scenario) else read_scenario(str(system))
    return of_system(with_fmus(scenario, on_build))


def _read(sources: Source | Sequence[Source] | None, kind: str, units: Mapping[str, str] | None) -> list[Recording]:
    if sources is None:
        return []
    several = sources if isinstance(sources, list | tuple) else [sources]
    return [read(one, units=units, name=f"{kind} {k}", required=()) for k, one in enumerate(several, 1)]


def _lines(done: Calibrated) -> list[str]:
    """The summary for a terminal."""
    lines = [f"{done.subject.source.name}: {done.evaluations:,} simulations"]
    for row in number_rows(done):
        error = f"± {row['error']}" if row["error"] != "not determined" else "± unknown"
        bound = "; at its bound" if deliver.at_bound(done, row["name"]) else ""
        unit = f" {row['unit']}" if row["unit"] != "1" else ""
        lines.append(f"  {row['name']} = {row['value']} {error}{unit} (was {row['start']}{bound})")
    lines += [one.statement for one in done.uncertainty.not_determined]
    lines += _pairs(done)
    for one in done.traces:
        kept = " (kept out)" if one.held_out else ""
        before, after = number(one.rms(one.before), 3), number(one.rms(one.after), 3)
        lines.append(f"  {one.recording}{kept}: {one.output} RMS error {before} -> {after} {one.unit}".rstrip())
    if done.lost:
        points = "1 point" if len(done.lost) == 1 else f"{len(done.lost):,} points"
        lines.append(f"{points} could not be simulated; the last time because: {done.lost[-1]}")
    return [*lines, *done.notes]


def _pairs(done: Calibrated) -> list[str]:
    """Pairs of numbers that are known together far better than alone."""
    found, names = done.uncertainty, [one.name for one in done.free]
    return [
        f"{names[i]} and {names[k]} are correlated ({found.correlation[i, k]:.3f}): only together are they well known."
        for i in range(len(names))
        for k in range(i)
        if abs(found.correlation[i, k]) > STRONG and all(isfinite(found.standard_errors[j]) for j in (i, k))
    ]


STRONG = 0.98
"""Correlation from which a pair is named: one of them alone is known five times worse than if the other were given."""
