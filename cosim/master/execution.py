"""A plan on its way: the loop runs it chunk by chunk, and its rows go to a writer."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from time import perf_counter

import numpy as np

from cosim.data.writer import MemoryWriter
from cosim.fmi.component import Component
from cosim.fmi.guard import Guard
from cosim.master.access import who_ended
from cosim.master.given import Given
from cosim.master.loop import CompiledLoop, InterpretedLoop, slow_because
from cosim.master.proven import Proven, said_of
from cosim.master.result import Statistics
from cosim.support.interrupts import uninterrupted
from cosim.system.plan import Column, Plan
from cosim.system.wiring import Wiring

Progress = Callable[[int, int], None]
"""Called between chunks with ticks done and ticks in all."""

CHUNK, VALUES, LAST = 131_072, 2**20, 32_768
"""Ticks between two looks at progress, Ctrl-C and the process at most (half a millisecond each, a twentieth of quick
steps where they come after LAST); numbers that a chunk may hold; ticks of the last one, which is written while nothing
is simulated beside it any more."""
CHUNK_SECONDS = 0.1
"""What a chunk may take: fewer ticks where steps are slow."""


@dataclass
class Execution:
    """A plan on its way: what the loop runs and where its rows go."""

    wiring: Wiring
    plan: Plan
    remarks: Sequence[str]
    loop: CompiledLoop | InterpretedLoop
    writer: MemoryWriter
    ticks: int
    on_progress: Progress | None
    guard: Guard
    proven: Sequence[Proven] = ()
    """What is watched; its columns are the last ones."""
    last: bool = False
    seconds: float = 0.0
    ended: str = ""
    """Who asked to end the run before its time, and when; empty where nobody did."""

    def execute(self) -> None:
        """Run the loop to its end and complete the recording, whatever ends the run; the last row may be cut short."""
        begun = perf_counter()
        try:
            with closing(self.writer):
                self._stream()
        finally:
            self.seconds = perf_counter() - begun

    def statistics(self) -> Statistics:
        """Tell how it went, for people and programs."""
        simulated = self.loop.tick * self.plan.step
        return {
            "steps": self.loop.tick,
            "step": self.plan.step,
            "simulated_seconds": simulated,
            "seconds": self.seconds,
            "ratio_to_real_time": simulated / self.seconds,
            "microseconds_per_step": 1e6 * self.seconds / max(self.loop.tick, 1),
            "rows": self.writer.rows,
            "ended": self.ended,
            "loop": self.loop.kind,
            "algorithm": self.wiring.algorithm.kind,
            "coupling": [asdict(effort) for effort in self.loop.efforts],
            "warnings": self.loop.warnings,
            "unconnected": list(self.wiring.unconnected()),
            "outside": said_of(self.proven),
            "notes": self._notes(),
        }

    def _notes(self) -> list[str]:
        notes = [f"{self.ended}."] if self.ended else []
        notes += self.wiring.doubts()
        notes += self.remarks
        for effort in self.loop.efforts:
            if effort.at_limit:
                some = f"{effort.at_limit:,} of {effort.rounds:,} pieces of steps"
                reason = "lost more energy than tolerated though they were the smallest allowed"
                notes.append(f"{some} {reason}: raise algorithm.max_pieces or make the step smaller.")
        for part in self.plan.parts:
            if "function" in part.component.origin:
                notes.append(f"{part.name} is a Python function: each of its steps costs microseconds.")
        if self.loop.kind != "compiled":
            notes.append(f"{slow_because(self.plan)}: the loop ran in Python.")
        return [*notes, *self._changes()]

    def _changes(self) -> list[str]:
        """Say which component changed what in this process; after a chunk it may have been any of them."""
        named = {part.name: part.component for part in self.plan.parts}
        said = [(f"{name} ({_source(one)})", one.guard) for name, one in named.items()]
        if len(said) > 1:
            said.append((f"One of the components ({', '.join(named)}) that were started and stepped", self.guard))
        return [f"{who} {note}." for who, guard in said for note in guard.notes()]

    def _stream(self) -> None:
        self.writer.origin["complete"] = False
        try:
            self._run_chunks()
        finally:
            with uninterrupted():
                self._write(self.loop.flush())
        self.writer.origin |= {"complete": True} | ({"ended": self.ended} if self.ended else {})

    def _run_chunks(self) -> None:
        signals = Given(self.wiring, self.plan)
        for chunk in chunks(self.ticks, len(self.plan.columns)):
            if self.ended:
                return
            given = signals.at(chunk)
            with uninterrupted():
                with self.guard.kept():
                    rows = self.loop.run(len(chunk), given)
                self._write(rows)
            self._check()
            if self.on_progress:
                self.on_progress(self.loop.tick, self.ticks)
        if self.last and not self.ended:  # where a row falls due at stop
            self.loop.finish(signals.at(np.array([self.ticks])))

    def _write(self, rows: np.ndarray) -> None:
        first, count = self.writer.rows, rows.shape[1]
        if count:
            decimation = self.plan.decimation
            t = np.arange(first * decimation, (first + count) * decimation, decimation) * self.plan.step
            t += self.plan.start
            columns = zip(self.wiring.records, self.plan.columns, rows, strict=False)
            self.writer.write({"t": t} | {name: self._decoded(column, row) for name, column, row in columns})
            for one, row in zip(self.proven, rows[len(self.wiring.records) :], strict=True):
                one.see(t, row)
        if self.plan.pool is not None:
            self.plan.pool.sweep(np.concatenate([self.plan.bus[list(self.plan.named)], self.loop.held]))

    def _decoded(self, column: Column, row: np.ndarray) -> np.ndarray:
        """Return a row of a column with what its numbers name in the place of them."""
        found: np.ndarray = self.plan.pool.column(row, column.kind) if column.kind else row
        return found

    def _check(self) -> None:
        """Raise the failure of the loop, if there is one, as a sentence; a component may just ask to end the run."""
        failure = self.loop.failure
        if failure is None:
            return
        self.ended = who_ended(self.plan, failure)


def guard_of(plan: Plan) -> Guard:
    """Return what watches over all components of a plan together: that of the only one, or another."""
    return plan.parts[0].component.guard if len(plan.parts) == 1 else Guard()


def _source(component: Component) -> str:
    """Return the file that a component is from, or its function."""
    return str(component.origin.get("file") or component.origin.get("function") or "no file")


def chunks(ticks: int, columns: int = 1) -> Iterator[np.ndarray]:
    """Yield all ticks in pieces that take about CHUNK_SECONDS each, as measured on the piece before, or less."""
    first, size, most = 0, 16, min(CHUNK, max(VALUES // max(columns, 1), 1))
    while first < ticks:
        begun = perf_counter()
        last = min(first + size, ticks)
        yield np.arange(first, last)
        fitting = size * CHUNK_SECONDS / max(perf_counter() - begun, 1e-9)
        first, size = last, int(max(16, min(most, 8 * size, fitting, max(LAST, (ticks - last) // 2))))
