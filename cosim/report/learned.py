"""What has no name: what was learned of it, or why nothing was; each table with what recordings say beside it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.diagnosis.answer.entries import FormulaEntry, TableEntry
from cosim.diagnosis.answer.result import Array, Diagnosis
from cosim.plots.quantities import Scale, decimals, joined, labelled, minus, raised
from cosim.plots.style import AFTER, GREY, MEASURED, Style
from cosim.report.figures_where import cells
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture, Sheet, heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEIGHT = 232


@dataclass(frozen=True)
class Nameless:
    """The section: sentences, rows of what and how much, pictures of the tables."""

    sentences: tuple[str, ...]
    rows: tuple[tuple[str, str], ...] = ()
    pictures: tuple[Picture, ...] = ()


def nameless(diagnosis: Diagnosis, scales: Scales) -> Nameless | None:
    """Return the section; None where the verdict leaves nothing without a name."""
    if diagnosis.learned:
        tables = diagnosis.learned["table"]
        pictures = (_picture(k, table, scales) for k, table in enumerate(tables) if table.get("data"))
        quantities = " and on ".join(diagnosis.learned["quantities"])
        what = (
            f"The rest depends on {quantities}. What makes it is not known, so it is modelled as a table learned from "
            "the training recordings: part of the improved model, and constant beyond the range of these recordings."
        )
        return Nameless((what,), tuple(_rows(diagnosis, scales)), tuple(pictures))
    said = diagnosis.not_learned.get("statement", "")
    return Nameless((str(said),)) if said else None


def _rows(diagnosis: Diagnosis, scales: Scales) -> Iterator[tuple[str, str]]:
    told, unit = diagnosis.learned, scales.torque
    yield "Depends on", ", ".join(told["quantities"])
    yield "Size", f"{unit.text(told['size'])} (half its range)"
    low, high = told["interval"]
    band = f"below {told['cutoff_hz']:.3g} Hz"
    change = f"{unit.number(told['before'])} → {unit.text(told['after'])}"
    yield "Validation runs", f"error {change}, less by {unit.span(low, high)} (95 %), {band}"
    for one in told.get("formula", ()):
        yield "Formula", f"{one['equation']}; {_numbers_of(one)}. As good on validation runs; proposed, in no model."
    yield "Range of the data", minus("; ".join(told["range"])).replace(" degC", " °C").replace("N.m", "N·m")


def _numbers_of(formula: FormulaEntry) -> str:
    """The numbers of a formula with their 95 % ranges."""
    said = []
    for name, one in formula["parameters"].items():
        value, low, high = decimals((one["value"], *one["interval"]), 3)
        unit = "" if one["unit"] == "1" else raised(one["unit"])
        said.append(f"{name} {joined(value, unit)} ({low} to {high})")
    return ", ".join(said)


def _picture(number: int, table: TableEntry, scales: Scales) -> Picture:
    """Draw one table: a curve over one quantity, a map over two, and of a memory how well it says what is missing."""
    sheet, name = Sheet(f"learned-{number}", HEIGHT, plate="by" in table), _title(table)
    caption = _maps(sheet, table, scales) if "by" in table else _curve(sheet.axes(), table, scales)
    return sheet.picture(f"{name}. {caption}", caption, name)


def _title(table: TableEntry) -> str:
    over = str(table.get("over", "command" if table["kind"] == "drive" else ""))
    places = " and ".join(filter(None, (over, str(table.get("by", "")))))
    return f"{table['kind'].capitalize()} over {places}" if places else table["kind"].capitalize()


def _curve(axes: "Axes", table: TableEntry, scales: Scales) -> str:
    data, shown, unit = table["data"], _value_unit(table, scales), _place_unit(table, scales)
    at, value, band = (_numbers(one) for one in (data["at"], data["value"], data["band"]))
    style: Style = {"ls": "", "marker": "o", "ms": 4, "color": MEASURED, "elinewidth": 1}
    axes.errorbar(at * unit.factor, value * shown.factor, yerr=band * shown.factor * np.isfinite(value), **style)
    known = len(where := table.get("at") or table.get("command") or ()) > 0
    x, y = (np.array(where), np.array(table.get("value") or table["missing"])) if known else (at, at)
    axes.plot(x * unit.factor, y * shown.factor, color=AFTER, lw=2)
    axes.axhline(0, color=GREY, lw=0.8, zorder=1)
    axes.locator_params(axis="y", nbins=5)
    axes.set_xlabel(
        labelled(str(table.get("over", "command" if "command" in table else "what the term says")), unit.unit)
    )
    heading(axes, labelled(table["kind"] if table["kind"] != "drive" else "not delivered", shown.unit))
    line = "the table" if known else "as the term says"
    return f"Dots: mean of what training recordings leave without it, 95 % bars. Line: {line}."


def _maps(sheet: Sheet, table: TableEntry, scales: Scales) -> str:
    """Draw the table above and what recordings say below, on one scale."""
    data, unit = table["data"], _place_unit(table, scales)
    seen = _numbers(data["value"])
    at, by = np.array(data["at"]), np.array(data["by_at"])
    model = _looked_up(table, at, by)
    top = float(np.nanmax(np.abs(np.concatenate([model.ravel(), seen.ravel()])))) or 1.0
    for place, (grid, said) in enumerate(((model, "table"), (seen, "data"))):
        axes = sheet.axes(left=44 + 156 * place, right=10 + 156 * (1 - place))
        cells(axes, grid.T / top, _edges(at * unit.factor), _edges(by), AFTER, 0.3)
        axes.locator_params(axis="x", nbins=4)
        axes.set_xlabel(labelled(str(table["over"]), unit.unit))
        axes.annotate(said, (1, 1), (0, 12), xycoords="axes fraction", textcoords="offset points", ha="right")
        if place:
            axes.set_yticklabels([])
        else:
            heading(axes, labelled(str(table["by"]), _unit_of(str(table["by"]), scales).unit))
    darkest = _value_unit(table, scales).text(top)
    return (
        f"Left the table, right the mean of what training recordings leave without it; marked + and −, "
        f"darkest {darkest}. Hatched: never visited."
    )


def _looked_up(table: TableEntry, at: Array, by: Array) -> Array:
    """The table at the centres of the data's cells, (at, by_at)."""
    value, over, other = (_numbers(one) for one in (table["value"], table["at"], table["by_at"]))
    along = np.array([np.interp(at, over, column) for column in value.T])
    return np.array([np.interp(by, other, row) for row in along.T])


def _edges(centres: Array) -> Array:
    half = 0.5 * float(centres[1] - centres[0])
    return np.append(centres - half, centres[-1] + half)


def _numbers(values: Any) -> Array:
    return np.array(values, dtype=float)


def _value_unit(table: TableEntry, scales: Scales) -> Scale:
    return Scale(100.0, "%") if table["unit"] == "1" else scales.torque


def _place_unit(table: TableEntry, scales: Scales) -> Scale:
    return _unit_of(str(table.get("over", "")), scales)


def _unit_of(over: str, scales: Scales) -> Scale:
    known = {"position": scales.position, "speed": scales.speed, "position over the turn": Scale(180 / np.pi, "°")}
    known |= {"temperature": Scale(1.0, "°C"), "": scales.torque}
    return known.get(over, Scale(1.0, ""))
