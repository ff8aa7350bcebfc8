"""The report of a calibration: a page with the numbers, what is not determined, and the overlay of all outputs."""

from collections.abc import Sequence
from importlib.resources import files
from math import isfinite
from pathlib import Path

import numpy as np

from cosim.calibration.calibrate import Calibrated, Trace
from cosim.plots.compare import Overlay, payload
from cosim.plots.explorer import INKS, script_of_page
from cosim.plots.quantities import number
from cosim.support.files import replacing
from cosim.support.version import __version__

LINES = ("measured", "before", "after")


def write_page(done: Calibrated, path: Path, force: bool) -> Path:
    """Write the page; self-contained, no network (OutputError where it exists and `force` is not set)."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    loader = PackageLoader("cosim.calibration", "")
    pages = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    script, digest = script_of_page()
    folder = files("cosim.plots")
    css = "".join(folder.joinpath(name).read_text("utf-8") for name in ("run_page.css", "compare.css"))
    text = pages.get_template("page.html.j2").render(
        name=done.subject.source.name,
        lead=_lead(done),
        notes=done.notes,
        numbers=number_rows(done),
        undetermined=[one.statement for one in done.uncertainty.not_determined],
        errors=[_error_row(one) for one in done.traces],
        key=[(name, INKS[k % len(INKS)]) for k, name in enumerate(LINES)],
        data=payload(_overlays(done.traces)),
        script=Markup(script),
        script_hash=digest,
        css=Markup(css),
        made=f"Made by mount-cosim {__version__}.",
    )
    with replacing(path, force) as partial:
        partial.write_text(text, "utf-8")
    return path


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
        found[before] = Overlay(LINES, one.times, columns, units)
    return found
