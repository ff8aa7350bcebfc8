"""A component of which variables of other types than double are wired or recorded: typed.c stands before its functions.

The loop sees doubles, as always; a component of plain reals alone goes to it without this detour.
"""

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, Structure, c_double, c_int64, c_void_p, sizeof
from dataclasses import dataclass, field
from itertools import groupby
from math import prod
from typing import Any

import numpy as np

from cosim.fmi.component import Functions, Port
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.types import FLOATS, OPAQUE, article, function_of, limits
from cosim.fmi.values import LARGEST_FLOAT32
from cosim.master.loop import library
from cosim.master.pool import Pool
from cosim.support.errors import WiringError

_KINDS = ("Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
_TRUTH2, _TRUTH3, _TEXT, _BYTES, _EXACT = range(len(_KINDS), len(_KINDS) + 5)


@dataclass(frozen=True)
class Use:
    """A variable or an element of one on the bus; `cast`: it may be rounded; `exact`: its 64 bits are in the pool."""

    port: Port
    cast: bool = False
    exact: bool = False

    @property
    def plain(self) -> bool:
        """Whether the loop can hand it to the FMU as it is."""
        return self.port.real

    @property
    def opaque(self) -> bool:
        """Whether the bus carries its number in the pool."""
        return self.exact or self.port.type in OPAQUE


class _Variable(Structure):
    _fields_ = [
        ("kind", c_int64),
        ("reference", c_int64),
        ("size", c_int64),
        ("first", c_int64),
        ("count", c_int64),
        ("element", c_void_p),
        ("cast", c_void_p),
        ("access", c_void_p),
        ("content", c_void_p),
        ("length", c_void_p),
        ("item", c_void_p),
        ("items", c_int64),
        ("read", c_void_p),
    ]


class _Typed(Structure):
    _fields_ = [
        ("version", c_int64),
        ("instance", c_void_p),
        ("inner_version", c_int64),
        ("inner", c_void_p),
        ("set", c_void_p),
        ("get", c_void_p),
        ("step", c_void_p),
        ("save", c_void_p),
        ("restore", c_void_p),
        ("plain_input", c_void_p),
        ("plain_output", c_void_p),
        ("plain_inputs", c_int64),
        ("plain_outputs", c_int64),
        ("inputs", c_int64),
        ("outputs", c_int64),
        ("input", POINTER(_Variable)),
        ("output", POINTER(_Variable)),
        ("pool", c_void_p),
        ("begun", c_int64),
        ("culprit", c_int64),
        ("wrong", c_double),
        ("start", c_double),
        ("altered", c_void_p),
    ]


_SET = ctypes.CFUNCTYPE(ctypes.c_int, c_void_p, c_void_p, ctypes.c_size_t, c_void_p)
_STEP = ctypes.CFUNCTYPE(ctypes.c_int, c_void_p, c_double, c_double, ctypes.c_int)
_SAVE = ctypes.CFUNCTYPE(ctypes.c_int, c_void_p, c_void_p)


def by_variable(uses: Sequence[Use]) -> list[Use]:
    """Put plain reals first and the elements of each variable side by side, as typed.c wants them."""
    return sorted(uses, key=lambda use: ("", 0, 0) if use.plain else (*_variable(use), use.port.element))


@dataclass
class TypedComponent:
    """A component whose inputs and outputs on the bus are these uses, in the order of `by_variable`.

    Its time is that of the loop and `begin` [s].

    Raises:
        WiringError: the compiled loop is missing, or the component has no such variables to give.
    """

    component: FmuComponent
    inputs: Sequence[Use]
    outputs: Sequence[Use]
    pool: Pool | None
    begin: float = 0.0
    _kept: list[Any] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        found = library()
        if found is None or not hasattr(found, "typed_layout") or found.typed_layout() != LAYOUT:
            name = next((f"{self.name}.{use.port.name}" for use in (*self.inputs, *self.outputs) if not use.plain), "")
            what = f'"{name}" is no double, and other types need' if name else f"{self.name} starts late, which needs"
            message = f"{what} the compiled loop, which is missing here."
            raise WiringError(message, culprit=name or self.name)
        self._typed = self._made()
        inner = self.component.functions
        assert inner is not None  # FMUs have functions, and only they have other types
        self._calls = {name: getattr(found, f"typed_{name}") for name in ("set", "get", "step", "save", "restore")}
        addresses = {name: ctypes.cast(call, c_void_p).value or 0 for name, call in self._calls.items()}
        if not inner.save:
            addresses |= {"save": 0, "restore": 0}
        self.functions = Functions(
            2, ctypes.addressof(self._typed), **addresses, state=inner.state, altered=inner.altered
        )

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.component, name)

    def narrowed(self, places: Sequence[int], inputs: bool) -> "TypedComponent | FmuComponent":
        """Return the component with only these of its inputs, or of its outputs, by their places among those here."""
        uses = [(self.inputs if inputs else self.outputs)[place] for place in places]
        if not needs_types(uses):
            return self.component
        return TypedComponent(self.component, uses if inputs else (), () if inputs else uses, self.pool)

    def set(self, references: np.ndarray, values: np.ndarray) -> int:
        """Set inputs from their values on the bus."""
        return int(_SET(self.functions.set)(self.functions.instance, None, len(values), values.ctypes.data))

    def get(self, references: np.ndarray, values: np.ndarray) -> int:
        """Write outputs to their values on the bus."""
        return int(_SET(self.functions.get)(self.functions.instance, None, len(values), values.ctypes.data))

    def step(self, time: float, size: float, final: bool = True) -> int:
        """Go from `time` to `time + size`, both in s."""
        return int(_STEP(self.functions.step)(self.functions.instance, time, size, final))

    def messages(self) -> tuple[str, ...]:
        """What the component said last, or which value of which variable does not fit."""
        return (*self.component.messages(), *([self._misfit()] if self._typed.culprit != _NOBODY else []))

    def shown(self, name: str, value: float) -> str:
        """Write a value of the bus for a person."""
        use = next((one for one in self.inputs if one.port.name == name), None)
        if use is None or not use.opaque or self.pool is None:
            return f"{value:.9g}"
        found = self.pool.column(np.array([value]), use.port.type)[0]
        return f"{len(found)} bytes" if isinstance(found, bytes) else f"{found!r}"

    def _misfit(self) -> str:
        place, value = self._typed.culprit, self._typed.wrong
        use = self.inputs[place] if place >= 0 else self.outputs[-1 - place]
        name = f'"{self.name}.{use.port.name}"'
        if use.opaque:
            return f"{name} found no room"
        if place < 0:
            return f"{name} is {_digits(value)}, and of integers only those below 2^53 are exact as a double"
        return f"{name} is fed {_digits(value)}; {_rule(use.port, value)}"

    def _made(self) -> _Typed:
        inner = self.component.functions
        assert inner is not None
        plain = [self._references([use for use in uses if use.plain]) for uses in (self.inputs, self.outputs)]
        variables = [self._variables(uses, access) for uses, access in ((self.inputs, "Set"), (self.outputs, "Get"))]
        return _Typed(
            version=getattr(self.component, "version", 2),
            instance=getattr(self.component, "instance", inner.instance),
            inner_version=inner.version,
            inner=inner.instance,
            set=inner.set,
            get=inner.get,
            step=inner.step,
            save=inner.save,
            restore=inner.restore,
            plain_input=plain[0].ctypes.data,
            plain_output=plain[1].ctypes.data,
            plain_inputs=len(plain[0]),
            plain_outputs=len(plain[1]),
            inputs=len(variables[0]),
            outputs=len(variables[1]),
            input=self._keep((_Variable * len(variables[0]))(*variables[0])),
            output=self._keep((_Variable * len(variables[1]))(*variables[1])),
            pool=self.pool.address if self.pool else 0,
            culprit=_NOBODY,
            start=self.begin,
            altered=inner.altered,
        )

    def _variables(self, uses: Sequence[Use], access: str) -> list[_Variable]:
        listed = [(number, use) for number, use in enumerate(uses) if not use.plain]
        return [self._variable(list(of), access) for _, of in groupby(listed, key=lambda one: _variable(one[1]))]

    def _variable(self, of: list[tuple[int, Use]], access: str) -> _Variable:
        first, use = of[0]
        port, size = use.port, prod(self.component.ports[use.port.variable].shape)
        if access == "Set" and len(of) < size and (port.type in OPAQUE or use.exact):
            message = f'"{self.name}.{port.variable}" has {size} elements, of which {len(of)} are wired; wire all.'
            raise WiringError(message, culprit=f"{self.name}.{port.variable}")
        items = self._keep(np.array(sorted(port.items), dtype=np.float64))
        return _Variable(
            kind=self._kind(use),
            reference=port.reference,
            size=size,
            first=first,
            count=len(of),
            element=self._keep(np.array([one.port.element for _, one in of], dtype=np.int64)).ctypes.data,
            cast=self._keep(np.array([one.cast for _, one in of], dtype=np.int64)).ctypes.data,
            access=self._address(access, port),
            content=self._keep(np.zeros(size, dtype=np.int64)).ctypes.data,
            length=self._keep(np.zeros(size, dtype=np.int64)).ctypes.data,
            item=items.ctypes.data,
            items=len(items),
            read=self._address("Get", port),
        )

    def _kind(self, use: Use) -> int:
        kind = use.port.type
        if use.exact:
            return _EXACT
        if kind == "Clock":
            rule = "clocks need scheduled execution here: others are stepped without event mode and see to their own"
            raise WiringError(f'"{self.name}.{use.port.name}" is a Clock; {rule}.', culprit=use.port.name)
        special = {"Boolean": _TRUTH2 if self.component.version == 2 else _TRUTH3, "String": _TEXT, "Binary": _BYTES}
        named = "Int32" if self.component.version == 2 else "Int64"
        return special[kind] if kind in special else _KINDS.index(named if kind == "Enumeration" else kind)

    def _address(self, access: str, port: Port) -> int:
        found = self.component.address(access + function_of(port.type, self.component.version))
        if not found:
            what = f"is {article(port.type)}, and the library of its FMU has no function for it"
            raise WiringError(f'"{self.name}.{port.name}" {what}.', culprit=f"{self.name}.{port.name}")
        return found

    def _references(self, uses: Sequence[Use]) -> np.ndarray:
        found = np.array([use.port.reference for use in uses], dtype=np.uint32)
        self._kept.append(found)
        return found

    def _keep(self, one: Any) -> Any:
        self._kept.append(one)
        return one


def _variable(use: Use) -> tuple[str, int]:
    """Tell a variable from others: in FMI 2 each type has value references of its own."""
    return use.port.type, use.port.reference


def _digits(value: float) -> str:
    return repr(value).removesuffix(".0") if abs(value) < 1e16 else f"{value:.17g}"


def _rule(port: Port, value: float) -> str:
    if port.items:
        return f"its items are: {', '.join(f'{value} ({name})' for value, name in port.items.items())}"
    if port.type == "Boolean":
        return "a Boolean takes 0 or 1"
    if abs(value) > LARGEST_FLOAT32 and port.type == "Float32":
        return "that is beyond a Float32"
    if port.type in FLOATS:
        return f"{article(port.type)} cannot hold that exactly; cast = true takes the nearest value"
    low, high = limits(port.type)
    return f"{article(port.type)} takes whole numbers from {low} to {high}"


_NOBODY = -(1 << 62)
LAYOUT = sizeof(_Typed) + 3 * sizeof(_Variable)
"""What typed_layout() of a library that fits returns."""


def needs_types(uses: Sequence[Use]) -> bool:
    """Say whether a component needs a `TypedComponent` to have these on the bus."""
    return not all(use.plain for use in uses)
