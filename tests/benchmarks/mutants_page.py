"""What mutants.py leaves behind: a journal of what was tried, and the page with rates and survivors."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.support.files import replacing
from cosim.support.version import __version__
from cosim_studies.proof.intervals import share


@dataclass(frozen=True)
class Tried:
    """A mutant: its group, module, place in the list of its sites, line, what was changed, and who noticed."""

    group: str
    module: str
    site: int
    line: int
    change: str
    noticed: str


def journalled(journal: Path) -> list[Tried]:
    """What a journal has; nothing where there is none."""
    return [Tried(**json.loads(one)) for one in journal.read_text("utf-8").splitlines()] if journal.exists() else []


def _rate(tried: Sequence[Tried]) -> str:
    """The share that was killed, with Wilson's interval."""
    found = share([bool(one.noticed) for one in tried])
    if found.value is None or found.low is None or found.high is None:
        return "-"
    return f"{found.value:.0%} ({found.low:.0%} to {found.high:.0%})"


def page(tried: Sequence[Tried], planned: int, command: str) -> str:
    """The table for people, and the survivors."""
    rows = []
    for name in [*dict.fromkeys(one.group for one in tried), "all"]:
        here = [one for one in tried if name in (one.group, "all")]
        killed = sum(bool(one.noticed) for one in here)
        rows.append(f"| {name} | {len(here)} | {killed} | {len(here) - killed} | {_rate(here)} |")
    late = sum(one.noticed.endswith("(time)") for one in tried)
    head = "What a mutant is and which tests are asked stands at the top of `tests/benchmarks/mutants.py`"
    lines = ["# Small errors planted in the code", "", f"    {command}", "", f"mount-cosim {__version__}. {head}."]
    lines += [
        f"{len(tried)} of {planned} planned, in the order in which they were drawn; {late} of the killed were noticed"
    ]
    lines += ["because a test no longer ended. In brackets: 95 % intervals (Wilson).", ""]
    lines += ["| modules | mutants | killed | survived | rate |", "|---|--:|--:|--:|--:|", *rows, ""]
    lines += ["## Survivors", "", "| module | line | change |", "|---|--:|---|"]
    lines += [f"| {one.module} | {one.line} | `{one.change}` |" for one in tried if not one.noticed]
    return "\n".join(lines) + "\n"


def written(tried: Sequence[Tried], seed: int, count: int, out: Path) -> None:
    """Write the page."""
    asked = f"--seed {seed} --count {count} --reach FILE"
    out.mkdir(parents=True, exist_ok=True)
    with replacing(out / "README.md", force=True) as partial:
        text = page(tried, count, f"python tests/benchmarks/mutants.py {asked} --out results/mutants")
        partial.write_text(text, "utf-8")
