"""Signals thinned, quantised and compressed into a page, for the canvas explorer (`explorer.js`).

A record is a set of signals over one time; sheets are the panels, one above the other, in which its lines are drawn.
"""

import base64
import hashlib
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
import numpy.typing as npt

from cosim.plots.style import Array
from cosim.support.plain import Json, JsonObject

Index = npt.NDArray[np.intp]
BUCKETS = 10_000
"""Over all records; each gives a smallest and a largest value per signal."""
LEAST = 50
"""Buckets of a record, however short it is beside the others."""
LEVELS = 65_000
MISSING = 65_535
INKS = ("ink", "before", "after", "grey")
"""Colours of the page that a line may have."""


@dataclass(frozen=True)
class Sheet:
    """A panel: its title, its share of the height, and its lines, each a signal, an ink and its dashes [px]."""

    title: str
    share: float
    lines: Sequence[tuple[str, str, Sequence[int]]]

    def as_json(self) -> JsonObject:
        """Plain data."""
        lines: list[list[Json]] = [[name, ink, list(dashes)] for name, ink, dashes in self.lines]
        return {"title": self.title, "share": self.share, "lines": lines}


def record(name: str, t: Array, signals: Mapping[str, Array], share: float = 1.0) -> JsonObject:
    """Pack signals of shape (rows,) over the times t [s]: base64 of zlib-compressed uint16 deltas.

    Args:
        name: what the list of records calls it.
        t: growing times.
        signals: by name.
        share: of all buckets that a page may hold.
    """
    length = float(t[-1] - t[0])
    buckets = int(np.clip(BUCKETS * share, LEAST, max(LEAST, t.size // 4)))
    edges = np.searchsorted(t, t[0] + length / buckets * np.arange(buckets + 1))
    packed = {key: _signal(values, edges) for key, values in signals.items()}
    data = b"".join(codes.tobytes() for codes, _, _ in packed.values())
    return {
        "name": name,
        "start": float(t[0]),
        "length": length,
        "count": 2 * buckets,
        "signals": [[key, low, step] for key, (_, low, step) in packed.items()],
        "spans": {},
        "data": base64.b64encode(zlib.compress(data, 9)).decode(),
    }


def of_page(sheets: Sequence[Sheet], records: Sequence[Json], first: str = "all", **more: Json) -> JsonObject:
    """What `explorer.js` reads.

    Args:
        sheets: panels of each record.
        records: those of `record`, with `spans` that buttons go to.
        first: the span that is shown first.
        more: `differences` [name, one, other] that the page takes itself, `open`: the record that is shown first.
    """
    page: JsonObject = {"sheets": [sheet.as_json() for sheet in sheets], "differences": more.get("differences", [])}
    return page | {"recordings": records, "first": first, "open": more.get("open", 0)}


def script_of_page() -> tuple[str, str]:
    """Return the script and its SHA-256 in base64, by which a page lets it run and nothing else."""
    script = files("cosim.plots").joinpath("explorer.js").read_text("utf-8")
    return script, base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _signal(values: Array, edges: Index) -> tuple[npt.NDArray[np.uint16], float, float]:
    """Return uint16 deltas of two values a bucket, and the offset and step that give the values back."""
    pairs = _pairs(values, edges)
    low = float(np.nanmin(pairs)) if np.isfinite(pairs).any() else 0.0
    step = (float(np.nanmax(pairs)) - low) / LEVELS if np.isfinite(pairs).any() else 0.0
    step = step or 1.0
    levels = np.where(np.isfinite(pairs), np.round((pairs - low) / step), MISSING).astype(np.uint16)
    return np.diff(levels, prepend=np.uint16(0)).astype("<u2"), low, step


def _pairs(values: Array, edges: Index) -> Array:
    """Return smallest and largest value of every bucket in the order they came; NaN where it is empty."""
    pairs = np.full((len(edges) - 1, 2), np.nan)
    full = np.diff(edges) > 0
    starts = edges[:-1][full]
    if not len(starts):
        return pairs.ravel()
    part = values[: edges[-1]]
    low, high = np.fmin.reduceat(part, starts.astype(np.intp)), np.fmax.reduceat(part, starts.astype(np.intp))
    rising = part[np.minimum(edges[1:][full], len(part)) - 1] >= part[starts]
    pairs[full] = np.where(rising[:, None], np.stack([low, high], 1), np.stack([high, low], 1))
    return pairs.ravel()
