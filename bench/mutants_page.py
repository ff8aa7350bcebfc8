"""What mutants.py leaves behind: a journal of what was tried, and the page with rates and survivors."""

import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.support.files import replacing
from cosim.support.version import __version__
from cosim_studies.proof.intervals import share


@dataclass(frozen=True)
class Tried:
    """A mutant: its group, module, place in the list of its sites, line, kind, change, who noticed, and seconds."""

    group: str
    module: str
    site: int
    line: int
    kind: str
    change: str
    noticed: str
    seconds: float = 0.0


@dataclass(frozen=True)
class Sample:
    """What was drawn: by which seed, how many mutants, and seconds of tests that each was given."""

    seed: int
    count: int
    seconds: float


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


def page(tried: Sequence[Tried], sample: Sample, command: str, remarks: Mapping[str, str]) -> str:
    """The table for people, and the survivors."""
    late = sum(one.noticed.endswith("(time)") for one in tried)
    lines = ["# Small errors planted in the code", "", f"    {command}", ""]
    lines += [f"mount-cosim {__version__}, {commit()}. What is planted and which tests are asked: `bench/mutants.py`."]
    lines += [
        f"{len(tried)} of {sample.count} planned, in the order in which they were drawn, "
        f"{sample.seconds:g} s of tests each;"
    ]
    lines += [f"{late} of the noticed because a test no longer ended. In brackets: 95 % intervals (Wilson)."]
    lines += [remarks["sample"]] if "sample" in remarks else []
    lines += [
        "What is equivalent counts as survived, as does what only a test notices that was written after the draw; so",
        "the rate is a lower bound of what the whole suite notices, which is asked in that time in part.",
        "",
    ]
    lines += ["| room | errors | noticed | survived | rate |", "|---|--:|--:|--:|--:|", *_rows(tried, "group"), ""]
    lines += ["| kind | errors | noticed | survived | rate |", "|---|--:|--:|--:|--:|", *_rows(tried, "kind"), ""]
    lines += ["## Survivors", "", "| module | line | kind | change | what is known of it |", "|---|--:|---|---|---|"]
    for one in tried:
        if not one.noticed:
            remark = remarks.get(f"{one.module}:{one.line}", "")
            lines.append(f"| {one.module} | {one.line} | {one.kind} | `{one.change}` | {remark} |")
    return "\n".join(lines) + "\n"


def _rows(tried: Sequence[Tried], name: str) -> list[str]:
    """A line for each room or kind, and one for all."""
    rows = []
    for value in [*dict.fromkeys(getattr(one, name) for one in tried), "all"]:
        here = [one for one in tried if value in (getattr(one, name), "all")]
        killed = sum(bool(one.noticed) for one in here)
        rows.append(f"| {value} | {len(here)} | {killed} | {len(here) - killed} | {_rate(here)} |")
    return rows


def commit() -> str:
    """The commit of the tree, as git names it."""
    done = subprocess.run(["git", "describe", "--always"], capture_output=True, text=True, check=False)
    return f"commit {done.stdout.strip()}" if done.returncode == 0 else "no commit"


def written(tried: Sequence[Tried], sample: Sample, out: Path, remarks: Mapping[str, str]) -> None:
    """Write the page; `remarks` say what is known of a survivor, by module and line, and of the `sample`."""
    asked = f"--seed {sample.seed} --count {sample.count} --seconds {sample.seconds:g} --journal FILE"
    out.parent.mkdir(parents=True, exist_ok=True)
    with replacing(out, force=True) as partial:
        command = f"python bench/mutants.py {asked} --out results/robustness"
        partial.write_text(page(tried, sample, command, remarks), "utf-8")
