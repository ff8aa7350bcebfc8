"""A system in hand: stepped from Python code, which reads values and sets them between two steps.

What is set acts in the next step. An output keeps the value it was given for that step alone, as its component writes
it anew; an input that no wire feeds keeps it until it is set again.
"""

import warnings
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from math import isfinite
from typing import Self

import numpy as np

from cosim.data.recording import Recording
from cosim.fmi.component import Port
from cosim.fmi.types import FLOATS
from cosim.master.access import who_ended
from cosim.master.execution import guard_of
from cosim.master.given import Given
from cosim.master.initialisation import initialise
from cosim.master.loop import CompiledLoop, make_loop
from cosim.master.opening import started, wiring_of
from cosim.master.output import kept, writer_of
from cosim.master.planning import make_plan
from cosim.master.proven import proven_of, said_of, with_records
from cosim.support.errors import StepError, WiringError
from cosim.system.plan import Plan
from cosim.system.system import System
from cosim.system.wire import Record, Wire
from cosim.system.wiring import Wiring

BLOCK = 1024
"""Ticks of signals that are computed ahead: a call for each tick would take longer than the tick."""
HAND = "hand"
"""Name of the signals that feed inputs without a wire."""
SEEN = "seen "
"""Names of the columns that put outputs on the bus which nothing else reads."""
MOST = 1000
"""Outputs that are put on the bus although nothing reads them."""
FEW = 64
"""Steps of one call from which the surroundings of the process are checked after it, which takes as long as these."""


class OutsideProvenRangeWarning(UserWarning):
    """A system stepped by hand has left the range in which one of its components is proven."""


class Session:
    """A system that is stepped by hand; use it in a `with` statement.

    Args:
        system: what is simulated; its `ticks` bound nothing here.
        compiled: False asks for the loop in Python.
    """

    def __init__(self, system: System, compiled: bool = True) -> None:
        self._system, self._compiled, self._stack = system, compiled, ExitStack()

    def __enter__(self) -> Self:
        """Open the components and initialise them.

        Raises:
            WiringError, FmuError, SignalError: one sentence.
        """
        with ExitStack() as stack:
            self._open(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, kind: object = None, *_: object) -> None:
        outside = self.outside if kind is None else ()
        self._stack.close()
        for sentence in outside:
            warnings.warn(sentence, OutsideProvenRangeWarning, stacklevel=2)

    def _open(self, stack: ExitStack) -> None:
        system, self._tick, self.ended = self._system, 0, ""
        wiring = _in_hand(wiring_of(stack, system))
        self._proven, self._watched, self._seen_rows = proven_of(wiring), 0, 0
        self._recorded = len(wiring.records)
        wiring = replace(wiring, records=with_records(wiring, self._proven))
        self._plan = plan = make_plan(wiring, system.step, system.decimation, system.start)
        settings = started(wiring, system, plan)
        self._given, self._guard = Given(wiring, plan), guard_of(plan)
        self._ahead(0)
        with self._guard.kept():
            self.notes = tuple(initialise(plan, settings, self._block[0].copy()))
        self._loop, self._wiring, self._rows = make_loop(plan, self._compiled), wiring, list[np.ndarray]()
        self._places, self._hands = _places(wiring, plan), _hands(wiring)
        self._outputs = {f"{part.name}.{name}" for part in plan.parts for name in part.output_names}

    @property
    def tick(self) -> int:
        """Steps done."""
        return self._tick

    @property
    def t(self) -> float:
        """Time [s]."""
        return self._plan.start + self._tick * self._plan.step

    @property
    def names(self) -> tuple[str, ...]:
        """What can be read: outputs, inputs that are fed, signals."""
        return tuple(self._places)

    def step(self, ticks: int = 1) -> None:
        """Take all components over some ticks.

        Raises:
            StepError: a component failed, or had asked to end the simulation (`ended` says which).
        """
        if self.ended:
            raise StepError(f"{self.ended}: it cannot be stepped on.", component="")
        while ticks > 0:
            offset = self._tick - self._first
            if offset >= BLOCK:
                self._ahead(self._tick)
                offset = 0
            some = min(ticks, BLOCK - offset)
            rows = self._run_one(offset) if some == 1 else self._run(offset, some)
            if rows is not None and rows.shape[1]:
                self._rows.append(rows)
            if (failure := self._loop.failure) is not None:
                self._tick = self._loop.tick
                self.ended = "The simulation failed"  # and stays so where the next line raises
                self.ended = who_ended(self._plan, failure)
                return
            self._tick += some
            ticks -= some

    def _ahead(self, tick: int) -> None:
        """Compute signals of the next block of ticks; shape (ticks, signals)."""
        self._first = tick
        self._block = np.ascontiguousarray(self._given.at(np.arange(tick, tick + BLOCK)).T)
        self._address, self._stride = self._block.ctypes.data, self._block.strides[0]

    def _run_one(self, offset: int) -> np.ndarray | None:
        if isinstance(self._loop, CompiledLoop):
            return self._loop.run_one(self._address + offset * self._stride)
        return self._run(offset, 1)

    def _run(self, offset: int, ticks: int) -> np.ndarray:
        signals = self._block[offset : offset + ticks].T
        if ticks < FEW:
            return self._loop.run(ticks, signals)
        with self._guard.kept():
            return self._loop.run(ticks, signals)

    def __getitem__(self, name: str) -> float:
        """The value of an output, an input or a signal as it is now."""
        return float(self._plan.bus[self._place(name)])

    def __setitem__(self, name: str, value: float) -> None:
        """Set an output for the next step, or an input that no wire feeds from then on.

        Raises:
            WiringError: there is no such name, or something else feeds it.
            StepError: the value is no finite number.
        """
        if not isfinite(value):
            raise StepError(f'"{name}" is set to {value}; it must be a finite number.', component=name)
        if name in self._hands:
            row, signal = self._hands[name]
            signal.value = value
            self._block[self._tick - self._first :, row] = value
            self._plan.bus[self._place(name)] = value
        elif name in self._outputs:
            self._plan.bus[self._place(name)] = value
        else:
            raise self._refused(name)

    def _refused(self, name: str) -> WiringError:
        self._place(name)
        source = next((wire.source for wire in self._wiring.wires if wire.target == name), "")
        if source:
            text = f'"{name}" is fed by {source}: set that, or open the system without this wire.'
        else:
            text = f'"{name}" is a signal, which a scenario gives; open it with another one to change it.'
        return WiringError(text, culprit=name)

    def _place(self, name: str) -> int:
        try:
            return self._places[name]
        except KeyError:
            names = self.names
            raise WiringError(
                f'There is no "{name}"; there are: {", ".join(names)}.', culprit=name, choices=names
            ) from None

    @property
    def outside(self) -> tuple[str, ...]:
        """A sentence for each range, in which a component is proven, that recorded rows have left: when, and how far.

        The end of the `with` warns of them (`OutsideProvenRangeWarning`), once.
        """
        row_time = self._plan.decimation * self._plan.step
        for rows in self._rows[self._watched :] if self._proven else ():
            t = self._plan.start + (self._seen_rows + np.arange(rows.shape[1])) * row_time
            for one, values in zip(self._proven, rows[self._recorded :], strict=True):
                one.see(t, values)
            self._seen_rows += rows.shape[1]
        self._watched = len(self._rows)
        return tuple(said_of(self._proven))

    @property
    def recording(self) -> Recording:
        """What was recorded so far: the rows that are complete, by the columns of the system."""
        rows = np.concatenate([np.empty((len(self._plan.columns), 0)), *self._rows], axis=1)
        writer = writer_of(self._wiring, self._plan, {}, None)
        t = self._plan.start + np.arange(rows.shape[1]) * self._plan.decimation * self._plan.step
        writer.write({"t": t} | dict(zip(self._wiring.records, rows, strict=True)))
        found = kept(writer, self._system.name)
        own = {"t", *self._system.records}
        table = {name: values for name, values in found.table.items() if name in own}
        return replace(found, table=table)


class Hand:
    """A signal whose value is set by hand; it feeds an input."""

    def __init__(self, feeds: str, value: float, unit: str) -> None:
        self.feeds, self.value, self.outputs = feeds, value, {"value": unit}

    def stream(self, step: float) -> Callable[[np.ndarray], np.ndarray]:
        """Make a stream of the value as it is when ticks are asked for."""
        return lambda ticks: np.full((1, len(ticks)), self.value)


def _in_hand(wiring: Wiring) -> Wiring:
    """The same with a hand on each input that no wire feeds, and with all outputs in sight."""
    open_ = {name: port for name in wiring.unconnected() if (port := wiring.port(name)) and _is_number(port)}
    hands = {f"{HAND} {k}": Hand(name, _start(port), port.unit) for k, (name, port) in enumerate(open_.items())}
    wires = [Wire(f"{HAND} {k}.value", name) for k, name in enumerate(open_)]
    outputs = [
        f"{name}.{port.name}"
        for name, one in wiring.components.items()
        for port in one.ports.values()
        if port.causality == "output" and _is_number(port)
    ]
    seen = {f"{SEEN}{name}": Record(name) for name in outputs[:MOST]}
    return replace(
        wiring,
        signals={**wiring.signals, **hands},
        wires=[*wiring.wires, *wires],
        records={**wiring.records, **seen},
    )


def _is_number(port: Port) -> bool:
    return port.type in FLOATS and not port.shape


def _start(port: Port) -> float:
    return float(port.start) if isinstance(port.start, int | float) else 0.0


def _places(wiring: Wiring, plan: Plan) -> dict[str, int]:
    """Places on the bus by name: outputs, inputs that are fed, signals of the system."""
    places: dict[str, int] = {}
    for part in plan.parts:
        places |= {f"{part.name}.{name}": part.output + k for k, name in enumerate(part.output_names)}
        places |= {f"{part.name}.{name}": part.input + k for k, name in enumerate(part.input_names)}
    names = [f"{name}.{output}" for name, one in wiring.sources().items() for output in one.outputs]
    signals = {name: plan.signal + k for k, name in enumerate(names)}
    return places | {name: place for name, place in signals.items() if not name.startswith(f"{HAND} ")}


def _hands(wiring: Wiring) -> dict[str, tuple[int, Hand]]:
    """The row among all signals, and the hand, of each input that is set by hand."""
    rows = [one for one in wiring.sources().values() for _ in one.outputs]
    return {one.feeds: (k, one) for k, one in enumerate(rows) if isinstance(one, Hand)}
