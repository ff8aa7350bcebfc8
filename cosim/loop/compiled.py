"""The loop in C, called through ctypes, which lets other threads run meanwhile."""

import ctypes
from ctypes import POINTER, Structure, c_double, c_int64, c_void_p
from typing import Any

import numpy as np

from cosim.component import Functions
from cosim.loop.plan import Failure, Part, Plan


class _Part(Structure):
    _fields_ = [
        ("version", c_int64),
        ("instance", c_void_p),
        ("set", c_void_p),
        ("get", c_void_p),
        ("step", c_void_p),
        ("inputs", c_int64),
        ("outputs", c_int64),
        ("input_references", c_void_p),
        ("output_references", c_void_p),
        ("input", c_void_p),
        ("output", c_void_p),
    ]


class _Wire(Structure):
    _fields_ = [
        ("source", c_int64),
        ("target", c_int64),
        ("noise", c_int64),
        ("gain", c_double),
        ("offset", c_double),
        ("quantum", c_double),
    ]


class _Column(Structure):
    _fields_ = [("source", c_int64), ("mean", c_int64), ("sample", c_double), ("sum", c_double)]


class _Loop(Structure):
    _fields_ = [
        ("parts", c_int64),
        ("wires", c_int64),
        ("signals", c_int64),
        ("columns", c_int64),
        ("means", c_int64),
        ("part", POINTER(_Part)),
        ("wire", POINTER(_Wire)),
        ("column", POINTER(_Column)),
        ("bus", c_void_p),
        ("signal", c_void_p),
        ("step", c_double),
        ("decimation", c_int64),
        ("tick", c_int64),
        ("warnings", c_int64),
        ("half", c_int64),
        ("edge", c_int64),
        ("halves", c_int64),
        ("sampled", c_int64),
        ("failed", c_int64),
        ("status", c_int64),
    ]


def load(path: str) -> ctypes.CDLL:
    """Load the compiled loop and declare its functions."""
    library = ctypes.CDLL(path)
    library.loop_start.argtypes = [POINTER(_Loop)]
    library.loop_run.argtypes = [POINTER(_Loop), c_int64, c_void_p, c_void_p, c_int64]
    library.loop_flush.argtypes = [POINTER(_Loop), c_void_p, c_int64]
    for function in (library.loop_start, library.loop_run, library.loop_flush):
        function.restype = c_int64
    return library


class CompiledLoop:
    """A plan in the hands of the C loop; every component must offer its functions."""

    kind = "compiled"

    def __init__(self, plan: Plan, library: ctypes.CDLL) -> None:
        self._plan, self._library = plan, library
        self._loop = _Loop(
            parts=len(plan.parts),
            wires=len(plan.links),
            signals=plan.signals,
            columns=len(plan.columns),
            means=sum(column.mean for column in plan.columns),
            part=(_Part * len(plan.parts))(*(_part(part, plan.bus) for part in plan.parts)),
            wire=(_Wire * len(plan.links))(*(_Wire(**vars(link)) for link in plan.links)),
            column=(_Column * len(plan.columns))(*(_Column(column.source, column.mean) for column in plan.columns)),
            bus=_address(plan.bus, 0),
            signal=_address(plan.bus, plan.signal),
            step=plan.step,
            decimation=plan.decimation,
            edge=plan.decimation,
            failed=-1,
        )

    @property
    def tick(self) -> int:
        """Ticks done."""
        return int(self._loop.tick)

    @property
    def warnings(self) -> int:
        """Steps that ended with a warning."""
        return int(self._loop.warnings)

    @property
    def failure(self) -> Failure | None:
        """What failed, if anything did."""
        loop = self._loop
        return Failure(loop.failed, loop.tick, loop.status) if loop.failed >= 0 else None

    def start(self) -> None:
        """Read all outputs before the first tick."""
        self._library.loop_start(self._loop)

    def run(self, ticks: int, signals: np.ndarray) -> np.ndarray:
        """Run ticks with signals of shape (signals, ticks); returns rows of shape (columns, rows)."""
        rows = np.empty((len(self._plan.columns), ticks // self._plan.decimation + 2))
        signals = np.ascontiguousarray(signals, dtype=np.float64)
        written = self._library.loop_run(self._loop, ticks, signals.ctypes.data, rows.ctypes.data, rows.shape[1])
        return rows[:, :written]

    def flush(self) -> np.ndarray:
        """Return the row cut short by the end of the run, if there is one, shape (columns, 0 or 1)."""
        rows = np.empty((len(self._plan.columns), 1))
        return rows[:, : self._library.loop_flush(self._loop, rows.ctypes.data, 1)]


def _part(part: Part, bus: np.ndarray) -> _Part:
    functions: Any = part.component.functions
    assert isinstance(functions, Functions)  # the factory chose this loop because all offer them
    return _Part(
        version=functions.version,
        instance=functions.instance,
        set=functions.set,
        get=functions.get,
        step=functions.step,
        inputs=len(part.input_references),
        outputs=len(part.output_references),
        input_references=part.input_references.ctypes.data,
        output_references=part.output_references.ctypes.data,
        input=_address(bus, part.input),
        output=_address(bus, part.output),
    )


def _address(bus: np.ndarray, place: int) -> int:
    return bus.ctypes.data + place * bus.itemsize
