"""One page of pictures of a run: self-contained HTML without network; its one script is the explorer.

For each axis in the recording (see `digest`): set point, error, torque, speed and friction over time, friction over
speed, spectrum of the error; then every other column over time, a table of all, and what the run was.
"""

import json
from collections.abc import Iterator, Mapping
from html import escape
from importlib.resources import files
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.columns import ORIGIN_KEY
from cosim.plots.chart import Chart
from cosim.plots.digest import ERROR, Axis, Digest, Line, digest, in_words
from cosim.plots.quantities import Scale, joined, labelled, number, scale_of
from cosim.plots.run_explorer import explorer, policy
from cosim.plots.style import AFTER, BEFORE, MEASURED
from cosim.support.files import replacing
from cosim.system.diagram import draw as diagram
from cosim.system.scenario import Scenario

SIZE = (360, 220)
"""px; the width of a phone, so that texts keep their size there."""
TITLES = {"tau": "torque", "v": "speed", "friction": "friction"}
Facts = Mapping[str, Any]


def write_page(path: Path, recording: Path, scenario: Scenario, statistics: Facts, force: bool = False) -> Path:
    """Write the page of a run whose recording is in a file; returns its path.

    Raises:
        OutputError: the page exists and `force` is not set.
    """
    origin = _origin(recording)
    small = digest(recording)
    closer, more, script = explorer(recording, small)
    parts = [
        *_head(scenario, small, statistics, origin),
        *_pictures(small),
        closer,
        *_foot(scenario, statistics, origin),
    ]
    style = more + (files("cosim") / "plots" / "run_page.css").read_text("utf-8")
    rules = '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    rules += (policy(script) if script else "") + f"<style>{style}</style>"
    title = f"<title>{escape(scenario.name)}</title>"
    with replacing(path, force) as partial:
        text = f'<!doctype html><html lang="en">{rules}{title}<body><main>{"".join(parts)}</main></body></html>\n'
        partial.write_text(text, "utf-8")
    return path


def _origin(recording: Path) -> Facts:
    from pyarrow import parquet

    found: Facts = json.loads(parquet.read_metadata(recording).metadata[ORIGIN_KEY])
    return found


def _head(scenario: Scenario, small: Digest, statistics: Facts, origin: Facts) -> Iterator[str]:
    yield f"<h1>{escape(scenario.name)}</h1><p>{escape(scenario.description)}</p>"
    yield f'<p class="quiet">{escape(str(origin.get("command", "")))} · {escape(str(origin["version"]))}</p>'
    shown = "".join(f"<span><b>{value}</b>{escape(name)}</span>" for value, name in _facts(small, statistics))
    yield f'<div class="facts">{shown}</div><p class="quiet">{_speed(scenario, statistics)}</p>'
    idle = statistics["unconnected"]
    notes = [*statistics["notes"], *([f"Not connected, at their start: {', '.join(idle)}."] if idle else [])]
    yield "".join(f'<p class="quiet">{escape(note)}</p>' for note in notes)


def _facts(small: Digest, statistics: Facts) -> Iterator[tuple[str, str]]:
    """What the run showed, as (value, name): how well each axis followed its set point, and the largest torque."""
    for axis in small.axes:
        before = f"{axis.name.replace('_', ' ')}: " if axis.name else ""
        if axis.error:
            scale, _ = _largest(small.lines[axis.error])
            rms = sqrt(small.lines[axis.error].squares / small.rows)
            yield joined(number(rms * scale.factor, 3), scale.unit), f"{before}RMS tracking error"
        for role, name in ((axis.error, "largest error"), (axis.columns.get("tau", ""), "largest torque")):
            if role:
                yield _largest(small.lines[role])[1], f"{before}{name}"
    yield f"{statistics['simulated_seconds']:,.6g} s", "simulated"


def _largest(line: Line) -> tuple[Scale, str]:
    """The scale of a column, and its largest value by size."""
    scale = _scale(line)
    return scale, joined(number(max(map(abs, line.span)) * scale.factor, 3), scale.unit)


def _speed(scenario: Scenario, statistics: Facts) -> str:
    """How fast it was computed."""
    warned = f"{statistics['warnings']:,} warnings" if statistics["warnings"] else "no warnings"
    return (
        f"{statistics['steps']:,} steps of {scenario.step * 1e3:g} ms, computed in {statistics['seconds']:.3g} s: "
        f"{statistics['ratio_to_real_time']:,.3g} times real time, {statistics['microseconds_per_step']:.3g} µs a step "
        f"with recording; {warned}."
    )


def _pictures(small: Digest) -> Iterator[str]:
    for axis in small.axes:
        if axis.name:
            yield f"<h2>{escape(axis.name.replace('_', ' '))}</h2>"
        yield _grid(list(_of_axis(small, axis)))
    if small.others:
        yield "<h2>Also recorded</h2>" if small.axes else ""
        yield _grid([_over_time(small, name, name) for name in small.others])
    yield "<h2>All columns</h2>" + _table(small)


def _grid(charts: list[str]) -> str:
    return f'<div class="charts">{"".join(charts)}</div>'


def _of_axis(small: Digest, axis: Axis) -> Iterator[str]:
    columns = axis.columns
    if "q_d" in columns:
        yield _over_time(small, columns["q_d"], "set point")
    elif axis.measured:
        yield _over_time(small, axis.measured, "position")
    if axis.error:
        yield _over_time(small, axis.error, "error", BEFORE)
    yield from (_over_time(small, columns[role], title) for role, title in TITLES.items() if role in columns)
    if "v" in columns and "friction" in columns:
        yield _friction_over_speed(small, columns["v"], columns["friction"])
    if axis.error in small.spectra:
        yield _spectrum(small, axis.error)


def _over_time(small: Digest, name: str, title: str, colour: str = AFTER) -> str:
    line = small.lines[name]
    scale = _scale(line)
    chart = Chart.over(labelled(title, scale.unit), "time [s]", (small.start, small.end), _shown(line, scale), SIZE)
    middle = small.start + (small.end - small.start) * (np.arange(len(line.low)) + 0.5) / len(line.low)
    chart.band(middle, line.low * scale.factor, line.high * scale.factor, colour)
    return chart.svg()


def _friction_over_speed(small: Digest, speed: str, friction: str) -> str:
    v, f = small.lines[speed], small.lines[friction]
    across, up = _scale(v), _scale(f)
    low, high = _shown(v, across)
    room = 0.03 * (high - low) or 1.0
    title, below = labelled("friction over speed", up.unit), f"speed [{across.unit}]"
    chart = Chart.over(title, below, (low - room, high + room), _shown(f, up), SIZE)
    chart.line(v.dots * across.factor, f.dots * up.factor, MEASURED, 0.9)
    return chart.svg()


def _spectrum(small: Digest, name: str) -> str:
    frequency, density = small.spectra[name]
    scale = _scale(small.lines[name])
    density = density * scale.factor
    top = float(density.max())
    if top <= 0:
        return ""
    least = max(float(density.min()), 1e-9 * top)
    heights = (10.0 ** np.floor(np.log10(least)), 10.0 ** np.ceil(np.log10(top)))
    title = f"spectrum of the error [{scale.unit or '1'}/√Hz]"
    chart = Chart.over(title, "frequency [Hz]", (frequency[0], frequency[-1]), heights, SIZE, log=True)
    chart.line(frequency, np.maximum(density, least), BEFORE)
    return chart.svg()


def _scale(line: Line) -> Scale:
    scale = scale_of(line.unit, max(map(abs, line.span)))
    return Scale(scale.factor, in_words(scale.unit))


def _shown(line: Line, scale: Scale) -> tuple[float, float]:
    low, high = line.span
    return low * scale.factor, high * scale.factor


def _table(small: Digest) -> str:
    made = {axis.error for axis in small.axes if ERROR not in axis.columns}
    rows = []
    for name, line in small.lines.items():
        scale = _scale(line)
        values = (*line.span, line.total / small.rows, sqrt(line.squares / small.rows))
        cells = "".join(f'<td class="n">{number(value * scale.factor, 4)}</td>' for value in values)
        note = " (set point minus position)" if name in made else ""
        rows.append(f"<tr><td>{escape(name)}{note}</td><td>{escape(scale.unit)}</td>{cells}</tr>")
    head = "".join(f'<th class="n">{name}</th>' for name in ("smallest", "largest", "mean", "RMS"))
    table = f"<table><tr><th>column</th><th>unit</th>{head}</tr>{''.join(rows)}</table>"
    return _wide("All columns", table)


def _wide(label: str, inside: str) -> str:
    """Return what scrolls sideways where it must, also by keyboard."""
    return f'<div class="wide" tabindex="0" role="region" aria-label="{label}">{inside}</div>'


def _foot(scenario: Scenario, statistics: Facts, origin: Facts) -> Iterator[str]:
    rows = [
        f"<tr><td>{escape(name)}</td><td>{escape(_source(one))}</td><td>{escape(_set(one))}</td></tr>"
        for name, one in origin.get("components", {}).items()
    ]
    head = "<tr><th>component</th><th>from</th><th>parameters set</th></tr>"
    table = f"<table>{head}{''.join(rows)}</table>"
    yield f"<h2>What ran</h2>{_wide('What ran, part by part', table)}"
    how = f"{statistics['algorithm']}, {statistics['loop']} loop"
    every = int(origin["decimation"])
    told = f"{how}; {statistics['rows']:,} rows, one {'each step' if every == 1 else f'in {every:,} steps'}"
    yield f'<p class="quiet">{escape(told)}.</p>'
    drawing = "\n".join(diagram(scenario))
    yield f"<details open><summary>Wiring, with delays</summary>{_text('Wiring', drawing)}</details>"
    yield f"<details><summary>The scenario</summary>{_text('The scenario', scenario.text)}</details>"


def _text(label: str, text: str) -> str:
    return f'<pre tabindex="0" role="region" aria-label="{label}, as text">{escape(text)}</pre>'


def _source(one: Facts) -> str:
    file = one.get("file") or one.get("function", "")
    made = f", {one['tool']}" if one.get("tool") else ""
    kind = f" (FMI {one['fmi']}{made})" if one.get("fmi") else ""
    return f"{file}{kind}, sha256 {str(one.get('sha256', ''))[:12]}"


def _set(one: Facts) -> str:
    return ", ".join(f"{name} = {value}" for name, value in one.get("parameters", {}).items()) or "none"
