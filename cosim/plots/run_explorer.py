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

from cosim.plots.digest import Digest, in_words
from cosim.plots.explorer import Sheet, record, script_of_page
from cosim.plots.quantities import scale_of
from cosim.plots.style import Array
from cosim.support.plain import JsonObject

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

MOST_ROWS, LEAST_ROWS = 4_000_000, 20
"""Rows of a recording that are looked at whole (a column of so many is 32 MB), and from which there is much to see."""
MOST_COLUMNS = 40
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
    data: JsonObject = {
        "sheets": [sheet.as_json() for sheet in SHEETS],
        "differences": [],
        "recordings": records,
        "first": "all",
        "open": 0,
    }
    script, digest = script_of_page()
    text = json.dumps(data).replace("<", "\\u003c")
    style = (files("cosim.plots") / "compare.css").read_text("utf-8")
    parts = [
        '<h2>Look closer</h2><div id="explorer" hidden><div class="bar"><select aria-label="Column"></select>',
        '<button data-to="all">All of it</button></div>',
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
    for name in names:
        values = _column(file, name)
        scale = scale_of(small.lines[name].unit, float(np.nanmax(np.abs(values), initial=0.0)))
        signals = {"column": values * scale.factor}
        if name in asked:
            signals["set point"] = _column(file, asked[name]) * scale.factor
        unit = in_words(scale.unit)
        titles = [f"{name} [{unit}]" if unit else name]
        yield {**record(name, t, signals, 1 / len(names)), "titles": list(titles)}


def _column(file: "ParquetFile", name: str) -> Array:
    """The values, from pyarrow's own memory: `to_numpy` would load pandas, a quarter of a second in each run."""
    import pyarrow as pa

    parts = [chunk.cast(pa.float64(), safe=False) for chunk in file.read(columns=[name])[name].chunks]
    if any(part.null_count for part in parts):
        return np.concatenate([np.asarray(part.to_pylist(), float) for part in parts])
    rows = [np.frombuffer(one.buffers()[1], np.float64)[one.offset : one.offset + len(one)] for one in parts]
    return np.concatenate(rows) if rows else np.zeros(0)
