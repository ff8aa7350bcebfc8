"""A model as a block diagram: where its parts act, on the way from inputs to outputs and beside it."""

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from itertools import pairwise

from pyfmi_models.model import Model, Variable

LETTER, LINE, PAD, GAP = 7.4, 19, 14, 46
"""Width of a letter, height of a line, space inside a box and between boxes, in pixels."""
LEGIBLE = 700
"""Width below which a wide diagram is not made narrower: its letters would be too small, so it scrolls."""
_STYLE = (
    "svg text{font:13px system-ui,sans-serif;fill:#1d2b36}svg .title{font-weight:600}"
    "svg rect{fill:#eef4f8;stroke:#4a7fa5;stroke-width:1.3}svg .beside{fill:#fbf6ea;stroke:#b08a3c}"
    "svg .bare{fill:none;stroke:none}svg path{fill:none;stroke:#1d2b36;stroke-width:1.3;marker-end:url(#a)}"
)
_TIP = (
    '<defs><marker id="a" markerWidth="9" markerHeight="8" refX="8" refY="4" orient="auto">'
    '<path style="marker-end:none" d="M0 0L8 4L0 8"/></marker></defs>'
)


@dataclass
class _Box:
    title: str
    lines: list[str]
    kind: str = ""
    x: float = 0
    y: float = 0

    @property
    def width(self) -> float:
        return max(1.1 * len(self.title), *map(len, self.lines), 8) * LETTER + 2 * PAD

    @property
    def height(self) -> float:
        return LINE * (1 + len(self.lines)) + 2 * PAD - 6

    def drawn(self) -> str:
        texts = [("title", self.title)] + [("", line) for line in self.lines]
        rows = "".join(
            f'<text class="{style}" x="{self.x + PAD:g}" y="{self.y + PAD + 8 + LINE * k:g}">{escape(text)}</text>'
            for k, (style, text) in enumerate(texts)
        )
        size = f'width="{self.width:g}" height="{self.height:g}"'
        return f'<rect class="{self.kind}" x="{self.x:g}" y="{self.y:g}" {size} rx="5"/>{rows}'


def diagram(model: Model) -> str:
    """Draw the model as SVG text; equal models give equal text."""
    way, beside = _boxes(model)
    _put_in_row(way, 0, GAP)
    middle = max(box.height for box in way) / 2 + 10
    for box in way:
        box.y = middle - box.height / 2
    low = 2 * middle + GAP / 2
    arrows = [_arrow(a.x + a.width, middle, b.x, middle) for a, b in pairwise(way)]
    for target, boxes in beside.items():
        onto = next(box for box in way if box.title == target)
        arrows += _put_below(boxes, onto, low)
    return _svg([*way, *(box for boxes in beside.values() for box in boxes)], arrows, model.name)


def _boxes(model: Model) -> tuple[list[_Box], dict[str, list[_Box]]]:
    """The boxes of the way from inputs to outputs, and those beside it by the title of the box that they work on."""
    places: dict[str, _Box] = {}
    beside: dict[str, list[_Box]] = {}
    for chapter in model.chapters:
        if chapter.place not in places:
            places[chapter.place] = _Box(chapter.place, [], "beside" if chapter.onto else "")
            if chapter.onto:
                beside.setdefault(chapter.onto, []).append(places[chapter.place])
        places[chapter.place].lines.append(chapter.title)
    way = [box for box in places.values() if not box.kind] or [_Box(model.name, [])]
    inputs = [_Box("Inputs", _signals(model.inputs), "bare")] if model.inputs else []
    return [*inputs, *way, _Box("Outputs", _signals(model.outputs), "bare")], beside


def _signals(variables: Iterable[Variable]) -> list[str]:
    return [f"{one.name} [{one.unit}]" for one in variables]


def _put_in_row(boxes: list[_Box], x: float, gap: float) -> None:
    for box in boxes:
        box.x = x
        x += box.width + gap


def _put_below(boxes: list[_Box], onto: _Box, y: float) -> list[str]:
    """Put boxes under the one they work on; draw what goes down to them and what comes back."""
    middle = onto.x + onto.width / 2
    edge = boxes[0].width / 2 if len(boxes) == 1 else boxes[0].width + 10
    _put_in_row(boxes, middle - edge, 20)
    arrows = []
    for box in boxes:
        box.y = y
        x = min(max(middle, box.x + 16), box.x + box.width - 16)
        arrows += [_arrow(x - 7, onto.y + onto.height, x - 7, y), _arrow(x + 7, y, x + 7, onto.y + onto.height)]
    return arrows


def _arrow(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<path d="M{x1:g} {y1:g}L{x2:g} {y2:g}"/>'


def _svg(boxes: list[_Box], arrows: list[str], name: str) -> str:
    left, right = min(box.x for box in boxes) - 10, max(box.x + box.width for box in boxes) + 10
    height = max(box.y + box.height for box in boxes) + 10
    view = f'viewBox="{left:g} 0 {right - left:g} {height:g}" width="{right - left:g}"'
    shown = f"max-width:100%;min-width:min({right - left:g}px,{LEGIBLE}px);height:auto"
    start = f'<svg xmlns="http://www.w3.org/2000/svg" {view} style="{shown}" role="img"'
    title = f"<title>Block diagram of {escape(name)}</title>"
    drawn = "".join([*arrows, *(box.drawn() for box in boxes)])
    return f"{start}>{title}<style>{_STYLE}</style>{_TIP}{drawn}</svg>"
