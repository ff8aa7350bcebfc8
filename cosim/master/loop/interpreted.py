"""The loop in Python, for components that only Python can step and machines without the compiled one.

Does what loop.c does, in the same order, bit for bit; see there for the meaning of each part.
"""

from collections.abc import Callable

import numpy as np

from cosim.fmi.component import OK, WARNING
from cosim.master.loop.coupling import Balancing, Coupled, Iterating
from cosim.master.loop.part import Parts
from cosim.system.plan import Effort, Gather, Iterate, Part, Plan, PlannedStage, Step


class InterpretedLoop(Parts):
    """A plan executed by Python, some twenty times slower than by the compiled loop."""

    kind = "interpreted"

    def __init__(self, plan: Plan) -> None:
        super().__init__(plan)
        self._coupled: list[Coupled] = []
        self._stages = [self._taker(stage) for stage in plan.stages]
        self._value = [0.0] * len(plan.columns)
        self._sample = [0.0] * len(plan.columns)
        self._sum = [0.0] * len(plan.columns)
        self._half, self._edge, self._halves, self._sampled = 0, plan.decimation, 0, False
        self._means = any(column.mean for column in plan.columns)

    @property
    def efforts(self) -> list[Effort]:
        """What the coupled stages took."""
        return [one.effort for one in self._coupled]

    @property
    def held(self) -> list[float]:
        """What columns hold that is not written yet."""
        return [*self._value, *self._sample]

    def run(self, ticks: int, signals: np.ndarray) -> np.ndarray:
        """Run ticks with signals of shape (signals, ticks); returns rows of shape (columns, rows)."""
        rows: list[list[float]] = []
        bus, plan = self.plan.bus, self.plan
        for k in range(ticks):
            bus[plan.signal : plan.signal + plan.signals] = signals[:, k]
            self._note(late=False)
            failed = any(take() for take in self._stages)
            self._note(late=True)
            self._record(rows)
            if failed:
                break
            self.tick += 1
        self._seen.status = 0
        return self._array(rows)

    def finish(self, signals: np.ndarray) -> None:
        """Begin the row at stop, where one falls due, with the signals of that tick, shape (signals, 1)."""
        if self.tick % self.plan.decimation:
            return
        self.plan.bus[self.plan.signal : self.plan.signal + self.plan.signals] = signals[:, 0]
        self._note(late=False)
        for part in self.plan.parts:
            self._gather(part)
        self._note(late=True)
        self._sample, self._sampled = list(self._value), True

    def flush(self) -> np.ndarray:
        """Return the row cut short by the end of the run, if there is one, shape (columns, 0 or 1)."""
        rows: list[list[float]] = []
        if self._sampled:
            self._emit(rows)
        return self._array(rows)

    def _taker(self, stage: PlannedStage) -> Callable[[], bool]:
        """Return what takes a stage and tells whether a component failed."""
        members = range(stage.part, stage.part + stage.parts)
        if isinstance(stage, Gather):
            return lambda: any(self._gather(self.plan.parts[index]) for index in members)
        if isinstance(stage, Step):
            return lambda: any(self._advance(index) for index in members)
        self._coupled.append(Iterating(self, stage) if isinstance(stage, Iterate) else Balancing(self, stage))
        return self._coupled[-1].take

    def _gather(self, part: Part) -> bool:
        if self.tick % part.every == 0:
            for link in part.links:
                self.plan.bus[link.target] = self.carry(link)
        return False

    def _advance(self, index: int) -> bool:
        part = self.enter(index)
        since = self.tick - self.tick % part.every
        status = self.set(index) if since == self.tick else OK
        if status <= WARNING and (self.tick + 1) % part.every == 0:
            time = float(self.tick + 1 - part.every) * self.plan.step
            status = max(status, part.component.step(time, float(part.every) * self.plan.step))
            if status <= WARNING:
                status = max(status, self.get(index))
            status = self.finite(index, status)
        return self.judge(index, status, since)

    def _note(self, late: bool) -> None:
        for number, column in enumerate(self.plan.columns):
            if column.late == late:
                self._value[number] = float(self.plan.bus[column.source])

    def _record(self, rows: list[list[float]]) -> None:
        if self.tick % self.plan.decimation == 0:
            self._sample = list(self._value)
            self._sampled = True
            if not self._means:
                self._emit(rows)
        if self._means:
            self._add_half(rows)
            self._add_half(rows)

    def _add_half(self, rows: list[list[float]]) -> None:
        if self._half == self._edge:
            self._emit(rows)
            self._edge += 2 * self.plan.decimation
        self._sum = [total + value for total, value in zip(self._sum, self._value, strict=True)]
        self._halves += 1
        self._half += 1

    def _emit(self, rows: list[list[float]]) -> None:
        pairs = zip(self.plan.columns, self._sum, self._sample, strict=True)
        rows.append([total / self._halves if column.mean else sample for column, total, sample in pairs])
        self._sum = [0.0] * len(self.plan.columns)
        self._halves, self._sampled = 0, False

    def _array(self, rows: list[list[float]]) -> np.ndarray:
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self.plan.columns)).T
