"""Charts as SVG text, written without matplotlib: its import alone takes longer than a run of 15 s."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from math import ceil, floor, isfinite, log, log10

import numpy as np

from cosim.plots.style import AFTER, GREY, LINE, Array

LEFT, RIGHT, TOP, BOTTOM = 62, 12, 30, 40
"""Margins in px."""
Range = tuple[float, float]


@dataclass(frozen=True)
class Ruler:
    """One side of a chart: from low to high over `length` px beginning at `start`; `log` for decades."""

    low: float
    high: float
    start: float
    length: float
    log: bool = False

    @classmethod
    def around(cls, low: float, high: float, start: float, length: float) -> "Ruler":
        """Leave a little room around what is drawn."""
        room = 0.04 * (high - low) or abs(low) * 0.1 or 1.0
        return cls(low - room, high + room, start, length)

    def at(self, values: Array) -> Array:
        """Return places in px."""
        if self.log:
            share = np.log(values / self.low) / log(self.high / self.low)
        else:
            share = (values - self.low) / (self.high - self.low)
        placed: Array = self.start + self.length * share
        return placed

    def labels(self) -> list[tuple[float, str]]:
        """Return the ticks, in px, with their text."""
        ticks = self.ticks()
        texts = [_power(value) for value in ticks] if self.log else _digits(ticks)
        return list(zip(self.at(np.array(ticks)).tolist(), texts, strict=True))

    def ticks(self, wanted: int = 5) -> list[float]:
        """Return round numbers inside, about as many as wanted."""
        if self.log:
            decades = range(ceil(log10(self.low) - 1e-9), floor(log10(self.high) + 1e-9) + 1)
            return [10.0**decade for decade in decades[:: -(-len(decades) // (wanted + 2))]] if decades else []
        rough = (self.high - self.low) / wanted
        size = 10.0 ** floor(log10(rough))
        step = next(one * size for one in (1, 2, 5, 10) if one * size >= rough * 0.999)
        return [k * step for k in range(ceil(self.low / step), floor(self.high / step) + 1)]


@dataclass
class Chart:
    """A chart of `width` by `height` px; draw into it, then take its text."""

    title: str
    below: str
    x: Ruler
    y: Ruler
    width: int
    height: int
    parts: list[str] = field(default_factory=list)

    @classmethod
    def over(cls, title: str, below: str, x: Range, y: Range, size: tuple[int, int], log: bool = False) -> "Chart":
        """Make a chart for these ranges; `log` makes both sides logarithmic."""
        width, height = size
        across, foot, up = width - LEFT - RIGHT, height - BOTTOM, TOP + BOTTOM - height
        side = Ruler(*y, foot, up, True) if log else Ruler.around(*y, foot, up)
        right = x if x[0] < x[1] else (x[0] - 0.5, x[0] + 0.5)  # a single point in time
        return cls(title, below, Ruler(*right, LEFT, across, log), side, width, height)

    def line(self, x: Array, y: Array, colour: str = AFTER, width: float = 1.4) -> None:
        """Join points."""
        pairs = zip(self.x.at(x).tolist(), self.y.at(y).tolist(), strict=True)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in pairs if isfinite(a) and isfinite(b))
        self.parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}"/>')

    def band(self, x: Array, low: Array, high: Array, colour: str = AFTER) -> None:
        """Draw extremes over x: what a line with all its points would cover."""
        self.line(np.repeat(x, 2), np.stack([low, high], axis=1).ravel(), colour, 1.2)

    def svg(self) -> str:
        """Return the text of the chart."""
        label = escape(self.title)
        head = f'<svg viewBox="0 0 {self.width} {self.height}" role="img" aria-label="{label}">'
        title = f'<text x="4" y="16" class="title">{label}</text>'
        return "".join([head, title, *self._grid(), *self.parts, "</svg>"])

    def _grid(self) -> list[str]:
        right, foot = self.width - RIGHT, self.height - BOTTOM
        below = f'<text x="{(LEFT + right) / 2:.0f}" y="{self.height - 6}" class="mid">{escape(self.below)}</text>'
        parts = [below]
        for y, text in self.y.labels():
            parts.append(f'<path d="M{LEFT} {y:.1f}H{right}" stroke="{LINE}"/>')
            parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" class="end">{text}</text>')
        for x, text in self.x.labels():
            parts.append(f'<path d="M{x:.1f} {foot}v4" stroke="{GREY}"/>')
            parts.append(f'<text x="{x:.1f}" y="{foot + 17}" class="mid">{text}</text>')
        return parts


def _power(value: float) -> str:
    """Write a power of ten."""
    power = round(log10(value))
    if abs(power) <= 3:
        return f"{value:g}"
    return f"10{str(power).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def _digits(values: Sequence[float]) -> list[str]:
    """Write ticks with the digits that tell them apart."""
    step = min((high - low for low, high in pairwise(values)), default=1.0)
    largest = max((abs(value) for value in values), default=1.0)
    places = max(0, -floor(log10(step) + 1e-9))
    digits = max(0, floor(log10(largest) + 1e-9) - floor(log10(step) + 1e-9)) if largest else 0
    form = f".{places}f" if 1e-3 <= largest < 1e7 else f".{digits}e"
    return [f"{value:{form}}".replace("-", "−") if value else "0" for value in values]
