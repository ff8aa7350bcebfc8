"""A component that is an FMU for scheduled execution: its model partitions run when their clocks tick.

Of one clock, the master's: in a step from t to t + h the partitions whose clocks tick in [t, t + h) run one after the
other in the order of their times, at one time by priority (lower first); nothing preempts.

    constant, fixed      every interval after the shift, as the model description says, in integers
    calculated, tunable  the same with the interval and shift that the FMU gives after initialisation
    changing             the FMU says the next interval after each tick
    countdown            the FMU says after a partition that one begins to run
    triggered            at the beginning of a step whose input is not 0

An output clock is 1 in the rows behind a step in which it ticked.
Reference: Functional Mock-up Interface 3.0.2, 2.2.8 (clocks), 5 (scheduled execution).
"""

import ctypes
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from cosim.fmi.component import ERROR, OK, Functions, Port
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.types import OPAQUE
from cosim.support.activity import doing
from cosim.support.errors import FmuError

_PERIODIC = ("constant", "fixed", "calculated", "tunable")
_CHANGED = 2
"""fmi3IntervalChanged."""
_MARGIN = 1e-9
"""A tick this part of a step before its end belongs to the next step: times are rounded."""


@dataclass(frozen=True)
class Ticking:
    """An input clock: its reference, when it ticks (`intervalVariability`), its priority, interval and shift [s]."""

    name: str
    reference: int
    kind: str
    priority: int
    interval: float
    shift: float


class ScheduledComponent(FmuComponent):
    """One instance of an FMU for scheduled execution; cannot be taken back.

    Args:
        path: the .fmu file.
        name: what the component is called in messages; the model's name where not given.
        description: what `describe` read of it, if that was done before.

    Raises:
        FmuError: as of `FmuComponent`.
    """

    interface = "scheduledExecution"

    def __init__(self, path: Path | str, name: str = "", description: Any = None) -> None:
        super().__init__(path, name, description)
        self.functions: Functions | None = None
        self._kinds = {port.reference: port.type for port in self.ports.values()}
        self._names = {port.reference: port.name for port in self.ports.values()}
        self._clocks = {one.reference: one for one in clocks_of(self.path)}
        self._triggered = {one.reference: 0.0 for one in self._clocks.values() if one.kind == "triggered"}
        self._ticked = {one.reference: 0.0 for one in self.ports.values() if self._is_output_clock(one)}
        self._due: list[tuple[float, int, int]] = []
        self._zero = 0.0

    @property
    def can_get_and_set_state(self) -> bool:
        """Partitions are not taken back."""
        return False

    @property
    def can_vary_step(self) -> bool:
        """Steps of any length."""
        return True

    def enter_initialisation(self, parameters: Mapping[str, Any], time: float = 0.0) -> None:
        """Set parameters and start values by name for a start at `time` [s]; clocks count from there."""
        super().enter_initialisation(parameters, time)
        self._zero, self._due = time, []
        self._ticked = dict.fromkeys(self._ticked, 0.0)

    def exit_initialisation(self) -> None:
        """End initialisation mode and ask the clocks for their intervals."""
        super().exit_initialisation()
        for clock in self._clocks.values():
            interval, shift = self._timing(clock)
            self._clocks[clock.reference] = clock = Ticking(**{**vars(clock), "interval": interval, "shift": shift})
            if clock.kind in (*_PERIODIC, "changing"):
                heappush(self._due, (shift, clock.priority, clock.reference))

    def set(self, references: np.ndarray, values: np.ndarray) -> int:
        """Set inputs; of a triggered clock, whether it ticks in the next step."""
        for reference, value in zip(references.tolist(), values.tolist(), strict=True):
            if reference in self._triggered:
                self._triggered[reference] = value
            elif not self._write(reference, value):
                return ERROR
        return OK

    def get(self, references: np.ndarray, values: np.ndarray) -> int:
        """Write the values of variables into `values`; of an output clock, whether it ticked in the last step."""
        for place, reference in enumerate(references.tolist()):
            kind = self._kinds[reference]
            if kind in OPAQUE:
                return self._refuse(f'"{self._names[reference]}" is a {kind}, which scheduled execution has not here')
            ticked = self._ticked.get(reference, self._triggered.get(reference, 0.0))
            values[place] = ticked if kind == "Clock" else self._read(kind, reference)
        return OK

    def step(self, time: float, size: float, final: bool = True) -> int:
        """Run the partitions whose clocks tick from `time` to before `time + size`, both in s."""
        self._ticked = dict.fromkeys(self._ticked, 0.0)
        for reference in [one for one, value in self._triggered.items() if value]:
            heappush(self._due, (time, self._clocks[reference].priority, reference))
        try:
            while self._due and self._due[0][0] < time + size * (1 - _MARGIN):
                self._activate(*heappop(self._due))
        except Exception as error:
            self.hear(str(error).encode())
            return int(getattr(error, "status", ERROR))
        return OK

    def _activate(self, when: float, priority: int, reference: int) -> None:
        clock = self._clocks[reference]
        with doing(self.name, f'running the partition of its clock "{clock.name}"'):
            self._fmu.activateModelPartition(reference, self._zero + when)
        for output in self._ticked:
            self._ticked[output] = max(self._ticked[output], float(self._fmu.getClock([output])[0]))
        if clock.kind in _PERIODIC:
            count = round((when - clock.shift) / clock.interval) + 1
            heappush(self._due, (clock.shift + count * clock.interval, priority, reference))
        for one in self._clocks.values():
            if one.kind == "countdown" or (one.kind == "changing" and one is clock):
                self._count_down(one, when)

    def _count_down(self, clock: Ticking, when: float) -> None:
        interval, qualifier = self._interval(clock.reference)
        if qualifier == _CHANGED or clock.kind == "changing":
            heappush(self._due, (when + interval, clock.priority, clock.reference))

    def _timing(self, clock: Ticking) -> tuple[float, float]:
        """Return interval and shift [s] as the description or the FMU says them."""
        if clock.kind in ("constant", "fixed", "countdown", "triggered"):
            interval, shift = clock.interval, clock.shift
        else:
            shifts = (ctypes.c_double * 1)()
            with self._foreign("initialised"):
                self._fmu.getShiftDecimal(self._reference(clock.reference), shifts)
            interval, shift = self._interval(clock.reference)[0], float(shifts[0])
        if clock.kind in _PERIODIC and not 0 < interval < inf:
            message = f'{self.name} ({self.path}): its clock "{clock.name}" has no interval above 0 s.'
            raise FmuError(message, culprit=clock.name, value=interval)
        return interval, shift

    def _interval(self, reference: int) -> tuple[float, int]:
        intervals, qualifiers = (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
        self._fmu.getIntervalDecimal(self._reference(reference), intervals, qualifiers)
        return float(intervals[0]), int(qualifiers[0])

    def _reference(self, reference: int) -> Any:
        """Return a value reference as FMI's functions take it."""
        return (ctypes.c_uint32 * 1)(reference)

    def _write(self, reference: int, value: float) -> bool:
        kind = self._kinds[reference]
        exact = kind in ("Float64", "Float32") or value == round(value)
        if kind in (*OPAQUE, "Clock") or not exact:
            self._refuse(f'"{self._names[reference]}" is fed {value:.9g}, and is of type {kind}')
            return False
        native = kind if kind != "Enumeration" else "Int64"
        number = value if kind in ("Float64", "Float32") else bool(value) if kind == "Boolean" else int(value)
        getattr(self._fmu, f"set{native}")([reference], [number])
        return True

    def _read(self, kind: str, reference: int) -> float:
        return float(getattr(self._fmu, f"get{'Int64' if kind == 'Enumeration' else kind}")([reference])[0])

    def _refuse(self, what: str) -> int:
        self.hear(what.encode())
        return ERROR

    def _is_output_clock(self, port: Port) -> bool:
        return port.type == "Clock" and port.causality == "output"

    def _functions(self) -> Functions | None:
        return None

    def _callables(self) -> tuple[Any, Any, Any]:
        return None, None, None


def clocks_of(path: Path) -> Iterator[Ticking]:
    """List the input clocks of an FMU; FMPy does not read their intervals."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    for one in root.iterfind("ModelVariables/Clock[@causality='input']"):
        resolution = float(one.get("resolution") or 1)
        yield Ticking(
            name=one.get("name", ""),
            reference=int(one.get("valueReference", 0)),
            kind=one.get("intervalVariability", ""),
            priority=int(one.get("priority") or 0),
            interval=float(one.get("intervalDecimal") or float(one.get("intervalCounter") or 0) / resolution),
            shift=float(one.get("shiftDecimal") or float(one.get("shiftCounter") or 0) / resolution),
        )
