"""What mutants.py leaves behind: a journal of what was tried, and the page with rates and survivors."""

import json
from collections.abc import Mapping, Sequence
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


@dataclass(frozen=True)
class Sample:
    """What was drawn: by which seed, and how many mutants."""

    seed: int
    count: int


def journalled(journal: Path) -> list[Tried]:
    """What a journal has, of each mutant what was found last; nothing where there is none."""
    lines = journal.read_text("utf-8").splitlines() if journal.exists() else []
    found = [Tried(**json.loads(one)) for one in lines]
    return list({(one.module, one.site): one for one in found}.values())


def _rate(tried: Sequence[Tried]) -> str:
    """The share that was killed, with Wilson's interval."""
    found = share([bool(one.noticed) for one in tried])
    if found.value is None or found.low is None or found.high is None:
        return "-"
    return f"{found.value:.0%} ({found.low:.0%} to {found.high:.0%})"


def page(tried: Sequence[Tried], planned: int, command: str, remarks: Mapping[str, str]) -> str:
    """The table for people, and the survivors."""
    rows = []
    for name in [*dict.fromkeys(one.group for one in tried), "all"]:
        here = [one for one in tried if name in (one.group, "all")]
        killed = sum(bool(one.noticed) for one in here)
        rows.append(f"| {name} | {len(here)} | {killed} | {len(here) - killed} | {_rate(here)} |")
    late = sum(one.noticed.endswith("(time)") for one in tried)
    head = "What a mutant is and which tests are asked stands at the top of `bench/mutants.py`"
    lines = ["# Small errors planted in the code", "", f"    {command}", "", f"mount-cosim {__version__}. {head}."]
    lines += [
        f"{len(tried)} of {planned} planned, in the order in which they were drawn; {late} of the killed were noticed"
    ]
    lines += ["because a test no longer ended. In brackets: 95 % intervals (Wilson).", ""]
    lines += ["| modules | mutants | killed | survived | rate |", "|---|--:|--:|--:|--:|", *rows, ""]
    lines += ["## Survivors", "", "| module | line | change | what is known of it |", "|---|--:|---|---|"]
    for one in tried:
        if not one.noticed:
            remark = remarks.get(f"{one.module}:{one.line}", "")
            lines.append(f"| {one.module} | {one.line} | `{one.change}` | {remark} |")
    return "\n".join(lines) + "\n"


def written(tried: Sequence[Tried], sample: Sample, out: Path, remarks: Mapping[str, str]) -> None:
    """Write the page; `remarks` say what is known of a survivor, by module and line."""
    asked = f"--seed {sample.seed} --count {sample.count} --reach FILE"
    out.parent.mkdir(parents=True, exist_ok=True)
    with replacing(out, force=True) as partial:
        command = f"python bench/mutants.py {asked} --out results/robustness"
        partial.write_text(page(tried, sample.count, command, remarks), "utf-8")
