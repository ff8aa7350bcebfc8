"""The report of a calibration: a page with the numbers, what is not determined, and the overlay of all outputs."""

from collections.abc import Sequence
from math import isfinite
from pathlib import Path

import numpy as np

from cosim.plots.compare import Overlay, write_explorer
from cosim.plots.quantities import number
from cosim_calibration.calibrate import Calibrated, Trace

LINES = ("measured", "before", "after")
CLOSE, MOST = 0.5, 12
"""Correlation of two numbers from which on it is listed: the error of one is then a seventh larger than if the other
were known, 1 / sqrt(1 - r^2); pairs listed at most."""


def write_page(done: Calibrated, path: Path, force: bool) -> Path:
    """Write the page; self-contained, no network (OutputError where it exists and `force` is not set)."""
    shown = {
        "name": done.subject.source.name,
        "lead": _lead(done),
        "notes": done.notes,
        "numbers": number_rows(done),
        "correlations": correlation_rows(done),
        "undetermined": [one.statement for one in done.uncertainty.not_determined],
        "errors": [_error_row(one) for one in done.traces],
    }
    return write_explorer("cosim_calibration", "page.html.j2", LINES, _overlays(done.traces), shown, path, force)


def number_rows(done: Calibrated) -> list[dict[str, str]]:
    """Each number with its standard error, start and bounds, as text."""
    rows = []
    for one, error in zip(done.free, done.uncertainty.standard_errors, strict=True):
        value = done.values[one.name]
        rows.append(
            {
                "name": one.name,
                "unit": one.unit or "1",
                "value": _text(value, error),
                "error": number(error, 2) if isfinite(error) else "not determined",
                "start": number(one.start, 4),
            }
        )
    return rows


def correlation_rows(done: Calibrated) -> list[dict[str, str]]:
    """Pairs of numbers that are determined and whose errors hang together, the closest first: |r| >= `CLOSE`."""
    names, found = [one.name for one in done.free], done.uncertainty
    known = [k for k in range(len(names)) if isfinite(found.standard_errors[k])]
    pairs = [(float(found.correlation[i][k]), names[k], names[i]) for i in known for k in known if k < i]
    close = sorted((one for one in pairs if abs(one[0]) >= CLOSE), key=lambda one: -abs(one[0]))
    return [{"one": one, "other": other, "value": f"{r:.3f}".replace("-", "−")} for r, one, other in close[:MOST]]


def _text(value: float, error: float) -> str:
    """A value with as many digits as its standard error says, two more than are sure at most."""
    if not isfinite(error) or error <= 0 or value == 0:
        return number(value, 4)
    return number(value, int(np.clip(np.ceil(np.log10(abs(value) / error)) + 2, 2, 7)))


def _lead(done: Calibrated) -> str:
    runs = len({one.recording for one in done.traces if not one.held_out})
    agree, count = done.fit.agreeing, len(done.fit.starts)
    said = f"{len(done.free)} numbers from {runs} recording{'s' * (runs > 1)}, {done.evaluations:,} simulations."
    return f"{said} {agree} of {count} starts of the fit ended at the same minimum."


def _error_row(one: Trace) -> dict[str, str]:
    return {
        "recording": f"{one.recording} (kept out of the fit)" if one.held_out else one.recording,
        "output": one.output,
        "unit": one.unit or "1",
        "before": number(one.rms(one.before), 3),
        "after": number(one.rms(one.after), 3),
    }


def _overlays(traces: Sequence[Trace]) -> dict[str, Overlay]:
    """The outputs of each recording over each other."""
    found: dict[str, Overlay] = {}
    for one in traces:
        before = f"{one.recording} (kept out): " if one.held_out else f"{one.recording}: "
        columns = {**(found[before].columns if before in found else {})}
        units = {**(found[before].units if before in found else {}), one.output: one.unit}
        columns[one.output] = np.stack([one.measured, one.before, one.after])
        found[before] = Overlay(LINES, one.times, columns, units, as_stated=True)
    return found
