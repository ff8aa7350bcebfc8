"""A plan on its way: the loop runs it chunk by chunk, and its rows go to a writer."""

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

import numpy as np

from cosim.component import FATAL, STATUSES, Component
from cosim.errors import StepError
from cosim.interrupts import uninterrupted
from cosim.loop import CompiledLoop, InterpretedLoop, Plan, slow_because
from cosim.planning import make_streams
from cosim.wiring import Wiring
from cosim.writer import MemoryWriter

Progress = Callable[[int, int], None]
"""Called between chunks with ticks done and ticks in all."""

CHUNK = 32_768
"""Ticks between two looks at progress and Ctrl-C at most; fewer where steps are slow."""
CHUNK_SECONDS = 0.1


@dataclass
class Execution:
    """A plan on its way: what the loop runs and where its rows go."""

    wiring: Wiring
    plan: Plan
    loop: CompiledLoop | InterpretedLoop
    writer: MemoryWriter
    ticks: int
    progress: Progress | None
    seconds: float = 0.0

    def execute(self) -> None:
        """Run the loop to its end and complete the recording, whatever ends the run; the last row may be cut short."""
        begun = perf_counter()
        try:
            with closing(self.writer):
                self._stream()
        finally:
            self.seconds = perf_counter() - begun

    def statistics(self) -> dict[str, Any]:
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
            "loop": self.loop.kind,
            "algorithm": self.wiring.algorithm.kind,
            "coupling": [asdict(effort) for effort in self.loop.efforts],
            "warnings": self.loop.warnings,
            "unconnected": list(self.wiring.unconnected()),
            "notes": self._notes(),
        }

    def _notes(self) -> list[str]:
        notes = list(self.wiring.doubts())
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
        return notes

    def _stream(self) -> None:
        self.writer.origin["complete"] = False
        try:
            self._run_chunks()
        finally:
            with uninterrupted():
                self._write(self.loop.flush())
        self.writer.origin["complete"] = True

    def _run_chunks(self) -> None:
        streams = make_streams(self.wiring, self.plan.step)
        self.loop.start()
        self._check()
        for chunk in chunks(self.ticks):
            columns = [stream(chunk) for stream in streams]
            given = np.concatenate(columns) if columns else np.empty((0, len(chunk)))
            with uninterrupted():
                self._write(self.loop.run(len(chunk), given))
            self._check()
            if self.progress:
                self.progress(self.loop.tick, self.ticks)

    def _write(self, rows: np.ndarray) -> None:
        first, count = self.writer.rows, rows.shape[1]
        if count:
            t = np.arange(first, first + count) * self.plan.decimation * self.plan.step
            self.writer.write({"t": t} | dict(zip(self.wiring.records, rows, strict=True)))

    def _check(self) -> None:
        """Raise the failure of the loop, if there is one, as a sentence."""
        failure = self.loop.failure
        if failure is None:
            return
        part = self.plan.parts[failure.part]
        name, component = part.name, part.component
        self._tell_failed(component, failure.status)
        inputs = self.plan.inputs(failure.part)
        what = STATUSES.get(failure.status, f"returned status {failure.status}")
        last = ", ".join(f"{key} = {value:.9g}" for key, value in inputs.items()) or "none"
        said = "".join(f'; it said "{text}"' for text in component.messages()[-1:])
        when = f"at tick {failure.tick:,} ({failure.tick * self.plan.step:.9g} s)"
        raise StepError(
            f"{name} {what} {when}{said}; its last inputs: {last}.", component=name, tick=failure.tick, inputs=inputs
        )

    def _tell_failed(self, component: Component, status: int) -> None:
        """Let components know which calls are still allowed; FATAL counts for all instances of one FMU."""
        same = component.origin.get("sha256")
        for other in (part.component for part in self.plan.parts):
            if other is component or (status == FATAL and same and other.origin.get("sha256") == same):
                other.failed(status)


def chunks(ticks: int) -> Iterator[np.ndarray]:
    """Yield all ticks in pieces that take about CHUNK_SECONDS each, as measured on the piece before."""
    first, size = 0, 16
    while first < ticks:
        begun = perf_counter()
        last = min(first + size, ticks)
        yield np.arange(first, last)
        fitting = size * CHUNK_SECONDS / max(perf_counter() - begun, 1e-9)
        first, size = last, int(max(16, min(CHUNK, 8 * size, fitting)))
