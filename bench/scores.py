"""All scores of `results/` in one table: python bench/scores.py writes results/SCORES.md.

Nothing is computed here: value, 95 % interval, bar and whether it is met are what the JSON next to a page holds, with
the commit or the hash of the code, the seed and the command that made them. A speed has no bar and one machine.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cosim_studies.proof.page import met

RESULTS = Path(__file__).parents[1] / "results"
PAGE = RESULTS / "SCORES.md"
SCORED = {
    "proof/README.md": "proof/proof.json",
    "proof/rough.md": "proof/rough.json",
    "proof/baselines.md": "proof/baselines.json",
    "abroad/README.md": "abroad/abroad.json",
    "learned/README.md": "learned/learned.json",
}
"""Pages with scores, and where these stand."""
Document = dict[str, Any]


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), "utf-8")


def page() -> str:
    """The page as the files of `results/` say it."""
    lines = [
        "# Scores",
        "",
        "Written by `python bench/scores.py` from the JSON next to each page, no number by hand. In brackets: 95 %",
        "intervals. *inconclusive*: the bar lies inside the interval. How to rebuild: [README.md](README.md).",
    ]
    for name, file in SCORED.items():
        lines += ["", *section(name, read(file))]
    lines += ["", "## Speeds and counts", "", "Of the machine that each page names; no bar.", ""]
    lines += ["| page | what | value | version | command |", "|---|---|--:|---|---|"]
    for name, what, value, version, command in measured():
        lines.append(f"| [{name}]({name}) | {what} | {value} | {version} | `{command}` |")
    return "\n".join(lines) + "\n"


def read(file: str) -> Document:
    """A JSON file of `results/`."""
    return dict(json.loads((RESULTS / file).read_text("utf-8")))


def section(name: str, document: Document) -> Iterator[str]:
    """The table of one page."""
    commit = f"commit {document['commit']}, " if "commit" in document else ""
    yield f"## [{name}]({name})"
    yield ""
    yield f"    {document['command']}"
    yield ""
    made = f"{commit}code {str(document['code'])[:16]}, seed {document['seed']}, mount-cosim {document['version']}"
    yield f"{made}, {document['played']} cases."
    yield ""
    yield "| | value [95 %] | n | bar | |"
    yield "|---|--:|--:|--:|---|"
    for one in document["scores"]:
        yield f"| {one['title']} | {spanned(one)} | {one['n']} | {one['asked'] or ''} | {met(one)} |"


def spanned(one: Document) -> str:
    """A value with its interval."""
    if one["value"] is None:
        return "-"
    span = "" if one["low"] is None else f" [{one['low']:.2g}, {one['high']:.2g}]"
    return f"{one['value']:.3g}{span}"


def measured() -> Iterator[tuple[str, str, object, str, str]]:
    """Page, what, value, version and command of what has no bar."""
    step, own, sweep = read("master/master_step.json"), read("master/fmu_step.json"), read("master/sweep.json")
    hardware, firmware, sky = (
        read("hardware/hardware.json"),
        read("hardware/firmware.json"),
        read("master/two_axis.json"),
    )
    version = step["versions"]["mount-cosim"]
    for name in ("cosim", "ecospy", "fmpy", "libcosimpy"):
        yield "master/README.md", f"a step in {name}, beside a loop in C", step[name], version, step["command"]
    yield (
        "master/fmu_step.md",
        "an FMU's step beside one by hand",
        own["ratio"],
        own["version"].split()[-1],
        own["command"],
    )
    low, high = sweep["two_over_one"]["spread"]
    rate = f"{sweep['two_over_one']['median']} [{low}, {high}]"
    yield "master/sweep.md", "two cores over one", rate, sweep["versions"]["mount-cosim"], sweep["command"]
    rms = f"{sky['tracking']['on the sky']['rms']:.3g} arcsec"
    yield "master/two_axis.md", "error on the sky, RMS", rms, sky["version"].split()[-1], sky["command"]
    found = f"{hardware['faults']['detected']:.0%} in the worst row"
    made = hardware["version"].split()[-1]
    yield (
        "hardware/README.md",
        "injected faults that are detected",
        found,
        made,
        "python bench/hardware.py --out results/hardware",
    )
    same = f"{sum(bool(one['equal']) for one in firmware['rows'])} of {len(firmware['rows'])}"
    yield (
        "hardware/firmware.md",
        "controllers whose firmware has the FMU's bits",
        same,
        firmware["version"].split()[-1],
        firmware["command"],
    )


if __name__ == "__main__":
    main()
