"""Axes and lines of small charts as numbers for a template: ticks at round values, corners in units of the picture.

A chart is 400 wide, so that its text of 14 has at least 12 pixels on a phone; colours are the page's.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, isfinite, log10

WIDTH, HEIGHT = 400, 132
"""Size of a chart, in its own units."""
LEFT, RIGHT, TOP, BOTTOM = 52, 8, 8, 22
STEPS = (1, 2, 5, 10)
"""Of a decade: the distances of ticks."""


@dataclass(frozen=True)
class Tick:
    """A value at an axis: where, in units of the picture, and what is written there."""

    at: float
    text: str


@dataclass(frozen=True)
class Chart:
    """A chart: the area of its lines, ticks of both axes, and lines as points of a `polyline`, by name."""

    x: tuple[Tick, ...]
    y: tuple[Tick, ...]
    lines: Mapping[str, str]
    height: int = HEIGHT
    width: int = WIDTH

    @property
    def left_edge(self) -> int:
        """Left end of the area."""
        return LEFT

    @property
    def right(self) -> int:
        """Right end of the area."""
        return self.width - RIGHT

    @property
    def top(self) -> int:
        """Upper end of the area."""
        return TOP

    @property
    def bottom(self) -> int:
        """Lower end of the area."""
        return self.height - BOTTOM


def chart(
    lines: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    x: tuple[float, float],
    y: tuple[float, float],
    height: int = HEIGHT,
) -> Chart:
    """Draw lines, each abscissae and ordinates, over the ranges of both axes."""
    empty = Chart((), (), {}, height)
    across, up = _mapped(x, empty.left_edge, empty.right), _mapped(y, empty.bottom, empty.top)
    drawn = {
        name: " ".join(f"{across(a):.1f},{up(b):.1f}" for a, b in zip(*line, strict=True) if isfinite(b))
        for name, line in lines.items()
    }
    return Chart(
        tuple(Tick(round(across(value), 1), text) for value, text in ticks(*x, 7)),
        tuple(Tick(round(up(value), 1), text) for value, text in ticks(*y, 4)),
        drawn,
        height,
    )


def ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Return at most `most` round values from `low` to `high`, with as many decimals as they need."""
    if not (isfinite(low) and isfinite(high)) or high <= low:
        return [(low, f"{low:.4g}")] if isfinite(low) else []
    unit = 10.0 ** floor(log10((high - low) / most))
    step = next(unit * k for k in STEPS if (high - low) / (unit * k) < most or k == STEPS[-1])
    first, last = ceil(low / step - 1e-9), floor(high / step + 1e-9)
    places = max(0, -floor(log10(step) + 1e-9))
    short = step >= 1e-4 and max(abs(low), abs(high)) < 1e6
    return [(k * step, _text(k * step, places if short else None)) for k in range(first, last + 1)]


def _text(value: float, places: int | None) -> str:
    text = f"{value:.3g}" if places is None else f"{value:.{places}f}"
    return (text.lstrip("-") if float(text) == 0 else text).replace("-", "\N{MINUS SIGN}")


def _mapped(ends: tuple[float, float], first: float, last: float) -> Callable[[float], float]:
    low, high = ends
    span = (high - low) or 1.0
    return lambda value: first + (last - first) * (value - low) / span
