"""A component that is a plain Python function: the way to try something out, at microseconds a step.

    [components.camera]
    python = "camera.py:camera"
    inputs = { q = "rad" }
    outputs = { seen = "rad" }
    parameters = { gain = 1.0 }
    every = 500

The function is called once a step as `camera(t, q=..., gain=...)`, t in s, and returns the outputs that are seen at the
end of the step: a number where there is one, or a dictionary. A class is made with the parameters at each start and its
instance called as `camera(t, q=...)`, so it may remember. The scenario runs the file: trust it as you trust a program.
"""

import ctypes
import inspect
import runpy
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cosim.fmi.component import ERROR, OK, Functions, Port
from cosim.fmi.description import first_line
from cosim.fmi.guard import Guard
from cosim.support.activity import doing
from cosim.support.errors import ScenarioError, WiringError
from cosim.support.files import sha256

_VALUES = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_uint32), ctypes.c_size_t, ctypes.POINTER(ctypes.c_double)
)
_STEP = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)


class FunctionComponent:
    """A Python function with named inputs and outputs.

    Args:
        function: called once a step, or a class whose instance is (see above).
        inputs: units by name; an input starts at 0 unless the parameters give it a value.
        outputs: units by name; every output is 0 until the first step has ended.
        name: what the component is called in messages.
        origin: what a recording shall say about where it comes from.
        guard: of the code that made the function.
    """

    can_get_and_set_state, can_vary_step, event_at_start = False, True, False
    own_step = 0.0
    doubts: tuple[str, ...] = ()

    def __init__(
        self,
        function: Callable[..., Any],
        inputs: Mapping[str, str],
        outputs: Mapping[str, str],
        name: str = "",
        origin: Mapping[str, Any] | None = None,
        guard: Guard | None = None,
    ) -> None:
        self.name = name or function.__name__
        self.guard = guard or Guard()
        self.origin: dict[str, Any] = {"function": function.__name__, **(origin or {})}
        kinds = [("input", inputs), ("output", outputs)]
        listed = [(one, unit, causality) for causality, units in kinds for one, unit in units.items()]
        ports = [Port(one, number, causality, unit, start=0.0) for number, (one, unit, causality) in enumerate(listed)]
        self.ports: Mapping[str, Port] = {port.name: port for port in ports}
        self.feedthrough: Mapping[str, frozenset[str] | None] = dict.fromkeys(outputs, frozenset())
        self.initial_dependencies = self.feedthrough
        self._function, self._inputs, self._outputs = function, tuple(inputs), tuple(outputs)
        self._call: Callable[..., Any] = function
        self._values = np.zeros(len(listed))
        self._messages: deque[str] = deque(maxlen=5)
        self._kept = (_VALUES(self._set_raw), _VALUES(self._get_raw), _STEP(self._step_raw))
        set_, get, step = [ctypes.cast(one, ctypes.c_void_p).value or 0 for one in self._kept]
        self.functions: Functions | None = Functions(2, 0, set_, get, step, altered=self.guard.address)

    def enter_initialisation(self, parameters: Mapping[str, Any], time: float = 0.0) -> None:
        """Begin anew with these parameters and start values of inputs; each step is given the time.

        Raises:
            WiringError: the function does not take them, or the class cannot be made.
        """
        with doing(self.name, "initialised"), self.guard.kept():
            self._start_inputs({name: value for name, value in parameters.items() if name in self._inputs})
            self._make({name: value for name, value in parameters.items() if name not in self._inputs})

    def exit_initialisation(self) -> None:
        """Do nothing: outputs are 0 until the first step has ended."""

    def derivatives(self, outputs: np.ndarray, inputs: np.ndarray) -> None:
        """Return nothing: outputs follow no input before the first step."""

    def _start_inputs(self, values: Mapping[str, Any]) -> None:
        self._values[:] = 0.0
        for name, value in values.items():
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                message = f'"{self.name}.{name}" is {value!r}; it must be a number, or an output of a signal.'
                raise WiringError(message, culprit=f"{self.name}.{name}", value=value)
            self._values[self.ports[name].reference] = value

    def _make(self, parameters: Mapping[str, Any]) -> None:
        given = dict.fromkeys(self._inputs, 0.0)
        is_class = inspect.isclass(self._function)
        try:
            self._call = self._function(**parameters) if is_class else self._function
            held = {} if is_class else dict(parameters)
            inspect.signature(self._call).bind(0.0, **given, **held)
        except TypeError as error:
            message = f"{self.name} cannot be called with its inputs and parameters: {first_line(error)}."
            raise WiringError(message, culprit=self.name) from error
        except (Exception, SystemExit) as error:  # a class may raise anything when it is made
            message = f"{self.name} cannot be made: {type(error).__name__}: {first_line(error)}."
            raise WiringError(message, culprit=self.name) from error
        call = self._call
        self._call = lambda t, **inputs: call(t, **inputs, **held)

    def set(self, references: np.ndarray, values: np.ndarray) -> int:
        """Set inputs."""
        self._values[references] = values
        return OK

    def get(self, references: np.ndarray, values: np.ndarray) -> int:
        """Write the values of inputs or outputs into `values`."""
        values[:] = self._values[references]
        return OK

    def step(self, time: float, size: float, final: bool = True) -> int:
        """Call the function; what it raises is an error of the component."""
        count = len(self._inputs)
        inputs = dict(zip(self._inputs, self._values[:count].tolist(), strict=True))
        try:
            self._values[count:] = self._listed(self._call(time, **inputs))
        except BaseException as error:  # whatever a user's function raises, SystemExit too, ends the run in its words
            self._messages.append(f"{type(error).__name__}: {first_line(error)}")
            return self.guard.after(ERROR)
        return self.guard.after(OK)

    def save(self) -> int:
        """Refuse: what a function remembers cannot be kept."""
        return ERROR

    restore = save

    def failed(self, status: int) -> None:
        """Do nothing: nothing is left to be called."""

    def messages(self) -> tuple[str, ...]:
        """Return what was raised, newest at the end."""
        return tuple(self._messages)

    def close(self) -> None:
        """Do nothing."""

    def _listed(self, result: Any) -> list[float]:
        if not isinstance(result, Mapping):
            result = dict(zip(self._outputs, [result], strict=True)) if len(self._outputs) == 1 else {}
        if set(result) != set(self._outputs):
            wanted, got = ", ".join(self._outputs), ", ".join(map(str, result)) or "something else"
            raise ValueError(f"it must return a dictionary with {wanted}; it returned {got}")
        return [float(result[name]) for name in self._outputs]

    def _set_raw(self, _: Any, references: Any, count: int, values: Any) -> int:
        for index in range(count):
            self._values[references[index]] = values[index]
        return OK

    def _get_raw(self, _: Any, references: Any, count: int, values: Any) -> int:
        for index in range(count):
            values[index] = self._values[references[index]]
        return OK

    def _step_raw(self, _: Any, time: float, size: float, final: int) -> int:
        return self.step(time, size)


def load_function(source: str, where: str, guard: Guard) -> tuple[Callable[..., Any], dict[str, Any]]:
    """Return the function that `file.py:name` means, and its origin; `where` it stands, for messages.

    Raises:
        ScenarioError: there is no such file or function, or the file cannot be run.
    """
    where = f'{where} = "{source}"'
    file, _, attribute = source.rpartition(":")
    if not Path(file).is_file():
        raise ScenarioError(f'{where}: the file does not exist; write "file.py:function".', culprit=source)
    try:
        with doing(Path(file).name, "loaded"), guard.kept():
            found = runpy.run_path(file)
    except (Exception, SystemExit) as error:  # the user's file may raise anything
        message = f"{where}: the file cannot be run: {type(error).__name__}: {first_line(error)}."
        raise ScenarioError(message, culprit=source) from error
    choices = tuple(key for key, value in found.items() if callable(value) and not key.startswith("_"))
    if attribute not in choices:
        message = f'{where}: there is no function "{attribute}"; there are: {", ".join(choices)}.'
        raise ScenarioError(message, culprit=source, choices=choices)
    origin = {"function": f"{Path(file).name}:{attribute}", "sha256": sha256(Path(file))}
    return found[attribute], origin
