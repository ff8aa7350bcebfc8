"""The gallery of machines in the documentation: what cosim says of each, with a picture and where the data are from.

    python bench/gallery.py --data ../shared/recordings --out docs

Pictures are drawn from recordings whose licence allows it; where a licence is not clear, recordings are generated from
published numbers. No recording enters the project. FOLDER is that of bench/machines.py; without it this ends.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parent))
from gallery_machines import MACHINES, Shown

import cosim
from cosim.diagnosis.answer.result import Diagnosis
from cosim.plots.quantities import joined
from cosim.plots.style import AFTER, BEFORE, GREY, MEASURED, STYLE
from cosim.report.lead import heading
from cosim.report.quantities import Scales
from cosim.report.words import blocks, lowered, sized

POINTS, BINS, DPI, COLUMNS = 1500, 180, 96, 3
TURN = 2 * np.pi
"""Motors that turn on and on are drawn over one turn."""
SECONDS = 3.0
"""Length of the stretch that a picture shows: the one where the first model is worst."""


@dataclass(frozen=True)
class Drawn:
    """A machine with what was said of it."""

    machine: Shown
    found: Diagnosis


def main() -> int:
    """Diagnose each machine, draw it, write the page."""
    given = arguments()
    if not given.data.is_dir():
        print(f"skipped: there is no folder {given.data}")
        return 0
    pictures = given.out / "machines"
    pictures.mkdir(parents=True, exist_ok=True)
    drawn = []
    for machine in MACHINES if not given.only else [one for one in MACHINES if one.id in given.only]:
        drawn.append(Drawn(machine, diagnosed(machine, given.data)))
        draw(drawn[-1], pictures / f"{machine.id}.png")
        print(machine.title, "|", heading(drawn[-1].found), flush=True)
    (given.out / "machines.md").write_text(page(drawn), "utf-8")
    return 0


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the machines")
    parser.add_argument(
        "--only", nargs="*", default=[], help="ids of machines to draw anew; the page holds these alone"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the page")
    return parser.parse_args()


def diagnosed(machine: Shown, data: Path) -> Diagnosis:
    """What is said of a machine, by the public call with files."""
    given = machine.load(data)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        paths = [
            [_written(folder / f"{name}.parquet", table) for name, table in one.items()] for one in given.recordings
        ]
        card = folder / f"{machine.id}.toml"
        card.write_text(given.card, "utf-8")
        columns, units = (dict(part.split("=") for part in parts) for parts in (given.columns, given.units))
        answer = cosim.diagnose(paths[0], paths[1], card, columns=columns, units=units, quick=True)
    return answer.diagnosis


def _written(path: Path, table: Any) -> Path:
    table.to_parquet(path, index=False)
    return path


def draw(drawn: Drawn, path: Path) -> None:
    """Draw the torque of the worst seconds, and the error over what the missing physics depends on."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    found, scales = drawn.found, Scales.of(drawn.found)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.6, 3.3), layout="constrained", dpi=DPI)
        left, right = figure.subplots(1, 2)
        _over_time(left, found, scales)
        _over(right, found, scales, drawn.machine.over)
        figure.savefig(path, metadata={"Software": None})
    from PIL import Image

    with Image.open(path) as drawn:
        drawn.convert("RGB").quantize(64).save(path, optimize=True)


def _over_time(axes: Any, found: Diagnosis, scales: Scales) -> None:
    trace = next(one for one in found.traces if one.heldout)
    factor, rows = scales.torque.factor, min(trace.t.size, max(round(SECONDS / np.median(np.diff(trace.t))), 50))
    square = np.cumsum(np.nan_to_num(trace.missing) ** 2)
    first = int(np.argmax(square[rows - 1 :] - np.append(0.0, square[:-rows]))) if rows < trace.t.size else 0
    part = slice(first, first + rows)
    t = trace.t[part] - trace.t[part][0]
    axes.plot(t, trace.tau[part] * factor, color=MEASURED, lw=1.4, label="measured")
    axes.plot(t, trace.before[part] * factor, color=BEFORE, lw=1.4, ls="--", label="card, refitted")
    axes.plot(t, trace.after[part] * factor, color=AFTER, lw=1.4, label="improved")
    axes.set(xlabel="time [s]", ylabel=f"{_noun(found)} [{scales.torque.unit}]")
    axes.legend(frameon=False, fontsize=9.5, loc="upper center", ncols=3, bbox_to_anchor=(0.5, 1.13))


def _over(axes: Any, found: Diagnosis, scales: Scales, over: str) -> None:
    scale = scales.position if over == "position" else scales.speed
    held = [one for one in found.traces if one.heldout]
    x = np.concatenate([one.q if over == "position" else one.v for one in held])
    x = scale.factor * (np.mod(x, TURN) if over == "position" and np.ptp(x) > 2 * TURN else x)
    for values, colour in (
        (np.concatenate([one.missing for one in held]), BEFORE),
        (np.concatenate([one.tau - one.after for one in held]), AFTER),
    ):
        y = values * scales.torque.factor
        step = max(1, x.size // POINTS)
        axes.plot(x[::step], y[::step], ".", ms=2, alpha=0.35, color=colour, mew=0)
        axes.plot(*_means(x, y), color=colour, lw=1.6)
    axes.axhline(0, color=GREY, lw=0.8)
    axes.set(xlabel=f"{over} [{scale.unit}]", ylabel=f"error [{scales.torque.unit}]")


def _means(x: Any, y: Any) -> tuple[Any, Any]:
    """Means in equal steps; of too few samples none."""
    edges = np.linspace(*np.nanquantile(x, [0.002, 0.998]), BINS + 1)
    place, good = np.digitize(x, edges) - 1, np.isfinite(x) & np.isfinite(y)
    means = [np.mean(y[good & (place == k)]) if np.sum(good & (place == k)) > 4 else np.nan for k in range(BINS)]
    return 0.5 * (edges[1:] + edges[:-1]), np.array(means)


def _noun(found: Diagnosis) -> str:
    return "torque" if found.motion == "rotary" else "force"


def page(drawn: Sequence[Drawn]) -> str:
    """The page as Markdown: small pictures, then a section a machine."""
    cells = [
        f"[![{one.machine.title}](machines/{one.machine.id}.png) {one.machine.title}](#{one.machine.id})"
        for one in drawn
    ]
    cells += [""] * (-len(cells) % COLUMNS)
    rows = [" | ".join(cells[k : k + COLUMNS]) for k in range(0, len(cells), COLUMNS)]
    table = [f"| {rows[0]} |", f"|{'---|' * COLUMNS}", *(f"| {row} |" for row in rows[1:])]
    return "\n".join([INTRODUCTION, *table, "", *(section(one) for one in drawn)])


INTRODUCTION = """# Gallery of machines

What cosim says of measured machines that nothing in it was set on. Left the worst seconds of a validation recording,
right its error over position or speed, points and means: orange with the refitted card, blue with the improved one.
Pictures only: the recordings are not part of the project. Where the licence of a recording is not clear, the picture is
of data *generated* from published numbers, and says so.
Made by `python bench/gallery.py --data ../shared/recordings --out docs`; more machines, with what is wrong first:
[results](../results/measured/machines.md).
"""


def section(drawn: Drawn) -> str:
    """What is known of a machine, what is said of it, by how much the error falls, where the data are from."""
    found, machine, scales = drawn.found, drawn.machine, Scales.of(drawn.found)
    held, unit = found.heldout, scales.torque
    before, noise = (unit.number(value) for value in (held.before_rms, held.floor_rms))
    after = joined(unit.number(held.after_rms), unit.unit)
    shown = [block for block in blocks(found) if block.answer in ("found", "ambiguous")]
    rows = [f"- *{block.word}:* {lowered(block.title)}{_size(block.first)}" for block in shown]
    kind = "Generated from published numbers" if machine.generated else "Measured"
    return "\n".join(
        [
            f"({machine.id})=",
            f"## {machine.title}",
            "",
            f"**{heading(found)}**",
            "",
            f"![Torque and error of this machine with both models](machines/{machine.id}.png)",
            "",
            *rows,
            f"- *Validation error:* {before} (refitted card), {after} (improved), noise floor {noise}",
            f"- *Known of it:* {machine.known}",
            "",
            f"*{kind}.* {machine.source}",
            "",
        ]
    )


def _size(finding: Any) -> str:
    size, size_range = sized(finding)
    sure = f"probability {finding.probability:.2f}"
    return f", {size}{f' ({size_range})' if size_range else ''}, {sure}" if size else f", {sure}"


if __name__ == "__main__":
    sys.exit(main())
