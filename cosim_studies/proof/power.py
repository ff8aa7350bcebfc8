"""Power: how often an effect is found, by how large it was drawn and by how much there was to gain.

The size of a case is drawn evenly in its logarithm from the benchmark's range. For each effect a logistic curve over
ln(size) is fitted to the cases with it alone (right name first or not), with weak priors since a benchmark holds few:

    p(size) = 1 / (1 + exp(-(a + b ln size))),   a ~ N(0, 3^2),   ln b ~ N(ln 2, 1)
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize

from cosim.support.plain import Parsed
from cosim_studies.proof import marks
from cosim_studies.proof.intervals import share
from cosim_studies.proof.marks import Row

EDGES = (0.2, 0.34, 0.58, 1.0)
"""Bins of size, alike in their logarithm."""
SHOWN = (0.2, 0.45, 1.0)
"""Sizes at which the page reads the curve."""
LEVELS = {"nothing to gain": (-np.inf, 0.05), "subtle": (0.05, 0.45), "medium": (0.45, 0.75), "strong": (0.75, np.inf)}
"""Shares of the refitted base's held-out error energy that the true structure removes."""
CENTRE, WIDTH = 2.0, 3.0
"""Prior of the slope (its median) and of the offset (its standard deviation)."""


def curve(sizes: Sequence[float], found: Sequence[bool]) -> tuple[float, float]:
    """Offset and slope (positive) of the most probable curve."""
    x, sign = np.log(np.asarray(sizes)), np.where(np.asarray(found), 1.0, -1.0)

    def cost(numbers: Any) -> float:
        a, log_slope = numbers
        prior = (a / WIDTH) ** 2 / 2 + (log_slope - np.log(CENTRE)) ** 2 / 2
        return float(np.logaddexp(0, -sign * (a + np.exp(log_slope) * x)).sum() + prior)

    a, log_slope = minimize(cost, [0.0, np.log(CENTRE)]).x
    return float(a), float(np.exp(log_slope))


def probability(size: float, a: float, b: float) -> float:
    """The curve at a size."""
    return float(1 / (1 + np.exp(-(a + b * np.log(size)))))


def powers(rows: Sequence[Row]) -> list[Parsed]:
    """For each effect that was concealed alone: bins of size with cases and right ones, and the curve."""
    return [_power(name, cases) for name, cases in _alone(rows)]


def _alone(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    single = [row for row in rows if row["kind"] == "one" and "size" in row]
    for name in sorted({row["effects"][0] for row in single}):
        yield name, [row for row in single if row["effects"][0] == name]


def _power(name: str, rows: Sequence[Row]) -> Parsed:
    sizes, found = [float(row["size"]) for row in rows], [marks.right_first(row) for row in rows]
    a, b = curve(sizes, found)
    place = np.clip(np.searchsorted(EDGES, sizes, side="right") - 1, 0, len(EDGES) - 2)
    bins = [[right for right, at in zip(found, place, strict=True) if at == k] for k in range(len(EDGES) - 1)]
    return {
        "effect": name,
        "bins": [{"cases": len(one), "right_first": sum(one)} for one in bins],
        "curve": {"a": a, "b": b},
        "at": [probability(size, a, b) for size in SHOWN],
        "dots": [[size, right] for size, right in zip(sizes, found, strict=True)],
    }


def by_level(rows: Sequence[Row]) -> list[Parsed]:
    """Cases with one effect by what the true structure removes: cases, right first and in the set with intervals."""
    single = [
        (row, removable) for row in rows if row["kind"] == "one" and (removable := marks.removable(row)) is not None
    ]
    found = []
    for name, (low, high) in LEVELS.items():
        cases = [row for row, removable in single if low <= removable < high]
        found.append({"level": name, "cases": len(cases), **_shares(cases)})
    unknown = [row for row in rows if row["kind"] == "one" and marks.removable(row) is None]
    return [*found, {"level": "no ceiling", "cases": len(unknown), **_shares(unknown)}]


def _shares(cases: Sequence[Row]) -> Parsed:
    judged: dict[str, Callable[[Row], bool]] = {"right_first": marks.right_first, "in_set": marks.in_set}
    return {key: share([mark(row) for row in cases]).as_json() for key, mark in judged.items()}


def outside(rows: Sequence[Row], shaped: Sequence[str]) -> list[Parsed]:
    """Effects outside the list: cases, "unknown" said, a name attached; and the share of "unknown" without each.

    `shaped` are those that the diagnosis has a shape for. The last two rows are these and the others, together.
    """
    cases = [row for row in rows if row["kind"] == "outside"]
    groups = {name: [name] for name in sorted({row["effects"][0] for row in cases})}
    groups |= {"with a shape": list(shaped), "without one": [name for name in groups if name not in shaped]}
    return [_outside(cases, label, names, shaped) for label, names in groups.items()]


def _outside(cases: Sequence[Row], label: str, names: Sequence[str], shaped: Sequence[str]) -> Parsed:
    own = [row for row in cases if row["effects"][0] in names]
    others = [row for row in cases if row["effects"][0] not in names]
    return {
        "effect": label,
        "cases": len(own),
        "shape": label in shaped or label == "with a shape",
        "unknown": share([marks.says_unknown(row) for row in own]).as_json(),
        "named": sum(bool(marks.names(row)) for row in own),
        "without": share([marks.says_unknown(row) for row in others]).as_json(),
    }
