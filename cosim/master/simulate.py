"""The master: compiles a system, starts its components, runs the loop in chunks, and streams what is recorded.

Time is counted in ticks. How a value gets from one component to another in a tick, and so how long each wire delays, is
the algorithm's (`algorithm`); Jacobi where nothing else is said.
"""

import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.master.execution import Execution, Progress, guard_of
from cosim.master.given import Given
from cosim.master.initialisation import initialise
from cosim.master.loop import make_loop
from cosim.master.notes import notes_of
from cosim.master.opening import started, wiring_of
from cosim.master.output import check_room, kept, origin_of, writer_of
from cosim.master.planning import make_plan
from cosim.master.proven import proven_of, with_records
from cosim.master.result import RunResult, Statistics
from cosim.support.errors import CosimError
from cosim.system.scenario import Scenario
from cosim.system.system import System


@dataclass(frozen=True)
class Options:
    """How a system is run, which changes no number of its recording.

    Args:
        path: Parquet file to stream to; None keeps the recording in memory.
        force: overwrite the file.
        on_progress: called between chunks.
        compiled: False asks for the loop in Python, which gives the same bits.
        command: what the recording of a scenario says it was made by.
        on_recorded: called when the recording is complete, before the components are closed: with how the run went,
            and the error that ended it.
    """

    path: Path | None = None
    force: bool = False
    on_progress: Progress | None = None
    compiled: bool = True
    command: str = ""
    on_recorded: Callable[[Statistics, CosimError | None], None] | None = None


PLAIN = Options()


def simulate(system: System, options: Options = PLAIN) -> RunResult:
    """Step the components of a system together and record.

    Raises:
        WiringError, FmuError, SignalError, OutputError: before the first step.
        StepError: a component failed; what was recorded before is in the file.
    """
    check_room(system, options.path)
    path = options.path and options.path.absolute()  # foreign code may change the working directory
    with ExitStack() as stack:
        wiring = wiring_of(stack, system)
        proven = proven_of(wiring)
        watched = replace(wiring, records=with_records(wiring, proven))
        plan = make_plan(watched, system.step, system.decimation, system.start)
        settings = started(wiring, system, plan)
        guard, signals = guard_of(plan), Given(wiring, plan).at(np.zeros(1, dtype=np.int64))[:, 0]
        notes = [*system.notes, *notes_of(wiring, plan, settings)]
        with guard.kept():
            notes += initialise(plan, settings, signals)
        origin = origin_of(wiring, settings, plan)
        told = {"scenario": system.text, "command": options.command} if system.text else {}
        writer = writer_of(wiring, plan, {**origin, **told}, path, options.force)
        loop = make_loop(plan, options.compiled)
        ticks, last = system.ticks, system.ends_on_a_row
        work = Execution(wiring, plan, notes, loop, writer, ticks, options.on_progress, guard, proven, last)
        _execute(work, options)
    recording = kept(writer, system.name) if options.path is None else None
    files = {} if options.path is None else {"recording": options.path}
    return RunResult(system.name, work.statistics(), files, recording)


def _execute(work: Execution, options: Options) -> None:
    """Run to the end, and tell who wants to know; components that are closed after that may never come back."""
    ended: CosimError | None = None
    try:
        work.execute()
    except CosimError as error:
        ended = error
        raise
    finally:
        if options.on_recorded and (ended or not sys.exception()):
            options.on_recorded(work.statistics(), ended)


def run(scenario: Scenario, options: Options = PLAIN) -> RunResult:
    """Run a scenario whose components all have their FMU; errors as in `simulate`.

    Raises:
        ScenarioError: a component is made from a card and has no FMU yet.
    """
    return simulate(scenario.system(), options)


__all__ = ["Options", "Progress", "RunResult", "run", "simulate"]
