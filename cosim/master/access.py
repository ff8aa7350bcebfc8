"""Some variables of a component apart from its others, for the time before the loop: read and set one by one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from cosim.fmi.component import DISCARD, FATAL, NOT_EXACT, POOL_FULL, STATUSES, TERMINATED, WARNING, Component
from cosim.master.typed import TypedComponent
from cosim.support.activity import doing
from cosim.support.errors import StepError
from cosim.system.plan import Failure, Part, Plan


@dataclass(frozen=True)
class Access:
    """Inputs of a part, or outputs: their places on the bus, and their component as it takes them."""

    plan: Plan
    number: int
    component: Component
    places: np.ndarray
    references: np.ndarray

    @classmethod
    def of(cls, plan: Plan, number: int, indices: Sequence[int], inputs: bool) -> "Access":
        """Reach inputs (or outputs) of the part with this number, by their index among those that are on the bus."""
        part = plan.parts[number]
        component, chosen = part.component, np.array(indices, dtype=np.int64)
        if isinstance(component, TypedComponent):
            component = component.narrowed(indices, inputs)
        references = part.input_references if inputs else part.output_references
        first = part.input if inputs else part.output
        return cls(plan, number, component, first + chosen, np.ascontiguousarray(references[chosen]))

    def set(self, lenient: bool = False) -> str:
        """Set the inputs to what the bus has.

        Args:
            lenient: a value that the type of an input does not hold is not set, and the reason is returned.

        Raises:
            StepError: the component refuses.
        """
        with doing(self.part.name, "initialised"):
            status = self.component.set(self.references, self.plan.bus[self.places])
        if status == NOT_EXACT and lenient:
            return self.component.messages()[-1]
        if status > WARNING:
            self._refused(status)
        return ""

    def get(self) -> None:
        """Put the outputs on the bus; not a number where the component cannot compute them yet.

        Raises:
            StepError: the component refuses.
        """
        values = np.empty(len(self.places))
        with doing(self.part.name, "initialised"):
            status = self.component.get(self.references, values)
        if status > WARNING and status != DISCARD:
            self._refused(status)
        self.plan.bus[self.places] = values if status != DISCARD else np.nan

    @property
    def is_plain(self) -> bool:
        """Whether the variables are doubles, one by one."""
        return not isinstance(self.component, TypedComponent)

    @property
    def part(self) -> Part:
        """The part that the variables are of."""
        return self.plan.parts[self.number]

    def _refused(self, status: int) -> NoReturn:
        tell_failed(self.plan, self.part.component, status)
        when = f"at tick 0 ({self.plan.start:.9g} s), in initialisation mode"
        raise refusal(self.plan, Failure(self.number, 0, status), self.component, when)


def refusal(plan: Plan, failure: Failure, component: Component, when: str) -> StepError:
    """Return the error of a component that failed: its last words, or why a value does not fit, and its inputs."""
    name, inputs = plan.parts[failure.part].name, plan.inputs(failure.part)
    what = STATUSES.get(failure.status, f"returned status {failure.status}")
    ours = failure.status in (NOT_EXACT, POOL_FULL)
    said = "".join(f": {text}" if ours else f'; it said "{text}"' for text in component.messages()[-1:])
    shown = getattr(component, "shown", lambda _, value: f"{value:.9g}")
    last = ", ".join(f"{key} = {shown(key, value)}" for key, value in inputs.items()) or "none"
    message = f"{name} {what} {when}{said}; its last inputs: {last}."
    return StepError(message, component=name, tick=failure.tick, inputs=inputs)


def who_ended(plan: Plan, failure: Failure) -> str:
    """Say which component asked to end the simulation, and when.

    Raises:
        StepError: it did not ask, it failed.
    """
    part = plan.parts[failure.part]
    component = part.component
    when = f"at tick {failure.tick:,} ({plan.start + failure.tick * plan.step:.9g} s)"
    if failure.status == TERMINATED or (failure.status == DISCARD and getattr(component, "terminated", bool)()):
        return f"{part.name} asked to end the simulation {when}"
    tell_failed(plan, component, failure.status)
    raise refusal(plan, failure, component, when)


def tell_failed(plan: Plan, component: Component, status: int) -> None:
    """Let components know which calls are still allowed; FATAL counts for all instances of one FMU."""
    same = component.origin.get("sha256")
    for other in (part.component for part in plan.parts):
        if other is component or (status == FATAL and same and other.origin.get("sha256") == same):
            other.failed(status)
