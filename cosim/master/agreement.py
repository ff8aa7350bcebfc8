"""Values at the start that depend on each other in a ring: inputs are sought that bring themselves about.

Wires are followed round the ring as often as it may take where the ring only seems to be one. What still changes then
is solved by a Newton method: that of Powell (MINPACK's hybrd and hybrj), with the directional derivatives of the FMUs
where all of them give some, else with differences, which it updates as a secant method does. Values that are no real
numbers are followed until they repeat themselves.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, NoReturn

import numpy as np

from cosim.fmi.types import FLOATS
from cosim.master.access import Access
from cosim.master.loop.part import carried
from cosim.master.start_graph import Arrival
from cosim.support.errors import StepError, WiringError
from cosim.system.plan import Plan
from cosim.system.ports import PortRef

TOLERANCE = {"Float64": 1e-9, "Float32": 1e-6}
"""Relative to the value, or to the first that the wire brought; of single precision some units in the last place."""
ROUNDS = 20
"""How often real numbers are solved for anew after values of other types have changed."""
DENSE = 200
"""Unknowns up to which a matrix of derivatives is built; more are solved by Krylov's method."""


@dataclass(frozen=True)
class Member:
    """A component that takes part: inputs that are sought, outputs that follow them, and what arrives at the inputs."""

    inputs: Access
    outputs: Access
    arriving: Sequence[Arrival]

    def derivatives(self, places: Sequence[int]) -> np.ndarray | None:
        """Return d outputs / d inputs, of these inputs by their places; None where the component gives none."""
        if not self.inputs.is_plain or not self.outputs.is_plain:
            return None
        chosen = np.flatnonzero(np.isin(self.inputs.places, places))
        return self.inputs.component.derivatives(self.outputs.references, self.inputs.references[chosen])


def arrive(plan: Plan, arrival: Arrival) -> None:
    """Put what a wire brings at the start on the bus.

    Raises:
        StepError: it is no finite number.
    """
    value = carried(plan.bus, arrival.link, 0, {})
    if not isfinite(value):
        name = PortRef(arrival.given).owner
        says = (
            f"{name} gave an output that is not a finite number at tick 0 ({plan.start:.9g} s), in initialisation mode"
        )
        raise StepError(f'{says}: "{arrival.given}" is {plan.bus[arrival.link.source]:g}.', component=name)
    plan.bus[arrival.link.target] = value


def is_close(arrival: Arrival, one: float, other: float, scale: float = 0.0) -> bool:
    """Say whether two values of a wire are the same, as far as its type can tell; `scale` is one that it had."""
    if one == other:
        return True
    within = TOLERANCE.get(arrival.target.type, 0.0)
    return abs(one - other) <= within * max(abs(one), abs(other), scale)


def is_settled(plan: Plan, members: Sequence[Member]) -> bool:
    """Read all outputs again and say whether the wires bring what the inputs were set to."""
    return _Ring(plan, members).is_settled()


def agree(plan: Plan, members: Sequence[Member]) -> None:
    """Set inputs to values that the wires bring when the components have them.

    Raises:
        WiringError: there are none, or they were not found; the sentence gives the residual.
        StepError: a component refuses.
    """
    _Ring(plan, members).solve()


class _Ring:
    def __init__(self, plan: Plan, members: Sequence[Member]) -> None:
        self.plan, self.members = plan, members
        self.arriving = [one for member in members for one in member.arriving]
        self.real = [one for one in self.arriving if one.target.type in FLOATS]
        self.other = [one for one in self.arriving if one.target.type not in FLOATS]
        self.scale: dict[Arrival, float] = {}
        self.evaluations = 0

    def solve(self) -> None:
        """Follow the wires as often as a chain of all members takes; then solve, from the start values or from there.

        Raises:
            WiringError, StepError: as of `agree`.
        """
        first = self._values()
        for member in self.members:
            member.outputs.get()
        for _ in range(len(self.members) + 1):
            for member in self.members:
                self._follow(member.arriving)
                self._evaluate(member)
            if self.is_settled(read=False):
                return
        tried = []
        for start in (first, self._values()) if self.real else ():
            self._begin_at(start)
            for _ in range(ROUNDS if self.other else 1):
                self._solve_reals()
                if self.is_settled():
                    return
                self._follow(self.other)
            tried.append((self._residual()[0], self._values()))
        if tried:
            self._begin_at(min(tried, key=lambda one: one[0])[1])
        self._fail()

    def _values(self) -> dict[Arrival, float]:
        return {one: float(self.plan.bus[one.link.target]) for one in self.arriving}

    def _begin_at(self, values: Mapping[Arrival, float]) -> None:
        """Go to these values of the inputs."""
        for one, value in values.items():
            self.plan.bus[one.link.target] = value
        for member in self.members:
            self._evaluate(member)

    def is_settled(self, read: bool = True) -> bool:
        """Say whether the wires bring what the inputs were set to; `read`: outputs are read again before."""
        for member in self.members if read else ():
            member.outputs.get()
        return all(self._is_settled(one) for one in self.arriving)

    def _is_settled(self, one: Arrival) -> bool:
        value, had = self._brought(one), float(self.plan.bus[one.link.target])
        return isfinite(value) and is_close(one, value, had, self.scale.get(one, 0.0))

    def _brought(self, one: Arrival) -> float:
        return carried(self.plan.bus, one.link, 0, {})

    def _follow(self, arrivals: Sequence[Arrival]) -> None:
        """Carry values to inputs; what is no number yet stays behind."""
        for one in arrivals:
            value = self._brought(one)
            if isfinite(value):
                self.scale.setdefault(one, abs(value))
                self.plan.bus[one.link.target] = value

    def _evaluate(self, member: Member) -> None:
        self.evaluations += 1
        member.inputs.set()
        member.outputs.get()

    def _solve_reals(self) -> None:
        from scipy.optimize import root  # most runs need none

        if not self.real:
            return
        targets = np.array([one.link.target for one in self.real])
        scales = np.array([abs(self.plan.bus[one.link.target]) or self.scale.get(one) or 1.0 for one in self.real])

        def residual(guess: np.ndarray) -> np.ndarray:
            self._set(guess * scales)
            brought = np.array([self._brought(one) for one in self.real])
            off: np.ndarray = (brought - self.plan.bus[targets]) / scales
            return off

        def slopes(guess: np.ndarray) -> np.ndarray | None:
            self._set(guess * scales)
            found = self._slopes()
            return None if found is None else found * scales / scales[:, None] - np.eye(len(targets))

        start = self.plan.bus[targets] / scales
        options: dict[str, Any] = {"jac": slopes} if slopes(start) is not None else {"options": {"eps": self._noise()}}
        dense = len(targets) <= DENSE
        with np.errstate(all="ignore"), suppress(ValueError):  # Krylov's method raises where it gets no further
            found = root(
                residual, start, **({"method": "hybr", "tol": 1e-13} | options if dense else {"method": "krylov"})
            )
            self._set(found.x * scales)

    def _set(self, values: np.ndarray) -> None:
        """Set the real inputs that are sought, and read what follows them."""
        for one, value in zip(self.real, values.tolist(), strict=True):
            single = one.target.type == "Float32"
            self.plan.bus[one.link.target] = float(np.float32(value)) if single else value
        for member in self.members:
            self._evaluate(member)

    def _noise(self) -> float:
        """Return the relative error of the functions, of which the square root is a good step for a difference."""
        single = any(one.target.type == "Float32" for one in self.real)
        return float(np.finfo(np.float32 if single else np.float64).eps)

    def _slopes(self) -> np.ndarray | None:
        """Return d(what wires bring) / d(what inputs are set to); None where a component gives no derivatives."""
        column = {one.link.target: place for place, one in enumerate(self.real)}
        found = np.zeros((len(column), len(column)))
        for member in self.members:
            inner = [place for place in member.inputs.places.tolist() if place in column]
            by_input = member.derivatives(inner)
            if by_input is None:
                return None
            row = {place: number for number, place in enumerate(member.outputs.places.tolist())}
            for place, one in enumerate(self.real):
                if one.link.source in row:
                    found[place, [column[one] for one in inner]] = one.link.gain * by_input[row[one.link.source]]
        straight = all(not (one.link.quantum or one.link.table or one.link.faults) for one in self.real)
        return found if straight else None

    def _residual(self) -> tuple[float, Arrival]:
        """Return the largest difference of what a wire brings and what its input was set to, relative to its values."""
        off = {one: abs(self._brought(one) - float(self.plan.bus[one.link.target])) for one in self.arriving}
        relative = {one: size / (abs(float(self.plan.bus[one.link.target])) or 1.0) for one, size in off.items()}
        worst = max(off, key=lambda one: relative[one] if isfinite(relative[one]) else inf)
        return relative[worst] if isfinite(relative[worst]) else inf, worst

    def _fail(self) -> NoReturn:
        worst = self._residual()[1]
        names = " -> ".join(dict.fromkeys(name for one in self.arriving for name in (one.given, one.taken) if name))
        had, brought = float(self.plan.bus[worst.link.target]), self._brought(worst)
        raise WiringError(
            f"The values at the start depend on each other and do not agree: {names}. With "
            f'"{worst.taken}" = {had:.6g} its wire brings {brought:.6g}, a residual of {abs(brought - had):.3g}, after '
            f"{self.evaluations:,} evaluations. Give inputs start values nearer to a solution by their parameters, or "
            f"write breaks_loop = true at the wire that shall not be followed at the start.",
            culprit=worst.taken,
            value=abs(brought - had),
        )
