"""The master: compiles a system, starts its components, runs the loop in chunks, and streams what is recorded.

Time is counted in ticks. How a value gets from one component to another in a tick, and so how long each wire delays, is
the algorithm's (`algorithm`); Jacobi where nothing else is said.
"""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.master.execution import Execution, Progress
from cosim.master.given import Given
from cosim.master.initialisation import initialise
from cosim.master.loop import make_loop
from cosim.master.notes import notes_of
from cosim.master.opening import started, wiring_of
from cosim.master.output import check_room, kept, origin_of, writer_of
from cosim.master.planning import make_plan
from cosim.master.result import RunResult
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
    """

    path: Path | None = None
    force: bool = False
    on_progress: Progress | None = None
    compiled: bool = True
    command: str = ""


PLAIN = Options()


def simulate(system: System, options: Options = PLAIN) -> RunResult:
    """Step the components of a system together and record.

    Raises:
        WiringError, FmuError, SignalError, OutputError: before the first step.
        StepError: a component failed; what was recorded before is in the file.
    """
    check_room(system, options.path)
    with ExitStack() as stack:
        wiring = wiring_of(stack, system)
        plan = make_plan(wiring, system.step, system.decimation, system.start)
        settings = started(wiring, system, plan)
        notes = [*system.notes, *notes_of(wiring, plan, settings)]
        notes += initialise(plan, settings, Given(wiring, plan).at(np.zeros(1, dtype=np.int64))[:, 0])
        origin = origin_of(wiring, settings, plan)
        told = {"scenario": system.text, "command": options.command} if system.text else {}
        writer = writer_of(wiring, plan, {**origin, **told}, options.path, options.force)
        loop = make_loop(plan, options.compiled)
        work = Execution(wiring, plan, notes, loop, writer, system.ticks, options.on_progress, system.ends_on_a_row)
        work.execute()
    recording = kept(writer, system.name) if options.path is None else None
    files = {} if options.path is None else {"recording": options.path}
    return RunResult(system.name, work.statistics(), files, recording)


def run(scenario: Scenario, options: Options = PLAIN) -> RunResult:
    """Run a scenario whose components all have their FMU; errors as in `simulate`.

    Raises:
        ScenarioError: a component is made from a card and has no FMU yet.
    """
    return simulate(scenario.system(), options)


__all__ = ["Options", "Progress", "RunResult", "run", "simulate"]
