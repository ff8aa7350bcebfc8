"""A system ready to be nested: opened, planned, started once, with everything that its FMU must do again."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from cosim.data.signals import Constant, Samples
from cosim.fmi.description import INTERFACES, describe
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.settings import STRUCTURAL, Setting
from cosim.fmi.types import function_of
from cosim.master.given import Given
from cosim.master.initialisation import initialise
from cosim.master.opening import started, wiring_of
from cosim.master.planning import make_plan
from cosim.master.typed import TypedComponent
from cosim.support.errors import WiringError
from cosim.system.plan import Part, Plan
from cosim.system.ports import PortRef
from cosim.system.system import Fmu, Function, System
from cosim.system.wiring import Wiring

LARGEST = 512_000_000
"""Bytes of signals, tick by tick, that an FMU takes along at most."""
NUMBERS = ("SetReal", "SetFloat64", "SetInteger", "SetInt32", "SetInt64", "SetBoolean")
"""FMI's functions for parameters that are numbers, as the binary knows them."""


@dataclass(frozen=True)
class Start:
    """Something that happens at the start: inputs of a part are fed, outputs read, or it leaves initialisation mode."""

    kind: Literal["FEED", "READ", "LEAVE"]
    part: int
    places: tuple[int, ...] = ()


@dataclass(frozen=True)
class Told:
    """A parameter that the scenario gives: part, FMI's set function, and whether it is set in initialisation mode."""

    part: int
    function: str
    reference: int
    values: tuple[Any, ...]
    late: bool


@dataclass(frozen=True)
class Binary:
    """Where an FMU has its library for this platform, with those beside it; and its token (FMI 2: GUID)."""

    folder: str
    name: str
    token: str

    @property
    def path(self) -> str:
        """In the archive."""
        return f"{self.folder}{self.name}"


@dataclass(frozen=True)
class Prepared:
    """Everything that the FMU of a system holds; `bus` is that before the start, `signals` are (signals, ticks + 1).

    Where all signals are constant, they are (signals, 1).
    """

    name: str
    wiring: Wiring
    plan: Plan
    ticks: int
    bus: np.ndarray
    signals: np.ndarray
    starts: tuple[Start, ...]
    given: tuple[Told, ...]
    binaries: tuple[Binary, ...]
    limited: bool
    """Whether signals say nothing beyond the end of the run: all but constants do."""

    @property
    def components(self) -> tuple[FmuComponent, ...]:
        """The components as FMUs, in the order of the plan."""
        return tuple(_plain(part) for part in self.plan.parts)


def prepare(stack: ExitStack, system: System) -> Prepared:
    """Open a system, start it once and note how; the stack closes the components.

    Raises:
        WiringError: it has what cannot be nested, in a sentence; or as `simulate`.
    """
    _check_sources(system)
    wiring = wiring_of(stack, system)
    plan = make_plan(wiring, system.step, 1)
    _check_plan(plan)
    settings = started(wiring, system, plan)
    limited = any(not _is_constant(name, wiring) for name in wiring.sources())
    count = system.ticks + 1 if limited else 1
    if count * plan.signals * 8 > LARGEST:
        what = f"{plan.signals} signals at {count:,} ticks"
        raise WiringError(f"The signals of {system.name} do not go into an FMU: {what} are over {LARGEST:,} bytes.")
    signals = Given(wiring, plan).at(np.arange(count))
    noted = _Noted(plan)
    initialise(noted.plan, settings, signals[:, 0])
    return Prepared(
        name=system.name,
        wiring=wiring,
        plan=plan,
        ticks=system.ticks,
        bus=noted.bus if noted.bus is not None else plan.bus.copy(),
        signals=signals,
        starts=tuple(noted.starts),
        given=tuple(_given(plan, settings)),
        binaries=tuple(_binary(_plain(part)) for part in plan.parts),
        limited=limited,
    )


def _is_constant(name: str, wiring: Wiring) -> bool:
    """Whether a signal is one number for ever, and no fault changes that."""
    signal = wiring.sources()[name]
    faulty = any(PortRef(fault.on).owner == name for fault in wiring.faults)
    return not faulty and (isinstance(signal, Constant) or (isinstance(signal, Samples) and signal.constant))


def _binary(fmu: FmuComponent) -> Binary:
    import fmpy

    said = describe(fmu.path)
    folder = f"binaries/{fmpy.platform if fmu.version == 2 else fmpy.platform_tuple}/"
    name = f"{said.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
    return Binary(folder, name, said.guid if fmu.version == 2 else said.instantiationToken)


def _check_sources(system: System) -> None:
    """Refuse what has no binary for FMI's co-simulation."""
    for name, source in system.components.items():
        if isinstance(source, Function):
            raise _refused(system, f'the component "{name}" is a Python function; export it as an FMU first')
        if isinstance(source, Fmu) and source.interface not in ("", "co-simulation"):
            raise _refused(system, f'the component "{name}" is stepped by {source.interface}, {_ADVICE}')
    if system.start:
        raise _refused(system, f"it starts at {system.start:g} s, and an FMU of a system starts at 0 s")


def _check_plan(plan: Plan) -> None:
    for part in plan.parts:
        if isinstance(part.component, TypedComponent) or plan.pool is not None:
            raise _refused(plan, f'wires or records of "{part.name}" carry other values than doubles')
        if type(_plain(part)) is not FmuComponent:
            raise _refused(plan, f'the component "{part.name}" is stepped by {word_of(part)}, {_ADVICE}')
        if any(link.breaks_loop for link in part.links):
            raise _refused(plan, f'a wire to "{part.name}" breaks a ring of values at the start (breaks_loop)')


_ADVICE = "and only co-simulation can be nested: leave `interface` out where its FMU has both, else export it for that"


def word_of(part: Part) -> str:
    """What a part is stepped by."""
    return INTERFACES.get(str(getattr(_plain(part), "interface", "")), "another interface")


def _refused(system: System | Plan, why: str) -> WiringError:
    name = f'"{system.name}"' if isinstance(system, System) else "This system"
    return WiringError(f"{name} cannot become one FMU: {why}.")


def _plain(part: Part) -> FmuComponent:
    """The FMU itself, behind names of ours."""
    component: Any = part.component
    behind: FmuComponent = getattr(component, "behind", component)
    return behind


def _given(plan: Plan, settings: Any) -> Sequence[Told]:
    found = []
    for number, part in enumerate(plan.parts):
        component: Any = part.component
        for one in component.settings(settings.get(part.name, {})):
            found.append(_as_given(plan, number, one, _plain(part).version))
    return found


def _as_given(plan: Plan, number: int, one: Setting, version: int) -> Told:
    name = f'"{plan.parts[number].name}.{one.port.name}"'
    function = f"Set{function_of(one.port.type, version)}"
    if one.port.causality == STRUCTURAL:
        raise _refused(plan, f"{name} is a structural parameter")
    several = len(one.values) > 1 and function != "SetFloat64"
    if several or function not in (*NUMBERS, "SetString"):
        raise _refused(plan, f"{name} is set, and parameters of its type ({one.port.type}) are not taken along")
    return Told(number, function, one.port.reference, tuple(one.values), one.port.causality == "input")


class _Noted:
    """A plan whose components note what the start of a run does with them."""

    def __init__(self, plan: Plan) -> None:
        self.starts: list[Start] = []
        self.bus: np.ndarray | None = None
        parts = [replace(part, component=_Noting(self, k, part)) for k, part in enumerate(plan.parts)]  # type: ignore[arg-type]
        self.plan = replace(plan, parts=tuple(parts))

    def note(self, start: Start) -> None:
        """Note a call; the bus as it was before the first."""
        if self.bus is None:
            self.bus = self.plan.bus.copy()
        fed = {place for one in self.starts if (one.kind, one.part) == ("FEED", start.part) for place in one.places}
        if start.kind == "FEED" and fed & set(start.places):
            name = self.plan.parts[start.part].name
            raise _refused(self.plan, f'values at the start depend on each other in a ring, to which "{name}" belongs')
        self.starts.append(start)


class _Noting:
    """A component that notes, and does, what it is asked."""

    def __init__(self, noted: _Noted, number: int, part: Part) -> None:
        self._noted, self._number, self._part = noted, number, part

    def set(self, references: np.ndarray, values: np.ndarray) -> int:
        """Set inputs, and note which."""
        self._noted.note(Start("FEED", self._number, self._places(self._part.input_references, references)))
        return self._part.component.set(references, values)

    def get(self, references: np.ndarray, values: np.ndarray) -> int:
        """Read outputs, and note which."""
        if len(references):
            self._noted.note(Start("READ", self._number, self._places(self._part.output_references, references)))
        return self._part.component.get(references, values)

    def exit_initialisation(self) -> None:
        """End initialisation mode, and note when."""
        self._noted.note(Start("LEAVE", self._number))
        self._part.component.exit_initialisation()

    @staticmethod
    def _places(all_of_them: np.ndarray, references: np.ndarray) -> tuple[int, ...]:
        """Places of references among those of the part; those of several names for one variable are all meant."""
        wanted = set(references.tolist())
        return tuple(k for k, one in enumerate(all_of_them.tolist()) if one in wanted)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._part.component, name)
