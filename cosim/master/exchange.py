"""A component that is a model-exchange FMU: a built-in solver takes it from step to step.

RODAS4 with the tolerance of the FMU's default experiment (1e-8 where it has none) and a Jacobian by differences; time
events are met exactly, state events found within a step, inputs held over it (see exchange.c, which does the work).
"""

import ctypes
from collections.abc import Mapping
from ctypes import POINTER, Structure, c_double, c_int64, c_void_p
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from cosim.fmi.component import Functions, Port
from cosim.fmi.description import INTERFACES, describe
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.scheduled import ScheduledComponent
from cosim.fmi.types import elements, indexed
from cosim.master.loop import library
from cosim.support.errors import FmuError
from cosim.support.files import check_room

TOLERANCE = 1e-8
_REASONS = {
    1: "the matrix of its solver is singular",
    2: "its rates are not finite",
    3: "the steps of its solver became too small",
    4: "its solver took more than a million steps",
}
_CALLS = {
    2: {
        "set": "SetReal",
        "get": "GetReal",
        "set_time": "SetTime",
        "get_states": "GetContinuousStates",
        "set_states": "SetContinuousStates",
        "rates": "GetDerivatives",
        "indicators": "GetEventIndicators",
        "enter_event": "EnterEventMode",
        "enter_continuous": "EnterContinuousTimeMode",
        "update": "NewDiscreteStates",
        "completed": "CompletedIntegratorStep",
    }
}
_CALLS[3] = _CALLS[2] | {
    "set": "SetFloat64",
    "get": "GetFloat64",
    "rates": "GetContinuousStateDerivatives",
    "update": "UpdateDiscreteStates",
}


class _Exchange(Structure):
    _fields_ = [
        ("version", c_int64),
        ("instance", c_void_p),
        *((name, c_void_p) for name in _CALLS[2]),
        ("states", c_int64),
        ("indicated", c_int64),
        ("tolerance", c_double),
        *((name, c_void_p) for name in ("nominals", "x", "kept", "slope", "shifted", "before", "after")),
        ("work", c_void_p),
        ("pivots", c_void_p),
        ("next", c_double),
        ("proposed", c_double),
        ("has_next", c_int64),
        ("in_event", c_int64),
        ("result", c_int64),
        ("culprit", c_int64),
        ("altered", c_void_p),
    ]


class ExchangeComponent(FmuComponent):
    """One instance of a model-exchange FMU with a solver; cannot be taken back.

    Args:
        path: the .fmu file.
        name: what the component is called in messages; the model's name where not given.
        description: what `describe` read of it, if that was done before.

    Raises:
        FmuError: as of `FmuComponent`, or the compiled loop is missing, in which the solver lives.
    """

    interface = "modelExchange"
    event_at_start = True

    def __init__(self, path: Path | str, name: str = "", description: Any = None) -> None:
        found = library()
        if found is None:
            message = f"{path} is for model exchange, and its solver needs the compiled loop, which is missing here."
            raise FmuError(message, culprit=str(path))
        self._library = found
        super().__init__(path, name, description)

    def enter_initialisation(self, parameters: Mapping[str, Any], time: float = 0.0) -> None:
        """Set parameters and start values by name for a start at `time` [s]; a second call starts all over again."""
        self._exchange.in_event, self._exchange.has_next, self._exchange.proposed = 1, 0, 0.0
        super().enter_initialisation(parameters, time)
        if self._sizes:
            self._make_room()

    def exit_initialisation(self) -> None:
        """End initialisation mode and ask for the nominals of the states."""
        super().exit_initialisation()
        count = self._exchange.states
        if count:
            nominals = ctypes.cast(self._exchange.nominals, POINTER(c_double))
            try:
                with self._foreign("initialised"):
                    self._fmu.getNominalsOfContinuousStates(nominals, count)
            except Exception as error:
                self.failed(getattr(error, "status", 0))
                reason = f"it gives no nominals of its {count:,} states: {self._reason(error)}"
                raise FmuError(f"{self.name} ({self.path}) does not start: {reason}.") from error
            given = self._arrays_kept["nominals"]
            given[~((given > 0) & np.isfinite(given))] = 1.0  # FMI wants them above 0 and takes 1 where nothing is said

    def messages(self) -> tuple[str, ...]:
        """What the FMU said last, or why its solver failed."""
        reason = _REASONS.get(self._exchange.result)
        return (*super().messages(), *([f"{reason}, because of {self._culprit()}"] if reason else []))

    @property
    def can_get_and_set_state(self) -> bool:
        """Steps of the solver are not taken back."""
        return False

    @property
    def can_vary_step(self) -> bool:
        """Steps of any length."""
        return True

    def _culprit(self) -> str:
        names = [name for one in self._derivatives() for name in self._elements(one.name)]
        return names[self._exchange.culprit] if names else "?"

    def _elements(self, name: str) -> list[str]:
        """Name the elements of a state that is an array."""
        shape = self.ports[name].shape
        return [indexed(name, index) for index in elements(shape)] if shape else [name]

    def _derivatives(self) -> list[Any]:
        return [unknown.variable.derivative for unknown in self._description.derivatives]

    def _functions(self) -> Functions:
        self._exchange = self._made()
        self._make_room()
        addresses = {
            name: ctypes.cast(getattr(self._library, f"exchange_{name}"), c_void_p).value or 0
            for name in ("set", "get", "step")
        }
        return Functions(2, ctypes.addressof(self._exchange), **addresses, altered=self.guard.address)

    def _made(self) -> _Exchange:
        """Fill the structure of exchange.c; its arrays live as long as the component."""
        description, kind = self._description, "fmi2" if self._version == 2 else "fmi3"
        calls = {name: f"{kind}{call}" for name, call in _CALLS[self._version].items()}
        if not description.modelExchange.needsCompletedIntegratorStep:
            del calls["completed"]
        experiment = description.defaultExperiment
        instance = self._fmu.component
        return _Exchange(
            version=self._version,
            instance=getattr(instance, "value", instance),
            tolerance=float(experiment.tolerance) if experiment and experiment.tolerance else TOLERANCE,
            altered=self.guard.address,
            **{name: self._address(call) for name, call in calls.items()},
        )

    def _make_room(self) -> None:
        """Give the solver arrays of the size that the states have; an array of states has one for each element."""
        count = sum(len(self._elements(one.name)) for one in self._derivatives())
        indicated = sum(max(prod(port.shape), 1) for port in self._indicators()) or self._indicated()
        sizes = dict.fromkeys(("nominals", "x", "kept", "slope", "shifted"), count)
        sizes |= {"before": indicated, "after": indicated, "work": count * count + 12 * count}
        check_room(None, 8 * sum(sizes.values()), f"the solver of {self.name} keeps a matrix of {count:,} states")
        self._arrays_kept = {name: np.ones(max(size, 1)) for name, size in sizes.items()}
        self._pivots = np.zeros(max(count, 1), dtype=np.int32)
        self._exchange.states, self._exchange.indicated = count, indicated
        for name, array in (self._arrays_kept | {"pivots": self._pivots}).items():
            setattr(self._exchange, name, array.ctypes.data)

    def _indicators(self) -> list[Port]:
        """List the event indicators that are variables, as in FMI 3."""
        listed = getattr(self._description, "eventIndicators", None) or ()
        return [self.ports[one.variable.name] for one in listed if one.variable.name in self.ports]

    def _indicated(self) -> int:
        return int(self._description.numberOfEventIndicators or 0)

    def _address(self, call: str) -> int:
        return ctypes.cast(getattr(self._fmu.dll, call), c_void_p).value or 0


def open_fmu(path: Path | str, name: str = "", interface: str = "") -> FmuComponent:
    """Open an FMU by its interface: the one named, or the first it has of co-simulation, model exchange, scheduled.

    Raises:
        FmuError: see the components.
    """
    description = describe(Path(path))
    have = [word for key, word in INTERFACES.items() if getattr(description, key) is not None]
    return _KINDS[interface or next(iter(have), "co-simulation")](path, name, description)


_KINDS: dict[str, type[FmuComponent]] = {
    "co-simulation": FmuComponent,
    "model-exchange": ExchangeComponent,
    "scheduled-execution": ScheduledComponent,
}
