"""The loop in Python, for components that only Python can step and machines without the compiled one.

Does what loop.c does, in the same order, bit for bit; see there for the meaning of each part.
"""

from math import floor, isfinite

import numpy as np

from cosim.component import NOT_FINITE, OK, WARNING
from cosim.loop.plan import Failure, Link, Part, Plan


class InterpretedLoop:
    """A plan executed by Python, some hundred times slower than by the compiled loop."""

    kind = "interpreted"

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self.tick, self.warnings = 0, 0
        self.failure: Failure | None = None
        self._sample = [0.0] * len(plan.columns)
        self._sum = [0.0] * len(plan.columns)
        self._half, self._edge, self._halves, self._sampled = 0, plan.decimation, 0, False
        self._means = any(column.mean for column in plan.columns)

    def start(self) -> None:
        """Read all outputs before the first tick."""
        for index, part in enumerate(self._plan.parts):
            status = self._get(part)
            if status > WARNING:
                self.failure = Failure(index, 0, status)
                return

    def run(self, ticks: int, signals: np.ndarray) -> np.ndarray:
        """Run ticks with signals of shape (signals, ticks); returns rows of shape (columns, rows)."""
        rows: list[list[float]] = []
        for k in range(ticks):
            self._gather(signals[:, k])
            self._record(rows)
            if not self._advance_all():
                break
            self.tick += 1
        return self._array(rows)

    def flush(self) -> np.ndarray:
        """Return the row cut short by the end of the run, if there is one, shape (columns, 0 or 1)."""
        rows: list[list[float]] = []
        if self._sampled:
            self._emit(rows)
        return self._array(rows)

    def _gather(self, signals: np.ndarray) -> None:
        bus, plan = self._plan.bus, self._plan
        bus[plan.signal : plan.signal + plan.signals] = signals
        for link in plan.links:
            bus[link.target] = _carry(link, bus)

    def _advance_all(self) -> bool:
        time = float(self.tick) * self._plan.step
        for index, part in enumerate(self._plan.parts):
            status = self._advance(part, time)
            self.warnings += status == WARNING
            if status > WARNING:
                self.failure = Failure(index, self.tick, status)
                return False
        return True

    def _advance(self, part: Part, time: float) -> int:
        status = self._set(part)
        if status <= WARNING:
            status = max(status, part.component.step(time, self._plan.step))
        if status <= WARNING:
            status = max(status, self._get(part))
        outputs = self._plan.bus[part.output : part.output + len(part.output_references)]
        return NOT_FINITE if status <= WARNING and not all(map(isfinite, outputs)) else status

    def _set(self, part: Part) -> int:
        count = len(part.input_references)
        values = self._plan.bus[part.input : part.input + count]
        return part.component.set(part.input_references, values) if count else OK

    def _get(self, part: Part) -> int:
        count = len(part.output_references)
        values = self._plan.bus[part.output : part.output + count]
        return part.component.get(part.output_references, values) if count else OK

    def _record(self, rows: list[list[float]]) -> None:
        if self.tick % self._plan.decimation == 0:
            self._sample = [float(self._plan.bus[column.source]) for column in self._plan.columns]
            self._sampled = True
            if not self._means:
                self._emit(rows)
        if self._means:
            self._add_half(rows)
            self._add_half(rows)

    def _add_half(self, rows: list[list[float]]) -> None:
        if self._half == self._edge:
            self._emit(rows)
            self._edge += 2 * self._plan.decimation
        bus = self._plan.bus
        self._sum = [total + float(bus[c.source]) for total, c in zip(self._sum, self._plan.columns, strict=True)]
        self._halves += 1
        self._half += 1

    def _emit(self, rows: list[list[float]]) -> None:
        pairs = zip(self._plan.columns, self._sum, self._sample, strict=True)
        rows.append([total / self._halves if column.mean else sample for column, total, sample in pairs])
        self._sum = [0.0] * len(self._plan.columns)
        self._halves, self._sampled = 0, False

    def _array(self, rows: list[list[float]]) -> np.ndarray:
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self._plan.columns)).T


def _carry(link: Link, bus: np.ndarray) -> float:
    value = link.gain * float(bus[link.source]) + link.offset
    if link.quantum > 0.0:
        value = link.quantum * float(floor(value / link.quantum + 0.5))
    return value if link.noise < 0 else value + float(bus[link.noise])
