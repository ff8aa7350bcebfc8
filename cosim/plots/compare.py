"""Recordings over each other: figure and page of a comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from cosim.plots.digest import in_words
from cosim.plots.explorer import INKS, Sheet, of_page, record, script_of_page
from cosim.plots.quantities import Scale, labelled, number, scale_of
from cosim.plots.style import AFTER, BEFORE, GREY, MEASURED, STYLE, Array
from cosim.support.files import replacing
from cosim.support.plain import JsonObject
from cosim.support.version import __version__

COLOURS = (MEASURED, BEFORE, AFTER, GREY)
PANEL = (9.0, 1.7)
"""Inches of one panel."""
DASHES = (7, 4)
"""Of what lies over the first, which would hide it where they agree [px]."""
AROUND = 0.02
"""Share of the time that is shown on each side of the largest difference."""


@dataclass(frozen=True)
class Difference:
    """How far a column of one recording is from that of the first."""

    column: str
    other: str
    unit: str
    rms: float
    relative: float
    """RMS of the difference relative to the standard deviation of the first; inf where that is constant."""
    largest: float
    at: float
    """Time of the largest difference [s]."""


@dataclass(frozen=True)
class Overlay:
    """Columns that all have, on the time stamps of the first: arrays of shape (recordings, rows)."""

    names: tuple[str, ...]
    t: Array
    columns: Mapping[str, Array]
    units: Mapping[str, str]
    as_stated: bool = False
    """Drawn in the units that are stated, as of somebody else's FMU, and not in those of this project's pages."""

    def scale(self, name: str, values: Array) -> Scale:
        """How values of a column are drawn."""
        unit = self.units.get(name, "")
        return Scale(1.0, unit) if self.as_stated else scale_of(unit, float(np.nanmax(np.abs(values), initial=0)))

    def differences(self) -> list[Difference]:
        """Each further recording against the first, column by column."""
        return [self._difference(name, k) for name in self.columns for k in range(1, len(self.names))]

    def _difference(self, name: str, k: int) -> Difference:
        first, gap = self.columns[name][0], self.columns[name][k] - self.columns[name][0]
        seen, named = np.isfinite(gap), (name, self.names[k], self.units.get(name, ""))
        if not seen.any():
            return Difference(*named, np.nan, np.nan, np.nan, np.nan)
        rms, spread = float(np.sqrt(np.mean(gap[seen] ** 2))), float(np.std(first[seen]))
        most = int(np.nanargmax(np.abs(gap)))
        relative = rms / spread if spread > 0 else float("inf") if rms else 0.0
        return Difference(*named, rms, relative, float(gap[most]), float(self.t[most]))


def figure_of(overlay: Overlay) -> Any:
    """Draw each column with its difference below as a matplotlib figure."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(rc=STYLE):
        count = len(overlay.columns)
        figure = Figure(figsize=(PANEL[0], 2 * PANEL[1] * count), layout="constrained")
        panels = figure.subplots(2 * count, 1, squeeze=False, sharex=True, height_ratios=[2, 1] * count)[:, 0]
        for (name, values), top, below in zip(overlay.columns.items(), panels[::2], panels[1::2], strict=True):
            scale, rest = overlay.scale(name, values), overlay.scale(name, values - values[0])
            for k, one in enumerate(values):
                colour = COLOURS[k % len(COLOURS)]
                dashes = (0, DASHES) if k else "-"
                top.plot(overlay.t, scale.factor * one, color=colour, lw=1.1, ls=dashes, label=overlay.names[k])
                if k:
                    below.plot(overlay.t, rest.factor * (one - values[0]), color=colour, lw=0.9)
            top.set_title(labelled(name, in_words(scale.unit)), loc="left")
            below.set_title(labelled(f"difference from {overlay.names[0]}", in_words(rest.unit)), loc="left")
            top.grid(axis="y")
            below.grid(axis="y")
        panels[0].legend(loc="upper right", ncols=len(overlay.names), frameon=False)
        panels[-1].set_xlabel("time [s]")
        return figure


def write_figure(overlay: Overlay, path: Path, force: bool) -> Path:
    """Write the figure as SVG."""
    import matplotlib

    with matplotlib.rc_context(rc=STYLE), replacing(path, force) as partial:
        figure_of(overlay).savefig(partial, format="svg", metadata={"Date": None})
    return path


def write_page(overlay: Overlay, notes: Sequence[str], path: Path, force: bool) -> Path:
    """Write the page: a table of differences, and the explorer; self-contained, no network."""
    rows = [_row(one) for one in overlay.differences()]
    seconds, count = float(overlay.t[-1] - overlay.t[0]), len(overlay.columns)
    lead = f"{count} columns over {seconds:.4g} s that all have in common, {len(overlay.t):,} rows."
    shown = {"names": overlay.names, "lead": lead, "notes": notes, "rows": rows}
    return write_explorer("cosim.plots", "compare.html.j2", overlay.names, {"": overlay}, shown, path, force)


def write_explorer(
    package: str,
    template: str,
    names: Sequence[str],
    overlays: Mapping[str, Overlay],
    shown: Mapping[str, Any],
    path: Path,
    force: bool,
) -> Path:
    """Write a page with the explorer of overlays; self-contained, no network.

    Args:
        package: where the template is.
        template: its name.
        names: of what lies over each other, in the order of their colours.
        overlays: as of `payload`.
        shown: what else the template shows.
        path: of the page.
        force: overwrite it.

    Raises:
        OutputError: the page exists and `force` is not set.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    pages = Environment(loader=PackageLoader(package, ""), autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    script, digest = script_of_page()
    folder = files("cosim.plots")
    css = "".join(folder.joinpath(name).read_text("utf-8") for name in ("run_page.css", "compare.css"))
    text = pages.get_template(template).render(
        **shown,
        key=[(name, INKS[k % len(INKS)]) for k, name in enumerate(names)],
        data=payload(overlays),
        script=Markup(script),
        script_hash=digest,
        css=Markup(css),
        made=f"Made by mount-cosim {__version__}.",
    )
    with replacing(path, force) as partial:
        partial.write_text(text, "utf-8")
    return path


def _row(one: Difference) -> dict[str, str]:
    scale = scale_of(one.unit, abs(one.largest))
    rms, largest = (number(scale.factor * value, 3) for value in (one.rms, one.largest))
    relative = "–" if not np.isfinite(one.relative) else in_share(one.relative)
    row = {"column": one.column, "other": one.other, "unit": in_words(scale.unit) or "not stated"}
    return row | {"rms": rms, "relative": relative, "largest": largest, "at": f"{one.at:.6g}"}


def in_share(ratio: float) -> str:
    """Return a ratio in per cent, or from ten on as so many times."""
    return f"{100 * ratio:.3g} %" if ratio < 10 else f"{number(ratio, 3)} times"


def payload(overlays: Mapping[str, Overlay]) -> JsonObject:
    """What `explorer.js` reads: a record for each column of overlays, which all lie as many over each other.

    Args:
        overlays: by what stands before the names of their columns; "" for nothing.
    """
    first = next(iter(overlays.values()))
    keys = [f"r{k}" for k in range(len(first.names))]
    lines = [(key, INKS[k % len(INKS)], DASHES if k else ()) for k, key in enumerate(keys)]
    gaps = [(f"d{k}", INKS[k % len(INKS)], ()) for k in range(1, len(keys))]
    sheets = (Sheet("", 0.62, lines), Sheet("", 0.38, gaps))
    share = 1 / sum(len(one.columns) for one in overlays.values())
    columns = [(one, name, f"{before}{name}") for before, one in overlays.items() for name in one.columns]
    return of_page(sheets, [_record(*column, share) for column in columns])


def _record(overlay: Overlay, name: str, label: str, share: float) -> JsonObject:
    values, keys = overlay.columns[name], [f"r{k}" for k in range(len(overlay.names))]
    scale, rest = overlay.scale(name, values), overlay.scale(name, values - values[0])
    signals = {key: scale.factor * one for key, one in zip(keys, values, strict=True)}
    signals |= {f"d{k}": rest.factor * (values[k] - values[0]) for k in range(1, len(keys))}
    made = record(label, overlay.t, signals, share)
    gap = np.nanmax(np.abs(values[1:] - values[0]), axis=0)
    centre = float(overlay.t[int(np.nanargmax(gap))]) if np.isfinite(gap).any() else float(overlay.t[0])
    around = AROUND * float(overlay.t[-1] - overlay.t[0])
    titles = [
        labelled(name, in_words(scale.unit)),
        labelled(f"difference from {overlay.names[0]}", in_words(rest.unit)),
    ]
    return {**made, "titles": titles, "spans": {"largest": [centre - around, centre + around]}}
