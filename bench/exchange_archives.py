"""Archives of others in this tool: each runs, or is refused by a sentence that is true; numbers beside FMPy's and CSVs.

`copies.toml` in a folder of copies names each: [[copies]] folder, repository, commit, and folders of FMUs that were
built outside from its sources (`built`). Each archive is run in a process that may crash.
"""

import hashlib
import json
import multiprocessing
import re
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from exchange_truth import STEPS, beside_csv, beside_fmpy, experiment, recorded, refused

from cosim.fmi.description import INTERFACES, describe
from cosim.fmi.variables import ports_of
from cosim.master.isolated import run_isolated
from cosim.master.simulate import Options, run, simulate
from cosim.support.errors import CosimError
from cosim.system.scenario import Scenario, parse_scenario, read_scenario
from cosim.system.system import Fmu, System
from cosim.system.wire import Record

FOLDER = re.compile(r"(?<![\w./:])/(?:[^\s/:]+/)+")
SECONDS = 120.0
"""Longest that one archive may take."""
CLOSE = {"coSimulation": 1e-9, "modelExchange": 2e-3, "scheduledExecution": 0.0}
"""Largest difference to FMPy relative to the range of a signal: the same calls give the same; solvers differ."""


@dataclass(frozen=True)
class Row:
    """What became of an archive: "run", "refused" or "wrong"; numbers or the sentence; why that is true."""

    repository: str
    commit: str
    path: str
    how: str
    became: str
    said: str
    truth: str = ""


def rows_of(copies: Path) -> Iterator[Row]:
    """Try every archive of a folder of copies."""
    known: dict[str, list[Row]] = {}
    for one in tomllib.loads((copies / "copies.toml").read_text("utf-8"))["copies"]:
        folder = copies / one["folder"]
        for path in sorted(p for kind in ("fmu", "ssp", "ssd") for p in folder.rglob(f"*.{kind}")):
            key = hashlib.sha256(path.read_bytes()).hexdigest() if path.suffix == ".fmu" else str(path)
            known[key] = known.get(key) or apart(path)
            name = path.relative_to(folder).as_posix()
            built = any(name.startswith(f"{where}/") for where in one.get("built", ()))
            name = f"{path.name}, FMI {name[5]}, built from its sources" if built else name
            yield from (
                replace(row, repository=one["repository"], commit=one["commit"][:10], path=name) for row in known[key]
            )


def apart(path: Path) -> list[Row]:
    """Try one archive in a process of its own."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    process = context.Process(target=lambda: there.send(tried(path)))
    process.start()
    there.close()
    try:
        return here.recv() if here.poll(SECONDS) else [late(path)]
    except EOFError:
        process.join()
        return [told(path, "", "wrong", f"its process ended with {process.exitcode}")]
    finally:
        process.kill()


def late(path: Path) -> Row:
    """Take one step in the tool's own process for runs, which says which call does not return."""
    how = "" if path.suffix == ".fmu" else "SSP"
    try:
        scenario = one_step(path) if path.suffix == ".fmu" else replace(read_scenario(path, outside=True), ticks=1)
        with tempfile.TemporaryDirectory() as folder:
            run_isolated(scenario, Options(Path(folder) / "run.parquet"), call_timeout=SECONDS / 2)
    except CosimError as error:
        return told(path, how, "refused", str(error), f"no answer within {SECONDS:g} s either")
    return told(path, how, "run", f"one step; more of them take longer than {SECONDS:g} s")


def one_step(path: Path) -> Scenario:
    """The scenario of one step of an FMU with nothing wired."""
    text = f"stop = 0.1\nstep = 0.1\n[components.fmu]\nfmu = {json.dumps(str(path))}\n[record]\nsignals = "
    names = recorded(ports_of(describe(path)))[:1]
    return parse_scenario(text + json.dumps([f"fmu.{name}" for name in names]), "it", Path())


def told(path: Path, how: str, became: str, said: str, truth: str = "") -> Row:
    """A row whose sentences name no folder of this machine."""
    short = (" ".join(FOLDER.sub(".../", one).split()) for one in (said.replace(str(path), path.name), truth))
    return Row("", "", path.name, how, became, *short)


def tried(path: Path) -> list[Row]:
    """Run an archive by every interface that it has."""
    if path.suffix != ".fmu":
        return [system(path)]
    try:
        description = describe(path)
    except CosimError as error:
        return [told(path, "", *refused(path, str(error)))]
    kinds = [kind for kind in INTERFACES if getattr(description, kind) is not None]
    return [alone(path, description, kind) for kind in kinds or ["coSimulation"]]


def alone(path: Path, description: Any, kind: str) -> Row:
    """Run an FMU with nothing wired, and let FMPy do the same."""
    stop, step = experiment(description)
    names = recorded(ports_of(description))
    made = System(
        components={"fmu": Fmu(path, INTERFACES[kind])},
        records={name: Record(f"fmu.{name}") for name in names},
        step=step,
        ticks=round(stop / step),
        last=True,
    )
    how = INTERFACES[kind]
    try:
        done = simulate(made)
    except CosimError as error:
        return told(path, how, *refused(path, str(error), kind))
    seen = {name: done.recording[name] for name in done.recording if name != "t"}
    text, apart_ = "FMPy runs no clocks", 0.0
    if kind != "scheduledExecution":
        text, apart_ = beside_fmpy(path, kind, step, stop, seen, done.recording.t)
    said = [f"{made.ticks:,} steps of {step:g} s", text, done.statistics["ended"]]
    said += [beside_csv(path, done.recording)] if kind == "coSimulation" else []
    return told(path, how, "run" if apart_ <= CLOSE[kind] else "wrong", "; ".join(filter(None, said)))


def system(path: Path) -> Row:
    """Run an SSP for at most STEPS steps."""
    try:
        scenario = read_scenario(path, outside=True)
        done = run(replace(scenario, ticks=min(scenario.ticks, STEPS)))
    except CosimError as error:
        return told(path, "SSP", *refused(path, str(error)))
    columns = ", ".join(name for name in list(done.recording)[1:4])
    return told(
        path, "SSP", "run", f"{done.statistics['steps']:,} steps; {len(list(done.recording)) - 1} columns: {columns}"
    )


HEAD = ("| archive | as | | what it gave, or the sentence | why that is true |", "|---|---|---|---|---|")


def page(rows: Sequence[Row]) -> list[str]:
    """Write the counts and the tables."""
    counts = Counter(row.became for row in rows)
    said = f"{len(rows)} tried: {counts['run']} run, {counts['refused']} refused truly, {counts['wrong']} wrong."
    lines = ["# Archives of others here", "", said]
    for repository in dict.fromkeys(row.repository for row in rows):
        of = [row for row in rows if row.repository == repository]
        lines += ["", f"## {repository} at `{of[0].commit}`", "", *HEAD, *map(_line, of)]
    return lines


def _line(row: Row) -> str:
    cells = (row.path, row.how, row.became, row.said, row.truth)
    return "| " + " | ".join(one.replace("|", "/") for one in cells) + " |"
