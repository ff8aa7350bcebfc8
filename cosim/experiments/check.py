"""The check of an FMU: its experiments, or where it brings none, its default experiment and what any FMU must do.

experiment        each that the manifest names (FMI-LS-REF), compared with its reference
default           the default experiment: compared with a result that the manifest names; else it must run to its end,
                  twice with the same bits in one instance, and once more in a new one
description       FMPy's validation of the model description
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.experiments.experiment_file import CSV, KINDS, Experiment, experiments_in, only
from cosim.experiments.run import MODEL, Outcome, run_experiment, settings_of, system_of
from cosim.fmi.description import describe, first_line
from cosim.fmi.manifest import Manifest, manifest_of
from cosim.fmi.variables import ports_of
from cosim.master.exchange import open_fmu
from cosim.master.simulate import simulate
from cosim.support.cell import Cell, LostError, ending
from cosim.support.errors import CosimError, FmuError
from cosim.system.system import System

TIMEOUT = 60.0
"""Seconds that one experiment may take."""
DEFAULT = "default experiment"


@dataclass(frozen=True)
class Finding:
    """Something that can be asked of any FMU: whether it holds, and a sentence."""

    name: str
    passed: bool
    statement: str


@dataclass(frozen=True)
class Checked:
    """What a check found."""

    path: Path
    standard: str
    outcomes: tuple[Outcome, ...]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = field(default=())

    @property
    def passed(self) -> bool:
        """Whether everything holds."""
        return all(one.passed for one in self.outcomes) and all(one.passed for one in self.findings)


def check(
    path: Path,
    rtol: float,
    timeout: float = TIMEOUT,
    interface: str = "",
    say: Callable[[str], None] = lambda text: None,
) -> Checked:
    """Run what an FMU brings along, each experiment in a process of its own.

    Raises:
        FmuError: it is no FMU that can run here, or its manifest is of a version that is not known.
    """
    describe(path)
    manifest = manifest_of(path)
    experiments = _experiments(path, manifest)
    cell = Cell()
    try:
        outcomes = []
        for one in experiments:
            say(one.name)
            outcome, lost = _in_cell(cell, timeout, run_experiment, path, one, rtol, interface)
            outcomes.append(outcome or Outcome(one, False, lost))
        findings = [_description(path)]
        if not any(one.run for one in outcomes):
            say(DEFAULT)
            found, lost = _in_cell(cell, timeout, default_findings, path, interface)
            findings += found or [Finding("runs", False, lost)]
    finally:
        cell.close()
    standard = f"FMI-LS-REF {manifest.version}" if manifest else ""
    return Checked(path, standard, tuple(outcomes), tuple(findings), manifest.notes if manifest else ())


def _experiments(path: Path, manifest: Manifest | None) -> list[Experiment]:
    """The experiments of a manifest; where it names none, the default experiment with the results that it gives."""
    found: list[Experiment] = []
    brings = manifest is not None and any(one.main_role == "experiment" for one in manifest.related)
    for one in manifest.related if manifest else ():
        if one.main_role == "experiment" and one.kind in KINDS:
            found += experiments_in(path, one)
        elif one.main_role == "experiment":
            name = one.member.rpartition("/")[2]
            not_run = f"{name} is of type {one.kind}, and read here are: {', '.join(KINDS)}"
            found.append(Experiment(name, one.description, not_run=not_run))
        elif one.role == "result" and one.kind == CSV and not brings:
            found.append(Experiment(DEFAULT, one.description, "result", references=one.member))
        elif one.role == "result" and not brings:
            not_run = f"{one.member.rpartition('/')[2]} is of type {one.kind}{only(CSV)}"
            found.append(Experiment(DEFAULT, one.description, "result", not_run=not_run))
    return found


def _in_cell(cell: Cell, timeout: float, function: Callable[..., Any], *arguments: Any) -> tuple[Any, str]:
    """What a function finds in a process of its own; or None, and a sentence on what came instead."""
    try:
        return cell.call(function, *arguments, timeout=timeout), ""
    except LostError as loss:
        late = f"The FMU did not end its simulation within {timeout:g} s."
        return None, late if loss.status == "timeout" else f"The FMU crashed: {ending(loss.code)}."
    except CosimError as error:
        return None, str(error)


def _description(path: Path) -> Finding:
    """FMPy's validation."""
    from fmpy.validation import validate_fmu

    try:
        problems = [str(one) for one in validate_fmu(str(path))]
    except Exception as error:  # FMPy raises many kinds; each means that the description cannot be judged
        problems = [first_line(error)]
    if not problems:
        return Finding("description", True, "FMPy's validation has no complaint")
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return Finding("description", False, f"{' '.join(problems[0].split())[:300]}{more}")


def default_findings(path: Path, interface: str = "") -> list[Finding]:
    """Run the default experiment of an FMU and say what any FMU must do.

    Raises:
        CosimError: it does not run.
    """
    description = describe(path)
    ports = ports_of(description)
    settings = settings_of(path, description, Experiment(DEFAULT), None, interface)
    system = system_of(path, ports, settings, None, {}, None, interface)
    if not system.records:
        raise FmuError(f"{path} has no outputs: there is nothing to look at.", culprit=str(path))
    span = f"{settings.start:g} to {settings.stop:g} s in {settings.ticks:,} steps"
    with open_fmu(path, "fmu", interface) as component:
        again = [_columns(replace(system, components={MODEL: component})) for _ in range(2)]
    other = _columns(system)
    return [
        Finding("runs", True, f"the default experiment ran: {span}, all outputs finite"),
        _same("reset", again[0], again[1], "a second run after a reset gives"),
        _same("instances", again[0], other, "a run in a new instance gives"),
    ]


def _columns(system: System) -> dict[str, np.ndarray]:
    recording = simulate(system).recording
    return {**recording.table, **recording.others}


def _same(name: str, first: dict[str, np.ndarray], second: dict[str, np.ndarray], what: str) -> Finding:
    for key, values in first.items():
        wrong = np.flatnonzero(values != second[key])
        if len(wrong):
            return Finding(name, False, f"{what} another {key} from {first['t'][wrong[0]]:g} s on")
    return Finding(name, True, f"{what} the same bits")
