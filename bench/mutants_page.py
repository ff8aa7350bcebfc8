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


EQUIVALENT, SINCE = "equivalent", "a test was written after"
"""How a remark begins of a survivor that changes nothing that can be seen, and of one that is noticed now: both are
counted apart."""


def page(tried: Sequence[Tried], sample: Sample, command: str, remarks: Mapping[str, str]) -> str:
    """The table for people, and the survivors."""
    late = sum(one.noticed.endswith("(time)") for one in tried)
    lines = ["# Small errors planted in the code", "", f"    {command}", ""]
    lines += [f"mount-cosim {__version__}, {commit()}. What is planted, and what is not: `bench/mutations.py`."]
    lines += [
        f"{len(tried)} of {sample.count} planned, in the order in which they were drawn. Of each the tests were asked",
        f"that run the line, focused ones first (`bench/mutants_chosen.py`), for {sample.seconds:g} s of processor;",
        f"{late} were noticed because a test no longer ended. In brackets: 95 % intervals (Wilson).",
    ]
    lines += [remarks["sample"]] if "sample" in remarks else []
    lines += [
        "What only a test notices that was written after the draw counts as survived; so the rate is a lower bound of",
        "what the whole suite notices. What is equivalent, with its reason below, is left out of the last column.",
        _today(tried, remarks),
        "",
    ]
    for name, title in (("group", "room"), ("kind", "kind")):
        lines += [f"| {title} | errors | noticed | survived | rate | rate without equivalents |", "|---|" + 5 * "--:|"]
        lines += [*_rows(tried, name, remarks), ""]
    lines += ["## Survivors", "", "| module | line | kind | change | what is known of it |", "|---|--:|---|---|---|"]
    for one in tried:
        if not one.noticed:
            lines.append(f"| {one.module} | {one.line} | {one.kind} | `{one.change}` | {_remark(one, remarks)} |")
    return "\n".join(lines) + "\n"


def _today(tried: Sequence[Tried], remarks: Mapping[str, str]) -> str:
    """What is noticed with the tests that were written for survivors."""
    said = [_remark(one, remarks) for one in tried if not one.noticed]
    equivalent, since = (sum(one.startswith(word) for one in said) for word in (EQUIVALENT, SINCE))
    seen, now = len(tried) - equivalent, len(tried) - len(said) + since
    return f"With the {since} tests that were written since, {now} of {seen} are noticed ({now / max(seen, 1):.0%})."


def _remark(one: Tried, remarks: Mapping[str, str]) -> str:
    """What is known of a survivor: of its line, or of its line and kind where there are several."""
    place = f"{one.module}:{one.line}"
    return remarks.get(f"{place}:{one.kind}", remarks.get(place, ""))


def _rows(tried: Sequence[Tried], name: str, remarks: Mapping[str, str]) -> list[str]:
    """A line for each room or kind, and one for all."""
    rows = []
    for value in [*dict.fromkeys(getattr(one, name) for one in tried), "all"]:
        here = [one for one in tried if value in (getattr(one, name), "all")]
        noticed = sum(bool(one.noticed) for one in here)
        seen = [one for one in here if one.noticed or not _remark(one, remarks).startswith(EQUIVALENT)]
        counts = f"{len(here)} | {noticed} | {len(here) - noticed}"
        rows.append(f"| {value} | {counts} | {_rate(here)} | {_rate(seen) if seen else '-'} |")
    return rows


def commit() -> str:
    """The commit of the tree, as git names it."""
    done = subprocess.run(["git", "describe", "--always"], capture_output=True, text=True, check=False)
    return f"commit {done.stdout.strip()}" if done.returncode == 0 else "no commit"


def written(tried: Sequence[Tried], sample: Sample, out: Path, remarks: Mapping[str, str]) -> None:
    """Write the page; `remarks` say what is known of a survivor, by module and line, and of the `sample`."""
    asked = f"--seed {sample.seed} --count {sample.count} --seconds {sample.seconds:g} --map MAP --journal FILE"
    out.parent.mkdir(parents=True, exist_ok=True)
    with replacing(out, force=True) as partial:
        command = f"python bench/mutants.py {asked} --out results/robustness"
        partial.write_text(page(tried, sample, command, remarks), "utf-8")
