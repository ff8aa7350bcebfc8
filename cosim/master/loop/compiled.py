"""The loop in C, called through ctypes, which lets other threads run meanwhile."""

import ctypes
from ctypes import POINTER, c_int64, c_void_p
from functools import cached_property
from typing import Any

import numpy as np

from cosim.fmi.component import Functions
from cosim.master.loop.shared import declare, opened
from cosim.master.loop.shared import part as as_part
from cosim.master.loop.structures import LAYOUT, CBond, CColumn, CFault, CInner, CLoop, CPart, CStage, CWire
from cosim.support.activity import board
from cosim.system.plan import Balance, Effort, Failure, Gather, Iterate, Link, Part, Plan, PlannedStage, Step

_TABLE = 2
_KINDS = {Gather: 0, Step: 1, Iterate: 2, Balance: 3}


def load(path: str) -> ctypes.CDLL:
    """Load the compiled loop and declare its functions.

    Raises:
        OSError: it cannot be loaded, or was built from another version of its C.
    """
    library = opened(path, "loop_layout", LAYOUT)
    declare(
        library,
        c_int64,
        loop_run=[POINTER(CLoop), c_int64, c_void_p, c_void_p, c_int64],
        loop_flush=[POINTER(CLoop), c_void_p, c_int64],
    )
    if hasattr(library, "loop_finish"):  # a library built before there was one runs everything else
        declare(library, None, loop_finish=[POINTER(CLoop), c_void_p])
    return library


class CompiledLoop:
    """A plan in the hands of the C loop; every component must offer its functions."""

    kind = "compiled"

    def __init__(self, plan: Plan, library: ctypes.CDLL) -> None:
        self.plan, self._library = plan, library
        first = [sum(len(part.links) for part in plan.parts[:index]) for index in range(len(plan.parts))]
        links = [link for part in plan.parts for link in part.links]
        stages = [_stage(stage, first) for stage in plan.stages]
        values = dict(
            parts=len(plan.parts),
            wires=len(links),
            stages=len(stages),
            signals=plan.signals,
            columns=len(plan.columns),
            means=sum(column.mean for column in plan.columns),
            part=_array(CPart, [_part(part, start, plan.bus) for part, start in zip(plan.parts, first, strict=True)]),
            wire=_array(CWire, [_wire(link) for link in links]),
            stage=_array(CStage, stages),
            column=_array(CColumn, [CColumn(one.source, one.mean, one.late) for one in plan.columns]),
            bus=_address(plan.bus, 0),
            signal=_address(plan.bus, plan.signal),
            step=plan.step,
            decimation=plan.decimation,
            edge=plan.decimation,
            failed=-1,
        )
        self._loop = board().loop(CLoop, [part.name for part in plan.parts])
        for name, value in values.items():
            setattr(self._loop, name, value)

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
        return Failure(loop.failed, loop.since, loop.status) if loop.failed >= 0 else None

    @property
    def efforts(self) -> list[Effort]:
        """What the coupled stages took."""
        coupled = [
            one for one in self._loop.stage[: self._loop.stages] if one.kind in (_KINDS[Iterate], _KINDS[Balance])
        ]
        return [Effort(one.rounds, one.greatest, one.at_limit) for one in coupled]

    @property
    def held(self) -> list[float]:
        """What columns hold that is not written yet."""
        columns = self._loop.column[: self._loop.columns]
        return [value for column in columns for value in (column.value, column.sample)]

    def run(self, ticks: int, signals: np.ndarray) -> np.ndarray:
        """Run ticks with signals of shape (signals, ticks); returns rows of shape (columns, rows)."""
        rows = np.empty((len(self.plan.columns), ticks // self.plan.decimation + 2))
        signals = np.ascontiguousarray(signals, dtype=np.float64)
        written = self._library.loop_run(self._loop, ticks, signals.ctypes.data, rows.ctypes.data, rows.shape[1])
        self._rest()
        return rows[:, :written]

    def run_one(self, signals: int) -> np.ndarray | None:
        """Run one tick with the signals at an address; returns the row that it completed, if it did: (columns, 1).

        A third of the time of `run`: nothing is allocated, and no address is asked for.
        """
        written = self._library.loop_run(self._loop, 1, signals, self._row.address, 2)
        self._rest()
        return self._row.values[:, :written].copy() if written else None

    @cached_property
    def _row(self) -> "_Row":
        return _Row(len(self.plan.columns))

    def finish(self, signals: np.ndarray) -> None:
        """Begin the row at stop, where one falls due, with the signals of that tick, shape (signals, 1)."""
        signals = np.ascontiguousarray(signals, dtype=np.float64)
        self._library.loop_finish(self._loop, signals.ctypes.data)

    def flush(self) -> np.ndarray:
        """Return the row cut short by the end of the run, if there is one, shape (columns, 0 or 1)."""
        rows = np.empty((len(self.plan.columns), 1))
        return rows[:, : self._library.loop_flush(self._loop, rows.ctypes.data, 1)]

    def _rest(self) -> None:
        """Note that no component is being called."""
        if self._loop.failed < 0:
            self._loop.status = 0


class _Row:
    """Room for the rows of one tick, and its address."""

    def __init__(self, columns: int) -> None:
        self.values = np.empty((columns, 2))
        self.address = self.values.ctypes.data


def _part(part: Part, wire: int, bus: np.ndarray) -> CPart:
    functions: Any = part.component.functions
    assert isinstance(functions, Functions)  # the factory chose this loop because all offer them
    references = (part.input_references, part.output_references)
    places = (_address(bus, part.input), _address(bus, part.output))
    return as_part(functions, references, *places, wire=wire, wires=len(part.links), every=part.every)


def _wire(link: Link) -> CWire:
    faults = [CFault(freeze=_TABLE, gain=source, offset=target) for source, target in link.table]
    faults += [CFault(f.first, f.last, f.noise, f.freeze, f.gain, f.offset) for f in link.faults]
    return CWire(
        source=link.source,
        target=link.target,
        noise=link.noise,
        gain=link.gain,
        offset=link.offset,
        quantum=link.quantum,
        faults=len(faults),
        fault=_array(CFault, faults),
    )


def _stage(stage: PlannedStage, first: list[int]) -> CStage:
    made = CStage(kind=_KINDS[type(stage)], part=stage.part, parts=stage.parts, relaxation=1.0, size=1.0)
    if isinstance(stage, Iterate | Balance):
        inner = [CInner(wire=first[one.part] + one.link, back=one.back) for one in stage.inner]
        bonds = [CBond(*bond) for bond in stage.bonds] if isinstance(stage, Balance) else []
        made.inners, made.inner = len(inner), _array(CInner, inner)
        made.bonds, made.bond = len(bonds), _array(CBond, bonds)
        made.tolerance, made.most = stage.tolerance, stage.most
        made.theta = stage.theta if isinstance(stage, Iterate) else 0.0
    return made


def _array(kind: Any, items: list[Any]) -> Any:
    return (kind * len(items))(*items)


def _address(bus: np.ndarray, place: int) -> int:
    return bus.ctypes.data + place * bus.itemsize
