"""The explorer of a run's page: each recorded column over time to zoom into, a set point over its position.

Columns are read from the file one at a time, so that a long recording costs the memory of one column.
"""

import json
from collections.abc import Iterator
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cosim.data.columns import doubles
from cosim.plots.digest import Digest, in_words
from cosim.plots.explorer import Sheet, of_page, record, script_of_page
from cosim.plots.quantities import labelled, scale_of
from cosim.plots.style import Array
from cosim.support.plain import JsonObject

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

MOST_ROWS, LEAST_ROWS = 4_000_000, 20
"""Rows of a recording that are looked at whole (a column of so many is 32 MB), and from which there is much to see."""
MOST_COLUMNS = 40
KEY = (
    '<p class="key"><span><i style="background: var(--after)"></i>the column</span> '
    '<span><i style="background: var(--grey)"></i>its set point, dashed</span></p>'
)
SHEETS = (Sheet("", 1.0, (("column", "after", ()), ("set point", "grey", (5, 3)))),)


def explorer(recording: Path, small: Digest) -> tuple[str, str, str]:
    """Return the explorer as HTML, its style, and the hash of its script; empty texts where there is none."""
    from pyarrow import parquet

    with parquet.ParquetFile(recording) as file:
        rows = file.metadata.num_rows
        if not LEAST_ROWS <= rows <= MOST_ROWS or small.end <= small.start:
            return "", "", ""
        records = list(_records(file, small))
    if not records:
        return "", "", ""
    script, digest = script_of_page()
    text = json.dumps(of_page(SHEETS, records)).replace("<", "\\u003c")
    style = (files("cosim.plots") / "compare.css").read_text("utf-8")
    parts = [
        '<h2>Look closer</h2><div id="explorer" hidden><div class="bar"><select aria-label="Column"></select>',
        '<button data-to="all">All of it</button></div>',
        KEY if any("set point" in str(one["signals"]) for one in records) else "",
        '<canvas tabindex="0" role="img" aria-label="The chosen column over time."></canvas>',
        '<p class="quiet">Drag to zoom, double-click for all of it. Keys: arrows move, + and − zoom. ',
        "Printing shows the current view.</p></div>",
        f'<script type="application/json" id="recordings">{text}</script><script>{script}</script>',
    ]
    return "".join(parts), style, digest


def policy(digest: str) -> str:
    """The rule of a page that may run the explorer's script and nothing else."""
    rule = f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    return f'<meta http-equiv="Content-Security-Policy" content="{escape(rule)}">'


def _records(file: "ParquetFile", small: Digest) -> Iterator[JsonObject]:
    """Each column as a record; of a set point together with the position that follows it."""
    asked = {axis.measured: axis.columns["q_d"] for axis in small.axes if axis.measured and "q_d" in axis.columns}
    names = [name for name in file.schema_arrow.names if name != "t" and name in small.lines]
    names = sorted(names, key=lambda name: name not in asked)[:MOST_COLUMNS]
    t = _column(file, "t")
    if len(t) < LEAST_ROWS or not t[-1] > t[0]:
        return
    share = 1 / (len(names) + len(asked))
    for axis in small.axes:
        if axis.error and axis.measured in asked and axis.error not in file.schema_arrow.names:
            error = _column(file, asked[axis.measured]) - _column(file, axis.measured)
            yield _record(axis.error, t, {"column": error}, small.lines[axis.error].unit, share)
    for name in names:
        signals = {"column": _column(file, name)}
        if name in asked:
            signals["set point"] = _column(file, asked[name])
        yield _record(name, t, signals, small.lines[name].unit, share)


def _record(name: str, t: Array, signals: dict[str, Array], unit: str, share: float) -> JsonObject:
    """One entry of the list, in the unit that fits its first signal."""
    scale = scale_of(unit, float(np.nanmax(np.abs(signals["column"]), initial=0.0)))
    shown = {key: values * scale.factor for key, values in signals.items()}
    return {**record(name, t, shown, share), "titles": [labelled(name, in_words(scale.unit))]}


def _column(file: "ParquetFile", name: str) -> Array:
    """The values; a `cast` that is not needed would load pyarrow's arithmetic."""
    import pyarrow as pa

    chunks, double = file.read(columns=[name])[name].chunks, pa.float64()
    parts = [chunk if chunk.type == double else chunk.cast(double, safe=False) for chunk in chunks]
    if any(part.null_count for part in parts):
        return np.concatenate([np.asarray(part.to_pylist(), float) for part in parts])
    return doubles(parts)
