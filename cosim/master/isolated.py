"""A run in a process of its own: a component that crashes, ends the process or never returns costs one sentence.

The whole loop runs there, so a step costs what it costs here; only starting the process takes its time. What it
protects from is faults, not malice: the process has all rights of its user.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from signal import Signals
from time import monotonic
from typing import Any

from cosim.master.loop.structures import CLoop
from cosim.master.result import RunResult, Statistics
from cosim.master.simulate import Options, Progress, run
from cosim.support.activity import Board
from cosim.support.cell import Cell, LostError
from cosim.support.child import tell
from cosim.support.errors import CosimError, LostComponentError
from cosim.support.files import forget_partials
from cosim.system.scenario import Scenario

CALL_TIMEOUT = 60.0
"""Seconds that one call of a component may take; models that fetch a licence or fill tables need some."""
GRACE = 5.0
"""Seconds that a call of a component may take once the run was interrupted; completing the recording has no limit."""
SIGNALS = {
    "SIGSEGV": "segmentation fault",
    "SIGABRT": "abort",
    "SIGFPE": "arithmetic error",
    "SIGILL": "illegal instruction",
    "SIGBUS": "bus error, as of a library cut short",
    "SIGKILL": "killed, perhaps because memory ran out",
}


def run_isolated(
    scenario: Scenario, options: Options, *, call_timeout: float = CALL_TIMEOUT, keep: tuple[int, ...] = ()
) -> RunResult:
    """Run a scenario in a process of its own; errors as of `run`, and one more.

    Args:
        scenario: what is run.
        options: how; the recording goes to a file.
        call_timeout: seconds that one call of a component may take.
        keep: file descriptors that the process inherits.

    Returns:
        the result; where a component does not come back when it is closed, with a note: the recording is complete then.

    Raises:
        LostComponentError: a component ended, crashed or blocked the process while it ran; nothing is recorded.
    """
    assert options.path is not None  # what is only in its memory ends with a process
    cell = Cell(quiet=False, keep=keep)
    cell.begin()
    watch = Watch(cell.board(), scenario.step, call_timeout)
    pid = cell.pid
    try:
        heard = _Heard(options.on_progress)
        plain = replace(options, on_progress=None)
        statistics = cell.call(_work, scenario, plain, on_message=heard, overdue=watch.overdue)
    except KeyboardInterrupt:
        cell.finish(Watch(cell.board(), scenario.step, GRACE).overdue)
        raise
    except LostError as loss:
        if heard.error is not None:
            raise heard.error from loss
        if heard.statistics is None:
            raise watch.error(loss, scenario) from loss
        note = f"{watch.sentence(loss, scenario)} The recording is complete."
        statistics = {**heard.statistics, "notes": [*heard.statistics["notes"], note]}
    finally:
        cell.close()
        forget_partials(pid, options.path.parent)
    return RunResult(scenario.name, statistics, {"recording": options.path})


def _work(scenario: Scenario, options: Options) -> Statistics:
    """Run here, where a crash may happen."""
    return run(scenario, replace(options, on_progress=tell, on_recorded=tell)).statistics


@dataclass
class _Heard:
    """What the process told before its answer: how far it is, then how the run went, before components are closed."""

    on_progress: Progress | None
    statistics: Statistics | None = None
    error: CosimError | None = None

    def __call__(self, first: Any, second: Any) -> None:
        if not isinstance(first, int):
            self.statistics, self.error = first, second
        elif self.on_progress:
            self.on_progress(first, second)


@dataclass(frozen=True)
class Call:
    """Where a process is: in which call of which component, or in none; at which tick."""

    component: str
    what: str
    tick: int

    @classmethod
    def of(cls, board: Board) -> "Call":
        """Read it from the board of a process."""
        loop = board.read_loop(CLoop)
        component, what = board.work
        if not component and loop.status < 0:
            names = board.names
            component, what = names[min(-1 - loop.status, len(names) - 1)], "stepped"
        return cls(component, what, int(loop.tick))


class Watch:
    """What is known of a run from outside: how long it has been in one call, and where it was when it ended.

    Args:
        board: of the process.
        step: of the scenario in s.
        limit: seconds that one call may take.
    """

    def __init__(self, board: Board, step: float, limit: float, clock: Callable[[], float] = monotonic) -> None:
        self._board, self._step, self._limit, self._clock = board, step, limit, clock
        self._call, self._since = Call.of(board), clock()

    def overdue(self) -> str:
        """Say that the component being called has not returned in time; empty as long as it may."""
        call, now = Call.of(self._board), self._clock()
        if call != self._call or not call.component:
            self._call, self._since = call, now
        return "a call did not return" if now - self._since > self._limit else ""

    def error(self, loss: LostError, scenario: Scenario) -> LostComponentError:
        """Return what became of the process as an error."""
        message = f"{self.sentence(loss, scenario)} Nothing was recorded."
        return LostComponentError(message, component=Call.of(self._board).component, reason=str(loss))

    def sentence(self, loss: LostError, scenario: Scenario) -> str:
        """Say in a sentence what became of the process."""
        call = Call.of(self._board)
        section = scenario.components.get(call.component)
        source = (section.fmu or section.python) if section else None
        who = f"{call.component} ({source})" if source else call.component or "The process of the run"
        when = f" at tick {call.tick:,} ({call.tick * self._step:.9g} s)" if call.what == "stepped" else ""
        where = f" while it was {call.what}{when}" if call.component else ""
        if loss.status == "timeout":
            return f"{who} did not return within {self._limit:g} s{where}; --call-timeout lets it take longer."
        return f"{who} {_end(loss.code)}{where}; a component must return from its calls."


def _end(code: int) -> str:
    """Say how a component ended the process."""
    if code >= 0:
        return f"ended its process with exit code {code}"
    try:
        name = Signals(-code).name
    except ValueError:
        return f"crashed with signal {-code}"
    return f"crashed: {name}, {SIGNALS[name]}," if name in SIGNALS else f"crashed: {name},"
