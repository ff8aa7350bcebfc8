"""`cosim.compare`: runs and recordings over each other."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

from cosim.api.recordings import Source, read
from cosim.data.overlay import aligned
from cosim.data.recording import Recording
from cosim.master.result import RunResult
from cosim.plots.compare import Difference, Overlay, figure_of, in_share, write_figure, write_page
from cosim.plots.digest import in_words
from cosim.plots.quantities import number, scale_of
from cosim.support.errors import InputError
from cosim.support.files import check_free, directory, replacing
from cosim.support.html import table as html_table
from cosim.support.plain import JsonObject
from cosim.support.version import __version__

FILES = ("compare.html", "compare.json", "compare.svg")
RUN = "recording.parquet"
"""What a folder of `cosim run` holds."""


@dataclass(frozen=True)
class Comparison:
    """Recordings over each other: columns on one time base, and how far each is from the first."""

    overlay: Overlay
    notes: tuple[str, ...]

    @property
    def differences(self) -> list[Difference]:
        """Each further recording against the first, column by column, in SI units."""
        return self.overlay.differences()

    def frame(self) -> Any:
        """Return the differences as a pandas `DataFrame`."""
        import pandas

        return pandas.DataFrame([asdict(one) for one in self.differences])

    def plot(self) -> Any:
        """Return columns and differences over time as a matplotlib figure."""
        return figure_of(self.overlay)

    def as_json(self) -> JsonObject:
        """Return everything but the columns as plain data; what is no number is null."""
        rows = [{key: _finite(value) for key, value in asdict(one).items()} for one in self.differences]
        t = self.overlay.t
        return {
            "recordings": list(self.overlay.names),
            "span": [float(t[0]), float(t[-1])],
            "rows": len(t),
            "differences": rows,
            "notes": list(self.notes),
            "version": __version__,
        }

    def __str__(self) -> str:
        return "\n".join([*(_sentence(one, self.overlay.names[0]) for one in self.differences), *self.notes])

    def __repr__(self) -> str:
        return f"Comparison({' with '.join(self.overlay.names)}, {len(self.overlay.columns)} columns)"

    def _repr_html_(self) -> str:
        return html_table("Differences", [asdict(one) for one in self.differences])


def compare(
    *recordings: Source | RunResult,
    out: str | Path | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    force: bool = False,
) -> Comparison:
    """Lay runs and recordings over each other, and say how far each column is from that of the first.

    Args:
        recordings: two or more: recordings in any form that `cosim.read` takes, results and folders of runs.
        out: folder for compare.html, compare.json and compare.svg; None writes nothing.
        columns: our name to the source's, as in `cosim.read`.
        units: our name to the unit in the source, as in `cosim.read`.
        force: overwrite what is there.

    Raises:
        InputError: there is one recording only.
        RecordingError: one cannot be read, or they have no column or no time in common.
        OutputError: a file is there already.
    """
    if len(recordings) < 2:
        raise InputError("A comparison needs two recordings or more.", culprit="recordings")
    folder = None if out is None else Path(out)
    for name in FILES if folder else ():
        check_free(folder / name, force)  # type: ignore[operator]
    taken = _named([_read(one, columns, units) for one in recordings])
    found = aligned(taken)
    overlay = Overlay(tuple(one.name for one in taken), found.t, found.columns, found.units)
    done = Comparison(overlay, found.notes)
    if folder:
        directory(folder)
        write_page(overlay, found.notes, folder / FILES[0], force)
        with replacing(folder / FILES[1], force) as partial:
            partial.write_text(json.dumps(done.as_json(), indent=2) + "\n", "utf-8")
        write_figure(overlay, folder / FILES[2], force)
    return done


def _read(one: Source | RunResult, columns: Mapping[str, str] | None, units: Mapping[str, str] | None) -> Recording:
    if isinstance(one, RunResult):
        return replace(one.recording, name=one.name)
    if isinstance(one, str | Path) and (Path(one) / RUN).is_file():
        return replace(read(Path(one) / RUN, required=()), name=Path(one).name)
    return read(one, columns=columns, units=units, required=())


def _finite(value: str | float) -> str | float | None:
    return value if isinstance(value, str) or isfinite(value) else None


def _named(recordings: list[Recording]) -> list[Recording]:
    """The same with names that differ."""
    names = [one.name for one in recordings]
    return [
        replace(one, name=f"{one.name} ({k + 1})") if names.count(one.name) > 1 else one
        for k, one in enumerate(recordings)
    ]


def _sentence(one: Difference, first: str) -> str:
    scale = scale_of(one.unit, abs(one.largest))
    rms, largest = (number(scale.factor * value, 3) for value in (one.rms, one.largest))
    relative = f", {in_share(one.relative)}" if isfinite(one.relative) else ""
    unit = f" {in_words(scale.unit)}" if scale.unit else ""
    apart = f"{rms}{unit} RMS{relative}; largest {largest} at {one.at:.6g} s"
    return f"{one.column}: {one.other} differs from {first} by {apart}"
