"""What is said of measured machines, beside what is known of them: one page, failures first.

    python bench/machines.py --data ../shared/recordings --out results/measured

FOLDER holds machine folders, each with recordings, cards and what is known, and a bench that runs the diagnosis on
every case and marks its answer; where it is missing, this says so and ends. Nothing in the project was set on these
machines. The recordings stay where they are.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from cosim.plots.style import AFTER, BEFORE, GREY, LINE, STYLE
from cosim.support.files import replacing
from cosim.support.version import __version__

WORST_FIRST = ("false", "missed", "refused", "part", "maybe", "honest", "in set", "right")
LINE_OF_BENCH = re.compile(rf"\S+ +(?P<said>.*\S) +(?P<outcome>({'|'.join(WORST_FIRST)})( \+ false)?) +\S+ -> .*")
PICTURE = "machines.png"
INKS = 16
"""Colours of the picture."""


def main() -> int:
    """Run the cases, then write the page."""
    given = arguments()
    bench = given.data / "bench.py"
    if not bench.is_file():
        print(f"skipped: {given.data} holds no bench.py")
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        work = given.work or Path(scratch)
        command = [sys.executable, str(bench), str(given.data), "--out", str(work), "--limit", "300"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        rows = sorted(cases(given.data, work, done.stdout), key=lambda row: rank(row["outcome"]))
        given.out.mkdir(parents=True, exist_ok=True)
        with replacing(given.out / "machines.md", force=True) as path:
            path.write_text(page(rows, sums(done.stdout)), "utf-8")
        with replacing(given.out / PICTURE, force=True) as path:
            draw(rows, path)
    print(sums(done.stdout))
    return 0


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the machines")
    parser.add_argument("--work", type=Path, default=None, help="where answers are kept")
    parser.add_argument("--out", type=Path, required=True)
    return parser.parse_args()


def cases(data: Path, work: Path, table: str) -> Iterator[dict[str, Any]]:
    """Each case: what is known, what is said, how it was marked, errors."""
    lines = {line.split()[0]: line for line in table.splitlines() if line and not line[0].isspace()}
    for file in sorted(data.glob("*/expected.toml")):
        for case in tomllib.loads(file.read_text("utf-8"))["case"]:
            label = f"{file.parent.name}/{case['name']}"
            stored = json.loads((work / (label.replace("/", "__") + ".json")).read_text("utf-8"))
            held = (stored["answer"] or {}).get("heldout", {})
            said, outcome = marked(lines[label])
            yield {"label": label, "known": case["why"], "said": said, "outcome": outcome, "held": held}


def marked(line: str) -> tuple[str, str]:
    """What is said in a case and how that was marked, from its line of the bench."""
    if not (found := LINE_OF_BENCH.fullmatch(line)):
        raise ValueError(f"no line of a case: {line}")
    return found["said"], found["outcome"]


def rank(outcome: str) -> int:
    """Where an outcome stands in the table, what is wrong first."""
    if outcome.endswith("+ false"):
        return 0
    return next((k for k, word in enumerate(WORST_FIRST) if outcome.startswith(word)), len(WORST_FIRST))


def sums(table: str) -> str:
    """The last lines of the bench: counts."""
    return table[table.rindex("\n\n") :].strip()


def page(rows: list[dict[str, Any]], counts: str) -> str:
    """The page as Markdown."""
    body = []
    for row in rows:
        cells = row["label"], row["known"], row["said"].replace("|", " or "), row["outcome"], errors(row["held"])
        body.append(f"| {' | '.join(cells)} |")
    head = "| case | what is known | what is said | marked | held out: base, delivered, noise |\n|---|---|---|---|---|"
    return "\n".join(
        [
            "# Measured machines",
            "",
            f"Version {__version__}. Nothing in the project was set on these recordings, which are not part of it.",
            "Made by `python bench/machines.py --data ../shared/recordings --out results/measured`.",
            "Probabilities stand behind the names; `or` stands between causes that the recordings cannot separate;",
            "what is wrong or missed stands first.",
            "",
            f"![Held-out error of each case over that of its refitted card: as delivered, and the noise]({PICTURE})",
            "",
            head,
            *body,
            "",
            "```",
            counts,
            "```",
            "",
        ]
    )


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Held-out errors over that of the refitted card, in the order of the table: delivered, and the noise."""
    drawn = [row for row in rows if row["held"].get("before_rms")]
    base, delivered, noise = (
        np.array([row["held"][name] for row in drawn]) for name in ("before_rms", "after_rms", "floor_rms")
    )
    places = np.arange(len(drawn))[::-1]
    with mpl.rc_context(STYLE | {"font.size": 10, "ytick.labelsize": 10, "xtick.labelsize": 10}):
        sheet = Figure(figsize=(8, 1 + 0.22 * len(drawn)), dpi=80, layout="constrained")
        axes = sheet.subplots()
        axes.hlines(places, delivered / base, 1, color=LINE)
        axes.plot(np.ones(len(drawn)), places, "s", color=BEFORE, label="refitted card")
        axes.plot(delivered / base, places, "o", color=AFTER, label="delivered")
        axes.plot(noise / base, places, "|", color=GREY, markersize=9, label="noise")
        axes.set_yticks(places, [f"{row['label']}: {row['outcome']}" for row in drawn])
        axes.set(xscale="log", xlabel="held-out error over that of the refitted card")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.legend(loc="upper left", frameon=False)
        drawing = BytesIO()
        sheet.savefig(drawing, format="png")
    with Image.open(drawing) as picture:
        picture.convert("RGB").quantize(INKS, Image.Quantize.MAXCOVERAGE).save(path, "png", optimize=True)


def errors(held: dict[str, Any]) -> str:
    """Held-out errors of base and delivered card, and the noise floor."""
    values = [held.get(name) for name in ("before_rms", "after_rms", "floor_rms")]
    return ", ".join("-" if one is None else f"{one:.3g}" for one in values)


if __name__ == "__main__":
    sys.exit(main())
