"""A component that is an FMU: FMPy reads, unpacks and starts it, the loop calls its functions directly.

FMI 2.0 and 3.0, co-simulation. Unpacked files live in a temporary directory that goes with the component.
"""

import ctypes
import os
import tempfile
import zipfile
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from itertools import count
from math import inf
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary
from xml.etree import ElementTree

import numpy as np

from cosim.component import Functions, Port
from cosim.errors import CosimError, FmuError
from cosim.files import sha256

_REAL = ("Real", "Float64")
_NUMBERS = count(1)
_LISTENERS: WeakValueDictionary[str, "FmuComponent"] = WeakValueDictionary()
"""Who hears what an FMI 2.0 instance says, by instance name; FMPy's logger can serve only one callback a process."""
_STEP2 = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)
_VALUES2 = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
_VALUES3 = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t
)


def describe(path: Path) -> Any:
    """Read the model description (FMPy's) of an FMU that this tool can run.

    Raises:
        FmuError: the file is missing, no FMU, or of another FMI version or kind.
    """
    import fmpy

    if not path.exists():
        raise FmuError(f"{path} does not exist.", culprit=str(path))
    if not zipfile.is_zipfile(path):
        raise FmuError(f"{path} is no FMU: it is not a zip archive.", culprit=str(path))
    if "modelDescription.xml" not in _names(path):
        raise FmuError(f"{path} is no FMU: the archive holds no modelDescription.xml.", culprit=str(path))
    try:
        version = _version(path)
        description = fmpy.read_model_description(str(path), validate=False) if version[:2] in ("2.", "3.") else None
    except Exception as error:  # FMPy and its XML parser raise many kinds; each means the same to the user
        raise FmuError(f"{path} has a modelDescription.xml that cannot be read: {_first(error)}.") from error
    if description is None:
        raise FmuError(f"{path} is of FMI {version}; this tool runs FMI 2.0 and 3.0.", culprit=str(path))
    if description.coSimulation is None:
        raise FmuError(f"{path} has no co-simulation interface; export it again with one.", culprit=str(path))
    return description


def ports_of(description: Any) -> dict[str, Port]:
    """List the scalar variables of a model description by name."""
    return {v.name: _port(v) for v in description.modelVariables if not v.dimensions}


class FmuComponent:
    """One instance of an FMU.

    Args:
        path: the .fmu file.
        name: what the component is called in messages; the model's name where not given.

    Raises:
        FmuError: the file is no FMU, has no binary for this platform, or cannot be instantiated.
    """

    def __init__(self, path: Path | str, name: str = "") -> None:
        self.path = Path(path)
        self._description = describe(self.path)
        self.name = name or self._description.modelName
        self.ports: Mapping[str, Port] = ports_of(self._description)
        self.origin: dict[str, Any] = _origin(self.path, self._description)
        self._messages: deque[str] = deque(maxlen=5)
        self._started = False
        self._directory = tempfile.TemporaryDirectory(prefix="cosim-", ignore_cleanup_errors=True)
        try:
            self._fmu = self._instantiate()
        except BaseException:
            self._directory.cleanup()
            raise
        self.functions: Functions | None = self._functions()
        self._set, self._get, self._step = self._callables()

    def start(self, parameters: Mapping[str, Any]) -> None:
        """Set parameters and start values by name and initialise at t = 0; a second call starts all over again.

        Raises:
            FmuError: a name is unknown or not settable, a value breaks its bounds, or the FMU refuses.
        """
        checked = [(self._settable(name, value), value) for name, value in parameters.items()]
        try:
            if self._started:
                self._fmu.reset()
            for variable, value in checked:
                self._set_start(variable, value)
            if self._version == 2:
                self._fmu.setupExperiment(startTime=0.0)
            self._started = True
            self._fmu.enterInitializationMode()
            self._fmu.exitInitializationMode()
        except CosimError:
            raise
        except Exception as error:
            raise FmuError(f"{self.name} ({self.path}) does not start: {self._reason(error)}.") from error

    def set(self, references: np.ndarray, values: np.ndarray) -> int:
        """Set real inputs; references uint32, values float64, shape (n,), contiguous."""
        return int(self._set(self._fmu.component, *self._arrays(references, values)))

    def get(self, references: np.ndarray, values: np.ndarray) -> int:
        """Write the values of real variables into `values`."""
        return int(self._get(self._fmu.component, *self._arrays(references, values)))

    def step(self, time: float, size: float) -> int:
        """Go from `time` to `time + size`, both in s."""
        return int(self._step(time, size))

    def messages(self) -> tuple[str, ...]:
        """What the FMU said last, newest at the end."""
        return tuple(self._messages)

    def close(self) -> None:
        """Free instance, library and unpacked files; may be called twice."""
        fmu, self._fmu = self._fmu, None
        if fmu is not None:
            with suppress(Exception):  # an FMU that failed may refuse to be terminated; it is freed all the same
                fmu.terminate()
            with suppress(Exception):
                fmu.freeInstance()
        self._directory.cleanup()

    def __enter__(self) -> "FmuComponent":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def _version(self) -> int:
        return int(self._description.fmiVersion[0])

    def _instantiate(self) -> Any:
        from fmpy import extract
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        self._check_binary()
        extract(str(self.path), self._directory.name, include=lambda name: name.startswith(("binaries/", "resources/")))
        kind = FMU2Slave if self._version == 2 else FMU3Slave
        description = self._description
        instance = f"{self.name}.{next(_NUMBERS)}"
        _LISTENERS[instance] = self
        try:
            with _same_directory():
                fmu = kind(
                    guid=description.guid if self._version == 2 else description.instantiationToken,
                    modelIdentifier=description.coSimulation.modelIdentifier,
                    unzipDirectory=self._directory.name,
                    instanceName=instance,
                )
            self._begin(fmu)
        except Exception as error:
            raise FmuError(f"{self.path} cannot be instantiated: {self._reason(error)}.") from error
        return fmu

    def _begin(self, fmu: Any) -> None:
        if self._version == 2:
            fmu.instantiate(callbacks=_callbacks2())
        else:
            fmu.instantiate(logMessage=lambda _, status, category, message: self.hear(message))

    def hear(self, message: bytes | None) -> None:
        """Keep what the FMU says."""
        self._messages.append((message or b"").decode("utf-8", "replace").strip())

    def _check_binary(self) -> None:
        import fmpy

        folder = fmpy.platform if self._version == 2 else fmpy.platform_tuple
        library = f"{self._description.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
        names = _names(self.path)
        if f"binaries/{folder}/{library}" not in names:
            folders = [name.split("/") for name in names if name.startswith("binaries/")]
            have = sorted({parts[1] for parts in folders if len(parts) > 2})
            has = ", ".join(have) or "none"
            message = f"{self.path} has no {folder} binary; it has {has}. Export it again for this platform."
            raise FmuError(message, culprit=str(self.path), value=folder, choices=tuple(have))

    def _functions(self) -> Functions:
        kind, real = ("fmi2", "Real") if self._version == 2 else ("fmi3", "Float64")
        addresses = [
            ctypes.cast(getattr(self._fmu.dll, f"{kind}{name}"), ctypes.c_void_p).value
            for name in (f"Set{real}", f"Get{real}", "DoStep")
        ]
        instance = self._fmu.component
        return Functions(self._version, getattr(instance, "value", instance), *(address or 0 for address in addresses))

    def _callables(self) -> tuple[Any, Any, Any]:
        functions: Any = self.functions
        if self._version == 2:
            do_step = _STEP2(functions.step)
            return _VALUES2(functions.set), _VALUES2(functions.get), lambda t, h: do_step(self._fmu.component, t, h, 1)
        return _VALUES3(functions.set), _VALUES3(functions.get), self._step3

    def _step3(self, time: float, size: float) -> int:
        from cosim.component import TERMINATED

        flags = [ctypes.c_bool() for _ in range(3)]
        last = ctypes.c_double(time)
        function = self._fmu.dll.fmi3DoStep
        status = int(function(self._fmu.component, time, size, True, *map(ctypes.byref, flags), ctypes.byref(last)))
        return TERMINATED if status <= 1 and flags[1].value else status

    def _arrays(self, references: np.ndarray, values: np.ndarray) -> tuple[Any, ...]:
        count = len(references)
        return (references.ctypes.data, count, values.ctypes.data, *([count] if self._version == 3 else []))

    def _settable(self, name: str, value: Any) -> Any:
        variables = {variable.name: variable for variable in self._description.modelVariables}
        port = self.ports.get(name)
        choices = tuple(one.name for one in self.ports.values() if one.settable)
        if port is None or not port.settable:
            what = "cannot be set before the start" if port else "does not exist"
            message = f'"{self.name}.{name}" {what}; what can be set: {", ".join(choices)}.'
            raise FmuError(message, culprit=f"{self.name}.{name}", value=value, choices=choices)
        if not isinstance(value, str) and not port.low <= value <= port.high:
            message = f'"{self.name}.{name}" is {value:g}; it must lie in {port.low:g} .. {port.high:g} {port.unit}.'
            raise FmuError(message, culprit=f"{self.name}.{name}", value=value)
        return variables[name]

    def _set_start(self, variable: Any, value: Any) -> None:
        kind = {"Enumeration": "Integer" if self._version == 2 else "Int64"}.get(variable.type, variable.type)
        getattr(self._fmu, f"set{kind}")([variable.valueReference], [value])

    def _reason(self, error: Exception) -> str:
        said = f'; it said "{self._messages[-1]}"' if self._messages else ""
        return _first(error) + said


def _names(path: Path) -> list[str]:
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def _version(path: Path) -> str:
    with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
        return ElementTree.parse(file).getroot().get("fmiVersion", "?")


@contextmanager
def _same_directory() -> Iterator[None]:
    """Come back to the working directory, which FMPy leaves for good when a library does not load."""
    here = os.getcwd()
    try:
        yield
    finally:
        os.chdir(here)


def _port(variable: Any) -> Port:
    real = variable.type in _REAL
    kind = variable.declaredType
    inherited = {key: getattr(variable, key) or (kind and getattr(kind, key)) for key in ("unit", "min", "max")}
    exact = variable.initial in ("exact", "approx") or variable.causality in ("parameter", "input")
    return Port(
        name=variable.name,
        reference=variable.valueReference,
        causality=variable.causality or "local",
        unit=inherited["unit"] or "",
        description=variable.description or "",
        start=_number(variable.start),
        low=-inf if inherited["min"] is None else float(inherited["min"]),
        high=inf if inherited["max"] is None else float(inherited["max"]),
        settable=exact and variable.start is not None and variable.variability != "constant",
        real=real,
    )


def _number(text: str | None) -> float | None:
    with suppress(TypeError, ValueError):
        return float(text)  # type: ignore[arg-type]
    return None


def _origin(path: Path, description: Any) -> dict[str, Any]:
    return {
        "file": path.name,
        "sha256": sha256(path),
        "model": description.modelName,
        "fmi": description.fmiVersion,
        "tool": description.generationTool or "",
    }


def _tell(_: Any, name: bytes | None, status: int, category: bytes, message: bytes | None) -> None:
    """Pass on what an FMI 2.0 instance says."""
    listener = _LISTENERS.get((name or b"").decode("utf-8", "replace"))
    if listener is not None:
        listener.hear(message)


@cache
def _callbacks2() -> Any:
    """Callbacks of FMI 2.0 that collect what the FMUs say; FMPy's own would print it on stdout."""
    from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
    from fmpy.logging import addLoggerProxy

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(_tell)
    callbacks.allocateMemory, callbacks.freeMemory = defaultCallbacks.allocateMemory, defaultCallbacks.freeMemory
    with suppress(Exception):  # without the proxy, messages come with their printf formats unfilled
        addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


def _first(error: Exception) -> str:
    lines = str(error).splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__
