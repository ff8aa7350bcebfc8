"""Files of a calibration: identified.json, identified.ssv, report.html, the FMU with the numbers that were found."""

import json
from collections.abc import Callable, Sequence
from math import isfinite, sqrt
from pathlib import Path

import numpy as np

from cosim.data.recording import Recording
from cosim.support.files import check_free, directory, replacing, sha256
from cosim.support.plain import JsonObject
from cosim.support.version import __version__
from cosim_calibration.calibrate import Calibrated, Trace
from cosim_calibration.changed_fmu import write_with_starts
from cosim_calibration.page import write_page
from cosim_calibration.parameter_set import write_set

JSON, SET, PAGE = "identified.json", "identified.ssv", "report.html"


def files_of(source: Path, alone: bool) -> tuple[str, ...]:
    """Names of the files that a calibration of this FMU or system writes."""
    return (JSON, SET, PAGE, *((f"{source.stem}_identified.fmu",) if alone else ()))


def check_out(out: Path, source: Path, alone: bool, force: bool) -> None:
    """Refuse, before any work is done, a folder that holds such files already (raises OutputError)."""
    for name in files_of(source, alone):
        check_free(out / name, force)


def deliver(
    done: Calibrated,
    recordings: Sequence[Recording],
    out: Path,
    force: bool,
    complete: Callable[[Path], None] = lambda path: None,
) -> dict[str, Path]:
    """Write all files into `out`, the JSON last; return them by kind. `complete` puts into the FMU what it carries."""
    directory(out)
    found = {"parameter_set": out / SET, "report": out / PAGE, "json": out / JSON}
    write_set(done, out / SET, force)
    if done.subject.alone:
        found["fmu"] = out / files_of(done.subject.source, True)[-1]
        write_with_starts(done.subject, done.values, found["fmu"], force)
        complete(found["fmu"])
    write_page(done, out / PAGE, force)
    with replacing(out / JSON, force) as partial:
        content = as_json(done) | {
            "recordings": [{"name": one.name, "sha256": one.sha256} for one in recordings],
            "files": {kind: path.name for kind, path in found.items()},
        }
        partial.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", "utf-8")
    return found


def as_json(done: Calibrated) -> JsonObject:
    """Return the result as plain data; what is not determined has null as its standard error."""
    uncertainty, names = done.uncertainty, [one.name for one in done.free]
    source = done.subject.source
    return {
        "source": {"name": source.name, "sha256": sha256(source) if source.is_file() else ""},
        "numbers": {
            one.name: {
                "value": done.values[one.name],
                "unit": one.unit,
                "standard_error": error if isfinite(error) else None,
                "start": one.start,
                "low": one.low if isfinite(one.low) else None,
                "high": one.high if isfinite(one.high) else None,
                "at_bound": at_bound(done, one.name),
            }
            for one, error in zip(done.free, uncertainty.standard_errors, strict=True)
        },
        "initial_values": dict(done.initial),
        "standard_errors": {
            name: error if isfinite(error) else None
            for name, error in zip(names, uncertainty.standard_errors, strict=True)
        },
        "correlations": {
            name: dict(zip(names, np.round(row, 6).tolist(), strict=True))
            for name, row in zip(names, uncertainty.correlation, strict=True)
        },
        "not_determined": [{"parts": one.parts, "statement": one.statement} for one in uncertainty.not_determined],
        "effective_samples": uncertainty.samples,
        "outputs": [_of_trace(one) for one in done.traces if not one.held_out],
        "heldout": heldout_of(done.traces),
        "starts": list(done.fit.starts),
        "starts_that_agree": done.fit.agreeing,
        "loss": done.fit.loss,
        "evaluations": done.evaluations,
        "lost_points": {"number": len(done.lost), "reasons": sorted(set(done.lost))[:5]},
        "notes": list(done.notes),
        "version": __version__,
    }


def at_bound(done: Calibrated, name: str) -> bool:
    """Whether a number ended at a bound."""
    (one,) = (one for one in done.free if one.name == name)
    near = 1e-6 * max(abs(done.values[name]), one.scale)
    return min(done.values[name] - one.low, one.high - done.values[name]) <= near


def heldout_of(traces: Sequence[Trace]) -> JsonObject | None:
    """RMS errors on the recordings kept out, before and after, by output; None where there are none."""
    kept = [one for one in traces if one.held_out]
    if not kept:
        return None
    found: JsonObject = {}
    for name in dict.fromkeys(one.output for one in kept):
        mine = [one for one in kept if one.output == name]
        before, after = (_rms([one.rms(getattr(one, side)) for one in mine], mine) for side in ("before", "after"))
        found[name] = {"before_rms": before, "after_rms": after, "unit": mine[0].unit}
    return found


def _rms(values: Sequence[float], traces: Sequence[Trace]) -> float:
    """RMS over several recordings, each counted by its rows."""
    counts = [int(np.isfinite(one.measured).sum()) for one in traces]
    return sqrt(sum(n * value**2 for n, value in zip(counts, values, strict=True)) / sum(counts))


def _of_trace(one: Trace) -> JsonObject:
    return {
        "recording": one.recording,
        "output": one.output,
        "unit": one.unit,
        "before_rms": one.rms(one.before),
        "after_rms": one.rms(one.after),
    }
