"""The contract of what a master steps.

Call sequence, once each unless said otherwise:

    1. `ports`                      names, references, causality and units, before anything runs
    2. `enter_initialisation(...)`  sets parameters and start values and enters initialisation mode
    3. `set`, `get`                 of inputs and outputs, as often as the master needs to make them agree at the start;
                                    `get` of what `initial_dependencies` names only
    4. `exit_initialisation()`      the component has its state at the start time
    5. `get`, `set`, `step`         in every tick, or their addresses in `functions`, called by the C loop;
       `save`, `restore`            around steps that are taken back, where `can_get_and_set_state` says that it can
    6. `failed(status)`             after a call that returned a status above 1; then nothing more is called but close
    7. `close()`                    frees everything, whatever happened before

Statuses are those of FMI: 0 OK, 1 warning, 2 discard, 3 error, 4 fatal; above 1 a component must not be stepped again.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, Protocol

import numpy as np

from cosim.fmi.guard import Guard

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
NOT_FINITE, TERMINATED, NOT_AGREED, NOT_EXACT, POOL_FULL, EARLY = range(100, 106)
STATUSES = {
    DISCARD: "discarded the step",
    ERROR: "returned an error",
    FATAL: "failed for good",
    5: "left the step pending",
    NOT_FINITE: "gave an output that is not a finite number",
    NOT_AGREED: "and those coupled with it did not agree within the iterations allowed",
    NOT_EXACT: "met a value that its type does not hold",
    POOL_FULL: "gave more texts and binaries than there is room for",
    EARLY: "returned early from its step, though early return is not allowed here,",
}


@dataclass(frozen=True, slots=True)
class Port:
    """A variable of a component as the outside sees it, or an element of an array; `unit` is empty where unknown.

    `type` is FMI 3's name of it. `items` are the names of an enumeration's values. An array has a `shape`; each of its
    elements is a port too, with the array's name as `array` and its place in FMI's order as `element`. `not_settable`
    says why no parameter or start value can be given to it; it is empty where one can.
    """

    name: str
    reference: int
    causality: str
    unit: str = ""
    description: str = ""
    start: Any = None
    low: float = -inf
    high: float = inf
    not_settable: str = "takes no start value"
    type: str = "Float64"
    items: Mapping[int, str] = field(default_factory=dict)
    shape: tuple[int, ...] = ()
    array: str = ""
    element: int = 0

    @property
    def real(self) -> bool:
        """Whether it is one double, which needs no conversion."""
        return self.type == "Float64" and not self.shape and not self.array

    @property
    def settable(self) -> bool:
        """Whether a parameter or start value can be given to it."""
        return not self.not_settable

    @property
    def variable(self) -> str:
        """The variable that it is, or is an element of."""
        return self.array or self.name


@dataclass(frozen=True)
class Functions:
    """Addresses that the compiled loop calls: set, get and step of reals in FMI `version` 2 or 3.

    `save` and `restore` are those of the FMU's state, 0 where it cannot be taken back; `state` is where it is kept.
    `altered` is where the loop notes what a call changed that it must not (`cosim.fmi.guard`), 0 for nowhere.
    """

    version: int
    instance: int
    set: int
    get: int
    step: int
    save: int = 0
    restore: int = 0
    state: int = 0
    altered: int = 0


class Component(Protocol):
    """Anything a master can step."""

    name: str
    origin: dict[str, Any]

    @property
    def guard(self) -> Guard:
        """What puts back what the component changes in this process, and says it."""

    @property
    def ports(self) -> Mapping[str, Port]:
        """Variables by name."""

    @property
    def feedthrough(self) -> Mapping[str, frozenset[str] | None]:
        """The inputs that each output follows at once, without a step; None where nothing is said about it."""

    @property
    def initial_dependencies(self) -> Mapping[str, frozenset[str] | None]:
        """The inputs that each variable that can be read in initialisation mode follows there; None: it may be all."""

    @property
    def event_at_start(self) -> bool:
        """Whether an event is due after initialisation; with what it changes it belongs to the first step."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """What its description says that cannot be right, as sentences; it runs all the same."""

    @property
    def own_step(self) -> float:
        """The length of its own steps in s, of which each of the master's should be a multiple; 0 where it has none."""

    @property
    def can_get_and_set_state(self) -> bool:
        """Whether `save` and `restore` work."""

    @property
    def can_vary_step(self) -> bool:
        """Whether steps may differ in length."""

    @property
    def functions(self) -> Functions | None:
        """Addresses for the compiled loop; None for a component that only Python can step."""

    def enter_initialisation(self, parameters: Mapping[str, Any], time: float = 0.0) -> None:
        """Set parameters and start values by name for a start at `time` [s]; may be called again for another run."""

    def exit_initialisation(self) -> None:
        """End initialisation mode."""

    def derivatives(self, outputs: np.ndarray, inputs: np.ndarray) -> np.ndarray | None:
        """Return d outputs / d inputs in initialisation mode, shape (outputs, inputs); None where it gives none.

        Args:
            outputs: value references, uint32.
            inputs: the same.
        """

    def set(self, references: np.ndarray, values: np.ndarray) -> int:
        """Set real inputs; references uint32, values float64, shape (n,)."""

    def get(self, references: np.ndarray, values: np.ndarray) -> int:
        """Write the values of real variables into `values`."""

    def step(self, time: float, size: float, final: bool = True) -> int:
        """Go from `time` to `time + size`, both in s; `final` False: the step may be taken back."""

    def save(self) -> int:
        """Keep the state as it is now, in the place of the one kept before."""

    def restore(self) -> int:
        """Go back to the state kept."""

    def failed(self, status: int) -> None:
        """Hear that a call returned this status, so that `close` calls only what is still allowed."""

    def messages(self) -> tuple[str, ...]:
        """What the component said last, newest at the end."""

    def close(self) -> None:
        """Free everything; may be called twice."""
