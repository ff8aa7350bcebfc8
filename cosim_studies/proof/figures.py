"""Pictures of a proof: what was answered to what, whether probabilities keep their word, how much was removed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosim.plots.sheet import figure
from cosim.plots.style import AFTER, BEFORE, GREY, LINE
from cosim_studies.proof.generator import FAMILIES, OUTSIDE
from cosim_studies.proof.power import EDGES, probability

ENDS = ("none", "unknown", "crashed", "timeout", "failed")
"""Answers that are no effect, in the order of the last columns."""


def draw_confusion(table: Mapping[str, Mapping[str, int]], path: Path) -> None:
    """Rows: what was concealed; columns: the first answer; numbers of cases, right ones in blue."""
    answers = {answer for line in table.values() for answer in line}
    columns = [*sorted(answers - {*ENDS}), *(name for name in ENDS if name in answers)]
    rows = [label for label in (*sorted(FAMILIES), *OUTSIDE, "none") if label in table]
    with figure(path, 1, 1, (1.9 + 0.32 * len(columns), 1.6 + 0.27 * len(rows)), force=True) as (_, ((axes,),)):
        for y, label in enumerate(rows):
            right = "unknown" if label in OUTSIDE else label
            for answer, count in table[label].items():
                _cell(axes, columns.index(answer), y, count / sum(table[label].values()), count, answer == right)
        axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5), ylabel="concealed")
        axes.set_xticks(range(len(columns)), [_words(c) for c in columns], rotation=90)
        axes.set_yticks(range(len(rows)), [_words(r) + " (outside)" * (r in OUTSIDE) for r in rows])
        axes.set_title("first answer", loc="left", color=GREY)
        axes.grid(True, linewidth=0.4)


def _cell(axes: Any, x: int, y: int, strength: float, count: int, right: bool) -> None:
    colour = AFTER if right else BEFORE
    axes.add_patch(_square(x, y, colour, 0.15 + 0.75 * strength))
    axes.text(x, y, str(count), ha="center", va="center", fontsize=8, color="white" if strength > 0.4 else "black")


def _square(x: int, y: int, colour: str, alpha: float) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - 0.45, y - 0.45), 0.9, 0.9, facecolor=colour, alpha=alpha, linewidth=0)


def _words(label: str) -> str:
    return label.replace("_", " ")


def draw_calibration(reliability: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Printed probability against the share that was true, with Wilson intervals; the diagonal keeps its word."""
    with figure(path, 1, 1, (4.6, 3.8), force=True) as (_, ((axes,),)):
        axes.plot([0, 1], [0, 1], color=LINE, linewidth=1)
        for one in reliability:
            axes.plot([one["printed"]] * 2, [one["low"], one["high"]], color=AFTER, linewidth=1.2)
            axes.plot(one["printed"], one["true"], "o", color=AFTER, markersize=5)
            place = {"xytext": (5, 4), "textcoords": "offset points"}
            axes.annotate(str(one["n"]), (one["printed"], one["true"]), color=GREY, fontsize=8, **place)
        axes.set(xlim=(-0.03, 1.08), ylim=(-0.03, 1.08), xlabel="printed probability", ylabel="share that was true")
        axes.set_title("effects offered; the number of them beside each dot", loc="left", color=GREY)
        axes.grid(True)


def draw_gaps(gaps: Sequence[float], path: Path) -> None:
    """Share of the removable held-out RMS that was removed, cases in order; 1 is the true structure refitted."""
    low = -0.25
    with figure(path, 1, 1, (5.6, 3.2), force=True) as (_, ((axes,),)):
        ordered = np.sort(np.clip(gaps, low, 1.5)) if len(gaps) else np.zeros(0)
        axes.bar(range(len(ordered)), ordered, width=0.8, color=[AFTER if x >= 0.9 else BEFORE for x in ordered])
        axes.axhline(1, color=GREY, linewidth=0.8)
        axes.axhline(0.9, color=GREY, linewidth=0.8, linestyle=":")
        axes.set(xlabel="cases with something concealed, in order", ylabel="share removed", ylim=(low, 1.55))
        axes.tick_params(labelbottom=False)


def draw_powers(powers: Sequence[Mapping[str, Any]], path: Path) -> None:
    """For each effect: cases right (top) or wrong (bottom) over the size that was drawn, and the fitted curve."""
    columns = 4
    rows = max(1, -(-len(powers) // columns))
    x = np.geomspace(EDGES[0], EDGES[-1], 60)
    with figure(path, rows, columns, (9.0, 1.0 + 1.35 * rows), force=True) as (_, grid):
        cells = [axes for line in grid for axes in line]
        for axes, one in zip(cells, powers, strict=False):
            curve = [probability(size, one["curve"]["a"], one["curve"]["b"]) for size in x]
            axes.plot(x, curve, color=AFTER, linewidth=1.4)
            for size, right in one["dots"]:
                axes.plot(size, float(right), "o", color=AFTER if right else BEFORE, markersize=3, alpha=0.6)
            axes.set(xscale="log", xlim=(0.18, 1.1), ylim=(-0.1, 1.1))
            axes.set_xticks([0.2, 0.5, 1.0], ["0.2", "0.5", "1"])
            axes.set_xticks([], minor=True)
            axes.set_title(_words(one["effect"]), loc="left", color=GREY, fontsize=8)
        for axes in cells[len(powers) :]:
            axes.axis("off")
