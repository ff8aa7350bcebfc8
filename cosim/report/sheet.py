"""
A matplotlib figure whose unit is one CSS pixel, written as an SVG small enough to inline.

matplotlib is imported on use only: the rest of the package must not wait for it.
"""

import io
import re
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

from markupsafe import Markup

from cosim.plots.style import AFTER, BAND, BEFORE, GREY, LINE, MEASURED, SHADE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INKS = {MEASURED: "ink", BEFORE: "before", AFTER: "after", GREY: "grey", LINE: "line", SHADE: "shade", BAND: "band"}
INKS |= {"#E3E6E8": "grid", "#A9B0B6": "hatch", "#FFFFFF": "paper"}
"""Colours that change with the reader's light or dark page, by their name in report.css."""
COLUMN = 356
"""Width of a figure: the width of a phone, and a third of a desk."""


@dataclass(frozen=True)
class Picture:
    """A drawn figure and the sentence below it; `text` says in words what the picture shows."""

    svg: Markup
    caption: str
    heading: str = ""


class Sheet:
    """A figure of fixed size; `name` makes the ids of its parts unique in the page."""

    def __init__(self, name: str, height: int, width: int = COLUMN, plate: bool = False) -> None:
        """Make an empty figure; on a plate it keeps its colours, and white paper, on a dark page too."""
        from matplotlib.figure import Figure

        self.name, self.width, self.height, self.plate = name, width, height, plate
        self.figure = Figure(figsize=(width / 72, height / 72), dpi=72)

    def axes(self, *, left: int = 44, right: int = 10, top: int = 26, bottom: int = 42) -> "Axes":
        """Add axes with these margins in pixels and a light horizontal grid."""
        w, h = self.width, self.height
        axes = self.figure.add_axes((left / w, bottom / h, (w - left - right) / w, (h - top - bottom) / h))
        axes.grid(axis="y")
        return axes

    def picture(self, label: str, caption: str, heading: str = "") -> Picture:
        """Return the finished figure; `label` is what a screen reader says."""
        return Picture(self._svg(label), caption, heading)

    def _svg(self, label: str) -> Markup:
        buffer = io.StringIO()
        nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph")
            self.figure.savefig(buffer, format="svg", metadata=nothing, transparent=True)
        kind = f"w{self.width} plate" if self.plate else f"w{self.width}"
        size = f'class="{kind}" width="{self.width}" height="{self.height}"'
        head = f'<svg role="img" aria-label="{Markup.escape(label)}" {size} viewBox="0 0 {self.width} {self.height}">'
        body = small(buffer.getvalue(), self.name)
        return Markup(head + (body if self.plate else inked(body)))


def heading(axes: "Axes", text: str, below: str = "") -> None:
    """Write the quantity of the vertical axis above it, where it can be read without turning the head.

    `below` is that of the other axis.
    """
    if below:
        axes.set_xlabel(below)
    axes.annotate(text, (0, 1), (-34, 12), xycoords="axes fraction", textcoords="offset points", color=GREY)


def degrees(axes: "Axes", unit: str) -> None:
    """Set ticks of an angle at parts of a turn."""
    from matplotlib.ticker import MultipleLocator

    low, high = axes.get_xlim()
    if unit == "°" and high - low > 100:
        steps = (30, 45, 90, 180, 360, 720, 1800, 3600)
        axes.xaxis.set_major_locator(MultipleLocator(next((s for s in steps if (high - low) / s <= 6), 36000)))


def small(svg: str, name: str) -> str:
    """Strip an SVG of prolog, unused ids, fonts and digits nobody sees, and prefix the ids that stay."""
    body = svg[svg.index("<svg") :]
    body = re.sub(r"<style.*?</style>", "", body[body.index(">") + 1 :], flags=re.S)
    body = re.sub(r'(?<= )(d|x|y|transform|width|height|points)="([^"]*)"', _rounded, body)
    body = re.sub(r"font-family: [^\";]*;? ?", "", body).replace("xlink:href", "href")
    used = set(re.findall(r'(?:url\(#|href="#)([\w.-]+)', body))
    body = re.sub(r' id="([^"]*)"', lambda m: f' id="{name}-{m[1]}"' if m[1] in used else "", body)
    body = re.sub(r'(url\(#|href="#)', rf"\g<1>{name}-", body)
    return re.sub(r">\s+<", "><", re.sub(r"\s*\n\s*", " ", body))


def inked(svg: str) -> str:
    """Name the colours of an SVG, so that the page decides what they are."""
    names = {colour.lower(): name for colour, name in INKS.items()}
    return re.sub("|".join(names), lambda found: f"var(--{names[found[0]]})", svg)


def _rounded(match: "re.Match[str]") -> str:
    value = re.sub(r"-?\d+\.\d+", lambda m: f"{float(m[0]):.1f}".removesuffix(".0"), match[2])
    return f'{match[1]}="{value.strip()}"'
