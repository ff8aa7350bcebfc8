"""The two figures that decide: the error on runs the fit never saw, and the size of everything looked for."""

import re
from typing import TYPE_CHECKING

from cosim.diagnosis.answer.result import Diagnosis, Finding, Part
from cosim.plots.style import AFTER, BEFORE, GREY, MEASURED, SHADE, Style
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROW = 25
WORD = 0.55
"""Share of the axis that "no clear change" takes."""
LEAST, MOST = 0.1, 30.0


def proof(diagnosis: Diagnosis, rows: tuple[Part, ...], scales: Scales) -> Picture:
    """Draw RMS per part of the held-out runs: hollow square before, dot after, noise as a grey band."""
    sheet = Sheet("proof", 78 + ROW * len(rows))
    axes = sheet.axes(left=112, right=12, top=24, bottom=44)
    factor, unit = scales.torque.factor, scales.torque.unit
    noise = diagnosis.heldout.floor_rms * factor
    axes.axvspan(0, noise, color=SHADE, lw=0)
    axes.annotate(f"noise {scales.torque.number(diagnosis.heldout.floor_rms)}", (noise, 1), (0, 5), **_OVER, ha="right")
    axes.set_xlim(0, _right(rows, noise, factor))
    for place, row in enumerate(rows):
        _pair(axes, place, row, factor)
    _rows(axes, [_short(row.label) for row in rows])
    axes.set_xlabel(f"RMS {scales.noun} error [{unit}]")
    return sheet.picture(proof_words(rows), proof_words(rows))


_OVER: Style = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "color": GREY}


def _pair(axes: "Axes", place: int, row: Part, factor: float) -> None:
    before, after = row.before * factor, row.after * factor
    axes.plot([before, after], [place, place], color=GREY, lw=1.2, zorder=2)
    axes.plot(before, place, "s", ms=8, mfc="white", mec=BEFORE, mew=1.8, zorder=3)
    if before == after:
        return
    axes.plot(after, place, "o", ms=8, color=AFTER, mew=0, zorder=4)
    if row.change != "better":
        left = min(before, after) > WORD * axes.get_xlim()[1]
        at, shift, align = (min(before, after), -9, "right") if left else (max(before, after), 9, "left")
        axes.annotate(row.change, (at, place), (shift, -4), textcoords="offset points", ha=align, weight="bold")


def _right(rows: tuple[Part, ...], noise: float, factor: float) -> float:
    """Return the end of the axis: room for every mark, and for its word where there is none to the left."""
    high = [max(row.before, row.after) * factor for row in rows]
    end = max([1.12 * value for value in high] + [1.2 * noise], default=1.0)
    low = [min(row.before, row.after) * factor for row in rows]
    words = [b for a, b, row in zip(low, high, rows, strict=True) if row.change != "better" and a < WORD * end]
    return max([end, *(value / (1 - WORD) for value in words if rows[0].before != rows[0].after)])


def _rows(axes: "Axes", labels: list[str]) -> None:
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_yticks(range(len(labels)), labels, color=MEASURED)
    axes.grid(axis="x")
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)


def _short(text: str, most: int = 18) -> str:
    return text if len(text) <= most else text[: most - 1] + "…"


def proof_words(rows: tuple[Part, ...]) -> str:
    """Say in words which rows got better, which did not change and which got worse."""
    if all(row.before == row.after for row in rows):
        return "Nothing was added to the model. Grey: the noise."
    better = sum(row.change == "better" for row in rows)
    words = [f"Clearly better in {better} of {len(rows)} rows."]
    for change, text in (("no clear change", "No clear change: {}."), ("worse", "Worse: {}.")):
        names = [row.label for row in rows if row.change == change]
        words += [text.format(", ".join(names))] if names else []
    return " ".join(words)


def looked_for(findings: tuple[Finding, ...], groups: tuple[tuple[str, ...], ...]) -> Picture | None:
    """Draw size over the smallest visible size, a row for each effect that has both; None without any."""
    sized = tuple(finding for finding in findings if relative(finding)[0] is not None)
    if not sized:
        return None
    sheet = Sheet("looked", 74 + 26 * len(sized))
    axes = sheet.axes(left=150, right=10, top=24, bottom=46)
    axes.set_xscale("log")
    axes.set_xlim(LEAST, MOST)
    axes.axvspan(LEAST, 1, color=SHADE, lw=0)
    axes.axvline(1, color=GREY, lw=1.2, dashes=(2, 2))
    axes.annotate("smallest visible size", (1, 1), (0, 6), **_OVER, ha="center")
    for place, finding in enumerate(sized):
        _sized(axes, place, finding)
    _rows(axes, [_short(finding.title, 21) for finding in sized])
    _either(axes, sized, groups)
    axes.set_xticks([0.1, 1, 10], ["0.1×", "1×", "10×"])
    axes.minorticks_off()
    axes.set_xlabel("size ÷ smallest size that shows")
    caption = "Right of the dashed line: large enough for these recordings to show. Dots: found; rings: not sure."
    return sheet.picture("Size of what was found, or may be there. " + caption, caption)


def _sized(axes: "Axes", place: int, finding: Finding) -> None:
    size, low, high = relative(finding)
    axes.plot([_inside(low), _inside(high)], [place, place], color=MEASURED, lw=1.6)
    found = finding.answer == "found"
    axes.plot(_inside(size or 0), place, "o", ms=8, mfc=AFTER if found else "white", mec=AFTER if found else MEASURED)


def _inside(value: float) -> float:
    return min(max(value, LEAST * 1.1), MOST / 1.15)


def relative(finding: Finding) -> tuple[float | None, float, float]:
    """Return size and 95 % range in units of the smallest visible size; None where either is not known."""
    sizes, ends = _numbers(finding.size), _numbers(finding.size_range)
    if not sizes or not finding.visible_from:
        return None, 0.0, 0.0
    size, unit = abs(sizes[0]), abs(finding.visible_from)
    low, high = sorted(abs(end) for end in ends[:2]) if len(ends) >= 2 else (size, size)
    crosses = len(ends) >= 2 and ends[0] * ends[1] < 0
    return size / unit, 0.0 if crosses else low / unit, high / unit


def _numbers(text: str) -> list[float]:
    plain = text.replace("−", "-").replace(",", "")
    return [float(found) for found in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?", plain)]


def _either(axes: "Axes", findings: tuple[Finding, ...], groups: tuple[tuple[str, ...], ...]) -> None:
    for group in groups:
        rows = [place for place, finding in enumerate(findings) if finding.name in group]
        if len(rows) < 2:
            continue
        axes.plot([19, 22, 22, 19], [rows[0], rows[0], rows[-1], rows[-1]], color=MEASURED, lw=1)
        axes.annotate("either", (17, sum(rows) / len(rows)), (0, -4), textcoords="offset points", ha="right")
