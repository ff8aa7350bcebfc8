"""How pictures of this project look: colours, matplotlib's settings, and how long lines are thinned."""

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

Style = dict[str, Any]
"""What matplotlib takes by name of a line, a mark or a text: colour, width, dashes, ..."""

MEASURED, BEFORE, AFTER = "#1A1A1A", "#CC6A00", "#00558C"
GREY, LINE, SHADE = "#5A6068", "#C9CED3", "#EEF0F1"
BAND = "#8A939B"
"""The noise."""

STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "cosim",
    "text.parse_math": False,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "font.size": 12.5,
    "axes.titlesize": 12.5,
    "axes.labelsize": 12.5,
    "xtick.labelsize": 12.5,
    "ytick.labelsize": 12.5,
    "text.color": MEASURED,
    "axes.labelcolor": GREY,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "axes.edgecolor": LINE,
    "axes.linewidth": 1,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.major.size": 0,
    "ytick.major.size": 0,
    "xtick.major.pad": 5,
    "axes.labelpad": 3,
    "grid.color": "#E3E6E8",
    "grid.linewidth": 1,
    "lines.linewidth": 1.6,
    "lines.dash_joinstyle": "round",
    "hatch.linewidth": 0.7,
    "hatch.color": "#A9B0B6",
}


def thin(x: Array, y: Array, buckets: int) -> tuple[Array, Array]:
    """Return the last point and, of each bucket, its smallest and largest value in the order they came."""
    size = -(-len(y) // buckets)
    if size < 3:
        return x, y
    rows = np.pad(y, (0, -len(y) % size), mode="edge").reshape(-1, size)
    picks = np.sort(np.stack([rows.argmin(axis=1), rows.argmax(axis=1)], axis=1), axis=1)
    index = np.minimum((picks + np.arange(len(rows))[:, None] * size).ravel(), len(y) - 1)
    index = np.append(index, len(y) - 1)
    return x[index], y[index]
