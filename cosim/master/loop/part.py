"""The components of a plan and the wires between them, in Python: what a loop and a coupling both take.

Does what part.h and part.c do, bit for bit; see there for the meaning of each function.
"""

from math import floor, isfinite

import numpy as np

from cosim.fmi.component import NOT_FINITE, OK, WARNING
from cosim.master.loop.structures import CLoop
from cosim.support.activity import board
from cosim.system.plan import Failure, Link, Part, Plan


class Parts:
    """The bus of a plan at one tick, with its components: values are carried, set, stepped over, got and judged."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._seen = board().loop(CLoop, [part.name for part in plan.parts])
        self.tick, self.warnings = 0, 0
        self.failure: Failure | None = None
        self._frozen: dict[tuple[int, int], float] = {}

    def carry(self, link: Link) -> float:
        """Return what a wire gives now."""
        return carried(self.plan.bus, link, self.tick, self._frozen)

    def enter(self, index: int) -> Part:
        """Return a part whose functions will be called now, and note it where another process can read it."""
        self._seen.status, self._seen.tick = -1 - index, self.tick
        return self.plan.parts[index]

    def set(self, index: int) -> int:
        """Set the inputs of a part from the bus; returns the status."""
        part = self.enter(index)
        count = len(part.input_references)
        values = self.plan.bus[part.input : part.input + count]
        return part.component.set(part.input_references, values) if count else OK

    def get(self, index: int) -> int:
        """Get the outputs of a part to the bus; returns the status."""
        part = self.enter(index)
        count = len(part.output_references)
        values = self.plan.bus[part.output : part.output + count]
        return part.component.get(part.output_references, values) if count else OK

    def finite(self, index: int, status: int) -> int:
        """Return the status, or NOT_FINITE where an output of a part is not a finite number."""
        part = self.plan.parts[index]
        outputs = self.plan.bus[part.output : part.output + len(part.output_references)]
        return NOT_FINITE if status <= WARNING and not all(map(isfinite, outputs)) else status

    def judge(self, index: int, status: int, since: int | None = None) -> bool:
        """Count a warning and note a failure; returns whether it is one."""
        self.warnings += status == WARNING
        if status > WARNING:
            self.failure = Failure(index, self.tick if since is None else since, status)
        return status > WARNING


def carried(bus: np.ndarray, link: Link, tick: int, frozen: dict[tuple[int, int], float]) -> float:
    """Return what a wire gives at a tick; `frozen` remembers what its faults hold."""
    value = link.gain * float(bus[link.source]) + link.offset
    if link.quantum > 0.0:
        value = link.quantum * float(floor(value / link.quantum + 0.5))
    value = value if link.noise < 0 else value + float(bus[link.noise])
    value = next((target for source, target in link.table if source == value), value)
    for number, fault in enumerate(link.faults):
        if fault.first <= tick < fault.last:
            if fault.freeze:
                value = frozen.setdefault((link.target, number), value)
            else:
                value = fault.gain * value + fault.offset
                value = value if fault.noise < 0 else value + float(bus[fault.noise])
    return value
