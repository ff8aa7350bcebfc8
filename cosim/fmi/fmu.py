"""A component that is an FMU: FMPy reads, unpacks and starts it, the loop calls its functions directly.

FMI 2.0 and 3.0, co-simulation. Unpacked files live in a temporary directory that goes with the component.
"""

import ctypes
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cosim.fmi.component import EARLY, ERROR, FATAL, OK, TERMINATED, WARNING, Functions, Port
from cosim.fmi.description import (
    check_binary,
    complaint_of,
    describe,
    feedthrough_of,
    first_line,
    initial_dependencies_of,
    origin_of,
    own_interface,
    own_step_of,
    provides_derivatives,
)
from cosim.fmi.domain import Domain, domains_at
from cosim.fmi.guard import Guard
from cosim.fmi.listeners import callbacks2, registered, same_directory
from cosim.fmi.own_starts import own_starts
from cosim.fmi.settings import STRUCTURAL, Setting, settings_of, sizes_of, tell
from cosim.fmi.sound import doubts_of
from cosim.fmi.variables import ports_of
from cosim.support.activity import doing
from cosim.support.archive import unpack
from cosim.support.errors import CosimError, FmuError
from cosim.support.scratch import Scratch

_TERMINATED = 3
"""fmi2Terminated of fmi2StatusKind."""
_STEP2 = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)
_VALUES2 = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
_SAVE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
_VALUES3 = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t
)


class FmuComponent:
    """One instance of an FMU.

    Args:
        path: the .fmu file.
        name: what the component is called in messages; the model's name where not given.
        description: what `describe` read of it, if that was done before.
        tolerance: relative tolerance of the FMU's own solver; the FMU's default where not given.

    Raises:
        FmuError: the file is no FMU, has no binary for this platform, or cannot be instantiated.
    """

    interface = "coSimulation"
    """The element of the model description that must be there."""
    event_at_start = False
    """Whether an event is due once initialisation is over."""

    def __init__(
        self, path: Path | str, name: str = "", description: Any = None, tolerance: float | None = None
    ) -> None:
        self.path = Path(path)
        self._description = description or describe(self.path)
        self._own = own_interface(self.path, self._description, self.interface)
        self.name = name or self._description.modelName
        self._tolerance = tolerance
        self.ports: Mapping[str, Port] = ports_of(self._description)
        self._sizes: Mapping[str, int] = {}
        self._starts: Mapping[str, float] = own_starts(self.path)
        self.feedthrough = feedthrough_of(self._description)
        self.origin: dict[str, Any] = origin_of(self.path, self._description)
        self._messages: deque[str] = deque(maxlen=5)
        self._started = False
        self._worst = OK
        self._state = ctypes.c_void_p()
        self.guard = Guard()
        """Puts back what the FMU changes in this process."""
        self._directory = Scratch()
        try:
            with self._foreign("loaded"):
                self._fmu = self._instantiate()
            self.functions: Functions | None = self._functions()
            self._set, self._get, self._step = self._callables()
        except BaseException:
            self._directory.cleanup()
            raise

    @cached_property
    def domains(self) -> tuple[Domain, ...]:
        """Where the FMU is proven, as its metadata state it."""
        return domains_at(self.path)

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Give arrays the size that structural parameters among these ask for; others wait for initialisation.

        Raises:
            FmuError: a value is none of the parameter's.
        """
        sizes = sizes_of(self.ports, self.name, parameters)
        if sizes != self._sizes:
            self._sizes, self.ports = sizes, ports_of(self._description, sizes)

    def start(self, parameters: Mapping[str, Any], time: float = 0.0) -> None:
        """Initialise alone, with inputs at their start values; errors as of `enter_initialisation`."""
        self.enter_initialisation(parameters, time)
        self.exit_initialisation()

    def enter_initialisation(self, parameters: Mapping[str, Any], time: float = 0.0) -> None:
        """Set parameters and start values by name for a start at `time` [s]; a second call starts all over again.

        Inputs are set once the FMU is in initialisation mode, everything else before (FMI 2.0.5, 4.2.4; 3.0.2, 2.3.3).

        Raises:
            FmuError: a name is unknown or not settable, a value breaks its bounds, or the FMU refuses.
        """
        if self._worst == FATAL:
            raise FmuError(f"{self.name} ({self.path}) failed for good and cannot start again; open it anew.")
        settings = self.settings(parameters)
        with self._starting():
            if self._started:
                self._fmu.reset()
                self._worst = OK
            self._enter_initialisation(settings, time)

    def settings(self, parameters: Mapping[str, Any]) -> list[Setting]:
        """What these parameters and start values set, beside start values of the FMU that its binary does not know."""
        self.configure(parameters)
        return settings_of(self.ports, self.name, {**self._starts, **parameters})

    def _enter_initialisation(self, settings: Sequence[Setting], time: float) -> None:
        structural = [one for one in settings if one.port.causality == STRUCTURAL]
        inputs = [one for one in settings if one.port.causality == "input"]
        if structural:
            self._fmu.enterConfigurationMode()
            tell(self._fmu, self._version, structural)
            self._fmu.exitConfigurationMode()
        tell(self._fmu, self._version, [one for one in settings if one not in structural and one not in inputs])
        if self._version == 2:
            self._fmu.setupExperiment(tolerance=self._tolerance, startTime=time)
        self._started = True
        experiment = {} if self._version == 2 else {"tolerance": self._tolerance, "startTime": time}
        self._fmu.enterInitializationMode(**experiment)
        tell(self._fmu, self._version, inputs)

    def exit_initialisation(self) -> None:
        """End initialisation mode.

        Raises:
            FmuError: the FMU refuses.
        """
        with self._starting():
            self._fmu.exitInitializationMode()

    @contextmanager
    def _starting(self) -> Iterator[None]:
        """Turn what an FMU refuses on its way through initialisation into a sentence."""
        try:
            with self._foreign("initialised"):
                yield
        except CosimError:
            raise
        except Exception as error:
            self.failed(getattr(error, "status", 0))
            raise FmuError(f"{self.name} ({self.path}) does not start: {self._reason(error)}.") from error

    def derivatives(self, outputs: np.ndarray, inputs: np.ndarray) -> np.ndarray | None:
        """Return d outputs / d inputs, shape (outputs, inputs), of scalar reals; None where the FMU gives none."""
        if not self._gives_derivatives:
            return None
        columns = []
        for one in inputs.tolist():
            try:
                columns.append(self._fmu.getDirectionalDerivative(outputs.tolist(), [one], [1.0]))
            except Exception as error:  # a master can do without
                self.failed(getattr(error, "status", 0))
                self._gives_derivatives = False
                return None
        return np.array(columns, dtype=np.float64).T

    def set(self, references: np.ndarray, values: np.ndarray) -> int:
        """Set real inputs; references uint32, values float64, shape (n,), contiguous."""
        return self.guard.after(int(self._set(*self._arrays(references, values))))

    def get(self, references: np.ndarray, values: np.ndarray) -> int:
        """Write the values of real variables into `values`."""
        return self.guard.after(int(self._get(*self._arrays(references, values))))

    def step(self, time: float, size: float, final: bool = True) -> int:
        """Go from `time` to `time + size`, both in s; `final` False: the step may be taken back."""
        return self.guard.after(int(self._step(time, size, final)))

    def save(self) -> int:
        """Keep the state as it is now, in the place of the one kept before."""
        assert self.functions is not None
        return self.guard.after(_SAVE(self.functions.save)(self._fmu.component, ctypes.addressof(self._state)))

    def restore(self) -> int:
        """Go back to the state kept."""
        assert self.functions is not None
        return self.guard.after(_SAVE(self.functions.restore)(self._fmu.component, self._state.value))

    def messages(self) -> tuple[str, ...]:
        """What the FMU said last, newest at the end."""
        return tuple(self._messages)

    def failed(self, status: int) -> None:
        """Hear that a call returned this status: after an error only freeing is allowed, after a fatal one nothing."""
        self._worst = max(self._worst, status)

    def terminated(self) -> bool:
        """Say whether a step was discarded because the FMU asks to end the simulation (FMI 2; FMI 3 says it itself)."""
        if self._version != 2 or self.interface != "coSimulation":
            return False
        try:
            with self.guard.kept():
                return bool(self._fmu.getBooleanStatus(_TERMINATED))
        except Exception:  # an FMU without asynchronous steps need not know
            return False

    def close(self) -> None:
        """Free instance, library and unpacked files as far as FMI allows it; may be called twice."""
        fmu, self._fmu = self._fmu, None
        if fmu is not None and self._worst != FATAL:
            with self._foreign("closed"):
                self._free(fmu)
        self.guard.release()
        self._directory.cleanup()

    def _free(self, fmu: Any) -> None:
        self._forget(fmu)
        with suppress(Exception):  # an FMU may refuse to be terminated; it is freed all the same
            if self._worst < ERROR:
                fmu.terminate()
        with suppress(Exception):
            self._unload(fmu)

    def _unload(self, fmu: Any) -> None:
        """Free the instance and its library, unless threads still run in it: without their code they would crash."""
        getattr(fmu, f"fmi{self._version}FreeInstance")(fmu.component)
        if not self.guard.left_threads():
            fmu.freeLibrary()

    @contextmanager
    def _foreign(self, what: str) -> Iterator[None]:
        """Enter the FMU's code, for what can be said in a word: "loaded"."""
        with doing(self.name, what), self.guard.kept():
            yield

    def _forget(self, fmu: Any) -> None:
        """Free the state kept."""
        if self._state.value and self._worst < ERROR:
            name = "fmi2FreeFMUstate" if self._version == 2 else "fmi3FreeFMUState"
            _SAVE((name, fmu.dll))(fmu.component, ctypes.addressof(self._state))

    def __enter__(self) -> "FmuComponent":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @cached_property
    def initial_dependencies(self) -> Mapping[str, frozenset[str] | None]:
        """The inputs that each variable that can be read in initialisation mode follows there; None: it may be all."""
        return initial_dependencies_of(self._description)

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """What its description says that cannot be right, as sentences."""
        return doubts_of(self._description)

    @cached_property
    def own_step(self) -> float:
        """The length of the FMU's own steps in s; 0 where it has none."""
        return own_step_of(self._description, self.interface)

    @cached_property
    def _gives_derivatives(self) -> bool:
        return provides_derivatives(self.path, self._description, self.interface)

    @property
    def can_get_and_set_state(self) -> bool:
        """Whether the FMU can save and restore its state."""
        return bool(self._own.canGetAndSetFMUstate)

    @property
    def can_vary_step(self) -> bool:
        """Whether the FMU takes steps of changing length."""
        return bool(self._own.canHandleVariableCommunicationStepSize)

    @property
    def version(self) -> int:
        """Of FMI: 2 or 3."""
        return self._version

    @property
    def instance(self) -> int:
        """The address that FMI's functions take first."""
        component = self._fmu.component
        return int(getattr(component, "value", component))

    def address(self, function: str) -> int:
        """Return the address of a function of the FMU, named without its prefix: `GetInteger`; 0 where it has none."""
        found = getattr(self._fmu.dll, f"fmi{self._version}{function}", None)
        return 0 if found is None else ctypes.cast(found, ctypes.c_void_p).value or 0

    @property
    def _version(self) -> int:
        return int(self._description.fmiVersion[0])

    def _instantiate(self) -> Any:
        from fmpy import fmi2, fmi3

        check_binary(self.path, self._description, self._own.modelIdentifier)
        folder, complaint = Path(self._directory.name), complaint_of(self.path)
        unpack(self.path, folder, lambda name: name.startswith(("binaries/", "resources/")), complaint)
        suffix = {"coSimulation": "Slave", "modelExchange": "Model"}.get(self.interface, "ScheduledExecution")
        kind = getattr(fmi2, f"FMU2{suffix}") if self._version == 2 else getattr(fmi3, f"FMU3{suffix}")
        description = self._description
        instance = registered(self, self.name)
        try:
            with same_directory():
                fmu = kind(
                    guid=description.guid if self._version == 2 else description.instantiationToken,
                    modelIdentifier=self._own.modelIdentifier,
                    unzipDirectory=self._directory.name,
                    instanceName=instance,
                )
            self._watch(fmu)
            self._begin(fmu)
        except Exception as error:
            raise FmuError(f"{self.path} cannot be instantiated: {self._reason(error)}.") from error
        return fmu

    def _watch(self, fmu: Any) -> None:
        """Put the arithmetic back behind each call that Python makes of the FMU's functions."""
        for name in dir(fmu):
            if name.startswith(f"fmi{self._version}") and callable(call := getattr(fmu, name)):
                setattr(fmu, name, self.guard.watched(call))

    def _begin(self, fmu: Any) -> None:
        if self._version == 2:
            fmu.instantiate(callbacks=callbacks2())
        else:
            fmu.instantiate(logMessage=lambda _, status, category, message: self.hear(message))

    def hear(self, message: bytes | None) -> None:
        """Keep what the FMU says."""
        self._messages.append((message or b"").decode("utf-8", "replace").strip())

    def _functions(self) -> Functions | None:
        kind, real, state = ("fmi2", "Real", "FMUstate") if self._version == 2 else ("fmi3", "Float64", "FMUState")
        names = [
            f"Set{real}",
            f"Get{real}",
            "DoStep",
            *((f"Get{state}", f"Set{state}") if self.can_get_and_set_state else ()),
        ]
        addresses = [ctypes.cast(getattr(self._fmu.dll, kind + name), ctypes.c_void_p).value or 0 for name in names]
        instance = self._fmu.component
        functions = Functions(self._version, getattr(instance, "value", instance), *addresses)
        return replace(functions, state=ctypes.addressof(self._state), altered=self.guard.address)

    def _callables(self) -> tuple[Any, Any, Any]:
        functions: Any = self.functions
        if functions.version == 2:
            do_step = _STEP2(functions.step)
            set_, get = _VALUES2(functions.set), _VALUES2(functions.get)
            return set_, get, lambda t, h, final: do_step(functions.instance, t, h, final)
        return _VALUES3(functions.set), _VALUES3(functions.get), self._step3

    def _step3(self, time: float, size: float, final: bool) -> int:
        flags = [ctypes.c_bool() for _ in range(3)]
        last = ctypes.c_double(time)
        function = self._fmu.dll.fmi3DoStep
        status = int(function(self._fmu.component, time, size, final, *map(ctypes.byref, flags), ctypes.byref(last)))
        if status > WARNING:
            return status
        return TERMINATED if flags[1].value else EARLY if flags[2].value else status

    def _arrays(self, references: np.ndarray, values: np.ndarray) -> tuple[Any, ...]:
        count, functions = len(references), self.functions
        assert functions is not None
        more = [count] if functions.version == 3 else []
        return (functions.instance, references.ctypes.data, count, values.ctypes.data, *more)

    def _reason(self, error: Exception) -> str:
        said = f'; it said "{self._messages[-1]}"' if self._messages else ""
        return first_line(error) + said
