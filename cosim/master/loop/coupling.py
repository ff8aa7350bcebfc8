"""Components taken over one tick together, in Python.

Does what coupling.c does, bit for bit; see there for the methods.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import sqrt
from typing import Any

from cosim.fmi.component import NOT_AGREED, WARNING
from cosim.master.loop.part import Parts
from cosim.system.plan import Balance, Effort, Inner, Iterate, Link


@dataclass
class _Wire:
    """An inner wire and what is remembered of it."""

    inner: Inner
    link: Link
    start: float = 0.0
    held: float = 0.0
    guess: float = 0.0
    residual: float = 0.0
    scale: float = 0.0
    slope: float = 0.0


class Coupled(ABC):
    """What both methods share: hold inputs, step, and read the outputs that belong to the inputs at the end."""

    def __init__(self, loop: Parts, stage: Any) -> None:
        self.loop, self.stage, self.effort = loop, stage, Effort()
        parts = loop.plan.parts
        self.wires = [_Wire(inner, parts[inner.part].links[inner.link]) for inner in stage.inner]
        self.members = range(stage.part, stage.part + stage.parts)

    @abstractmethod
    def take(self) -> bool:
        """Take the components over the tick; returns whether one failed."""

    def into(self, index: int) -> list[_Wire]:
        """List the inner wires that feed a part."""
        return [wire for wire in self.wires if wire.inner.part == index]

    def begin(self) -> None:
        """Note what was gathered for the start of the tick."""
        for wire in self.wires:
            wire.start = float(self.loop.plan.bus[wire.link.target])

    def step_held(self, index: int, time: float, size: float, final: bool) -> int:
        """Step one component with the held inputs; returns its worst status."""
        for wire in self.into(index):
            self.loop.plan.bus[wire.link.target] = wire.held
        status = self.loop.set(index)
        component = self.loop.plan.parts[index].component
        return status if status > WARNING else max(status, component.step(time, size, final))

    def read_at_end(self, index: int) -> int:
        """Read the outputs that belong to the inputs guessed for the end; the bus keeps the inputs that were held."""
        for wire in self.into(index):
            self.loop.plan.bus[wire.link.target] = wire.guess
        status = self.loop.set(index)
        if status <= WARNING:
            status = max(status, self.loop.get(index))
        for wire in self.into(index):
            self.loop.plan.bus[wire.link.target] = wire.held
        return self.loop.finite(index, status)


class Iterating(Coupled):
    """The theta method, iterated with rollback."""

    stage: Iterate
    relaxation = 1.0

    def take(self) -> bool:
        """Iterate until the wires that point back agree."""
        self.begin()
        for wire in self.wires:
            wire.guess = wire.start
        if self._all("save"):
            return True
        for round_ in range(1, self.stage.most + 1):
            if self._sweep():
                return True
            self.effort.rounds += 1
            self.effort.greatest = max(self.effort.greatest, round_)
            if self._agree(round_):
                return False
            if round_ < self.stage.most and self._all("restore"):
                return True
        return self.loop.judge(self.stage.part, NOT_AGREED)

    def _all(self, what: str) -> bool:
        components = ((index, self.loop.plan.parts[index].component) for index in self.members)
        return any(self.loop.judge(index, getattr(component, what)()) for index, component in components)

    def _sweep(self) -> bool:
        loop, time = self.loop, float(self.loop.tick) * self.loop.plan.step
        for index in self.members:
            for wire in self.into(index):
                wire.guess = wire.guess if wire.inner.back else loop.carry(wire.link)
                wire.held = wire.start + self.stage.theta * (wire.guess - wire.start)
            status = self.step_held(index, time, loop.plan.step, False)
            if status <= WARNING:
                status = max(status, self.read_at_end(index))
            if loop.judge(index, status):
                return True
        return False

    def _agree(self, round_: int) -> bool:
        back, agreed, above, below = [wire for wire in self.wires if wire.inner.back], True, 0.0, 0.0
        for wire in back:
            value = self.loop.carry(wire.link)
            residual = value - wire.guess
            wire.scale = max(wire.scale, abs(value))
            if abs(residual) > self.stage.tolerance * wire.scale:
                change = (residual - wire.residual) / wire.scale
                agreed = False
                above += wire.residual / wire.scale * change
                below += change * change
            wire.residual = residual
        if round_ > 1 and below > 0.0 and above != 0.0:
            self.relaxation = -self.relaxation * above / below
        for wire in back if not agreed else ():
            wire.guess += self.relaxation * wire.residual
        return agreed


class Balancing(Coupled):
    """Pieces of the tick whose size follows the energy that is lost on the bonds."""

    stage: Balance
    size, error = 1.0, 0.0

    def __init__(self, loop: Parts, stage: Balance) -> None:
        super().__init__(loop, stage)
        self.scales = [0.0] * len(stage.bonds)

    def take(self) -> bool:
        """Take piece after piece."""
        loop, most = self.loop, self.stage.most
        self.begin()
        position, pieces = 0, 0
        while position < most:
            units = _fitting(self.size, position, most)
            size = loop.plan.step * (float(units) / float(most))
            time = loop.plan.step * (float(loop.tick) + float(position) / float(most))
            if self._piece(time, size):
                return True
            error = self._account(size)
            self.effort.at_limit += units == 1 and error > 1.0
            self.size = min(max(1.0, self.size * _growth(self.error, error)), float(most))
            self.error = error
            position += units
            pieces += 1
        self.effort.rounds += pieces
        self.effort.greatest = max(self.effort.greatest, pieces)
        return False

    def _piece(self, time: float, size: float) -> bool:
        loop = self.loop
        for wire in self.wires:
            wire.held = wire.start + wire.slope * size / 2.0
        for index in self.members:
            status = self.step_held(index, time, size, True)
            if status <= WARNING:
                status = loop.finite(index, max(status, loop.get(index)))
            if loop.judge(index, status):
                return True
        for wire in self.wires:
            wire.guess = loop.carry(wire.link)
        return any(loop.judge(index, self.read_at_end(index)) for index in self.members)

    def _account(self, size: float) -> float:
        worst = 0.0
        for wire in self.wires:
            wire.guess = self.loop.carry(wire.link)
        for number, (first, second) in enumerate(self.stage.bonds):
            one, other = self.wires[first], self.wires[second]
            mean, other_mean = (one.start + one.guess) / 2.0, (other.start + other.guess) / 2.0
            lost = abs(other.held * mean - one.held * other_mean) * size
            scale = self.scales[number] = max(self.scales[number], abs(one.guess * other.guess))
            if scale > 0.0:
                worst = max(worst, lost / (self.stage.tolerance * scale * self.loop.plan.step))
        for wire in self.wires:
            wire.slope = (wire.guess - wire.start) / size
            wire.start = wire.guess
        return worst


def _growth(before: float, error: float) -> float:
    if error == 0.0:
        return 1.5
    before = before if before > 0.0 else error
    factor = 0.9 * sqrt(sqrt(sqrt(1.0 / error) * (before / error)))
    return 1.5 if factor > 1.5 else factor if factor >= 0.2 else 0.2


def _fitting(size: float, position: int, most: int) -> int:
    found = 1
    while 2 * found <= most and float(2 * found) <= size and position % (2 * found) == 0:
        found *= 2
    return found
