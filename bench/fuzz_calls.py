"""The functions of FMI 2 and 3 as their headers declare them, and calls drawn at random: sensible ones and others.

A call is plain data, so that it can be printed and written to a trace. NULL is None; a number may be the word "now",
the time of the instance when the call is made. A program is a list of journeys, and a journey, one or several calls, is
a number: hypothesis draws and shrinks lists of numbers, which is a hundred times faster than drawing every argument.
"""

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import inf, nan
from random import Random
from typing import Any

from fuzz_rules import EXCHANGE, INSTANTIATED, ORDER
from hypothesis import strategies as st

SLOTS = CELLS = 2
"""Instances that play at once; places for their saved states."""
KINDS = {
    "Component": "instance", "Instance": "instance", "Real": "double", "Float64": "double", "size_t": "count",
    "Boolean": "flag", "ValueReference": "reference", "String": "text", "Byte": "byte", "FMUstate": "state",
    "FMUState": "state", "StatusKind": "number", "EventInfo": "event",
}  # fmt: skip


@dataclass(frozen=True)
class Parameter:
    """`form` is "" (a value), "*" (one behind a pointer) or "[]" (an array); `constant` is what the callee reads."""

    kind: str
    form: str
    constant: bool


@dataclass(frozen=True)
class Call:
    """One call: the instance's slot, the function's name without its prefix, an argument for each parameter."""

    slot: int
    name: str
    arguments: tuple[Any, ...]


@cache
def functions(fmi: int) -> dict[str, tuple[Parameter, ...]]:
    """Every function that returns a status, from the headers of the installed FMPy: name -> parameters."""
    text = (files("fmpy") / "c-code" / f"fmi{fmi}FunctionTypes.h").read_text()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    found = re.findall(rf"typedef\s+fmi{fmi}Status\s+fmi{fmi}(\w+)TYPE\s*\((.*?)\);", text, re.S)
    return {name: tuple(_parameter(part) for part in inside.split(",")) for name, inside in found}


def _parameter(text: str) -> Parameter:
    words = re.findall(r"\w+", text)
    kind = KINDS.get(re.sub(r"^fmi[23]", "", words[words[0] == "const"]), "other")
    return Parameter(kind, "[]" if "[" in text else "*" if "*" in text else "", words[0] == "const")


ODD = (nan, inf, -inf, 1e300, -1e300, 5e-324, -0.0, 1e-12, 1.7e308, 2.0**53)
USUAL = (0.0, 1.0, -1.0, 0.1, 1e-3, 1e-4, 5.0)
LENGTHS = (1e-3, 1e-3, 1e-4, 2e-3, 0.05, 1.0)
TEXTS = (None, b"", b"logEvents", b"logStatusError", b"100 %s %n", b"x" * 700)
COMMON = (
    "SetTime GetFMUstate GetFMUState SetFMUstate SetFMUState NewDiscreteStates UpdateDiscreteStates "
    "SetContinuousStates GetDirectionalDerivative GetAdjointDerivative DeSerializeFMUstate DeserializeFMUState "
    "EnterEventMode EnterContinuousTimeMode GetContinuousStates GetDerivatives GetContinuousStateDerivatives "
    "GetNominalsOfContinuousStates CompletedIntegratorStep SerializeFMUstate SerializeFMUState "
    + 4
    * "DoStep SetReal SetFloat64 GetReal GetFloat64 "
).split()
PROGRAMS = st.tuples(st.integers(0, 2**24 - 1), st.lists(st.integers(0, 2**24 - 1), min_size=20, max_size=80))
"""A seed and a list of journeys; the number 0 is a journey of no calls."""


class Calls:
    """Turns numbers into calls, for one model (`facts`, see fuzz_models.py) and one version of FMI."""

    def __init__(self, facts: dict[str, Any]) -> None:
        self.fmi, self.facts, self.functions = facts["fmi"], facts, functions(facts["fmi"])
        kinds = [row[1] for row in facts["variables"]]
        self.size, self.states = len(kinds), kinds.count("rate")
        self.calculated = [i for i, kind in enumerate(kinds) if kind in ("rate", "output")] or [0]
        self.given = [i for i, kind in enumerate(kinds) if kind not in ("rate", "output")]
        self.inputs = [i for i, kind in enumerate(kinds) if kind == "input"] or [0]
        self.common = [name for name in COMMON if name in self.functions]
        self.all = [*self.functions, "Instantiate", "FreeInstance"]

    def program(self, seed: int, numbers: Sequence[int], mode: Callable[[int], tuple[int, int]]) -> Iterator[Call]:
        """An instance in each slot, then the journeys. A number that comes again is another journey.

        `mode` tells the mode and the interface of the instance in a slot when it is asked, or zeros if there is none.
        """
        for slot in range(SLOTS):
            kind = ("CS", "ME")[seed >> slot & 1]
            yield Call(slot, "Instantiate", (kind, (self.facts["token"].encode(), None), True, False))
        met = Counter[int]()
        for number in filter(None, numbers):
            met[number] += 1
            draw = Random(f"{seed} {number} {met[number]}")
            slot = draw.randrange(SLOTS)
            yield from self._journey(draw, slot, *mode(slot))

    def _journey(self, draw: Random, slot: int, phase: int, simulation: int) -> list[Call]:
        """Mostly what is in order, sometimes anything."""
        if (phase <= INSTANTIATED and draw.random() < 0.5) or not often(draw, 40):
            return list(self._begin(draw, slot)) if phase else [Call(slot, "Instantiate", self._instance(draw))]
        in_order = [
            name for name in self.common if ORDER.get(name, 63) & phase and not (name in EXCHANGE and simulation)
        ]
        name = draw.choice(in_order if in_order and often(draw, 4) else self.all)
        special: dict[str, Callable[[Random], tuple[Any, ...]]] = {
            "Instantiate": self._instance, "FreeInstance": lambda _: (), "DeSerializeFMUstate": self._damage,
            "DeserializeFMUState": self._damage,
        }  # fmt: skip
        return [Call(slot, name, special[name](draw) if name in special else self._arguments(draw, name))]

    def _begin(self, draw: Random, slot: int) -> Iterator[Call]:
        """From instantiation, perhaps after a reset, to the first step or the first time instant of model exchange."""
        setting = "SetReal" if self.fmi == 2 else "SetFloat64"
        if draw.random() < 0.5:
            yield Call(slot, "Reset", (True,))
        experiment = (True, draw.random() < 0.5, 1e-5, draw.choice((0.0, 0.0, 5.0, -3.0)), False, 0.0)
        if self.fmi == 2:
            yield Call(slot, "SetupExperiment", experiment)
        yield Call(slot, "EnterInitializationMode", experiment if self.fmi == 3 else (True,))
        for _ in range(draw.randrange(3)):
            yield Call(slot, setting, self._arguments(draw, setting))
        yield Call(slot, "ExitInitializationMode", (True,))
        if draw.random() < 0.3:
            yield Call(slot, "EnterContinuousTimeMode", (True,))

    def _instance(self, draw: Random) -> tuple[Any, ...]:
        """Kind, token and folder of resources, whether there is a logger, whether it wants all messages."""
        token = self.facts["token"].encode() if often(draw, 15) else draw.choice((None, b"{0}"))
        texts = token, draw.choice((None, b"", b"file:///there/is/nothing"))
        return draw.choice(("ME", "CS", "CS")), texts, often(draw, 9), draw.random() < 0.5

    def _damage(self, draw: Random) -> tuple[Any, ...]:
        """Whose state, what is done to it (`fuzz_fmu.damaged`), where it goes, which argument is NULL."""
        what = draw.choice(("whole", "whole", "foreign", "flipped", "cut", "longer", "forged", "forged", "forged"))
        place = draw.randrange(8) if what == "longer" or draw.random() < 0.5 else draw.randrange(4000)
        number = draw.choice((self._number(draw), self._number(draw), draw.getrandbits(64), self._two_small(draw)))
        missing = "" if often(draw, 15) else draw.choice(("instance", "bytes", "place"))
        return draw.randrange(SLOTS), (what, place, number), draw.randrange(CELLS), missing

    @staticmethod
    def _two_small(draw: Random) -> int:
        """Two integers of four bytes, as an interface and a mode would be."""
        return draw.choice((0, 1, 2, 3, 4, 8, 16, 32, 63)) << 32 | draw.randrange(3)

    def _arguments(self, draw: Random, name: str) -> tuple[Any, ...]:
        """An argument for each parameter; arrays are as long as the count after them says, else the largest one."""
        parameters = self.functions[name]
        counts = self._counts(draw, name, parameters)
        drawn: list[Any] = []
        for i, one in enumerate(parameters):
            length = next((counts[k] for k in sorted(counts) if k > i), max(counts.values(), default=1))
            length = length if one.form == "[]" else 1
            drawn.append(counts[i] if i in counts else self._argument(draw, name, one, drawn, length))
        return tuple(drawn)

    def _counts(self, draw: Random, name: str, parameters: tuple[Parameter, ...]) -> dict[int, int]:
        """Mostly one number for all counts of a call, for states mostly theirs, for bytes about what a state needs."""
        usual = [self.states] * 6 if "ContinuousState" in name or name == "GetDerivatives" else [1, 1, 1, 2, 3]
        if any(one.kind == "byte" for one in parameters):
            usual = [self.facts["bytes"] + more for more in (0, 0, 0, -1, 1)]
        one = draw.choice([*usual, 0])
        places = [i for i, one in enumerate(parameters) if one.kind == "count" and not one.form]
        return {i: one if often(draw, 25) else draw.randrange(5) for i in places}

    def _argument(self, draw: Random, name: str, one: Parameter, before: list[Any], length: int) -> Any:
        if one.kind == "instance":
            return often(draw, 30)
        if one.kind == "state":
            return draw.randrange(CELLS) if often(draw, 12) else None
        if one.form and not often(draw, 20):
            return None
        if one.kind == "double" and not one.form:
            return self._moment(draw, name, len(before))
        if one.kind == "double":
            return self._numbers(draw, name, before, length) if one.constant else (nan,) * length
        if one.kind == "reference":
            return tuple(self._reference(draw, name, before) for _ in range(length)) if one.form else draw.randrange(9)
        if one.kind == "text":
            return tuple(draw.choice(TEXTS) for _ in range(length))
        return length if one.form else draw.random() < 0.5 if one.kind == "flag" else draw.randrange(5)

    def _moment(self, draw: Random, name: str, place: int) -> Any:
        """A time, a length of a step, or another single number."""
        if name in ("SetTime", "DoStep") and place == 1 and often(draw, 2):
            return "now"
        if name == "SetTime" and draw.random() < 0.5:
            return draw.choice(ODD)
        return draw.choice(LENGTHS) if name == "DoStep" and often(draw, 4) else self._number(draw)

    def _number(self, draw: Random) -> float:
        if often(draw, 5):
            return draw.choice(USUAL) if draw.random() < 0.5 else draw.uniform(-2, 2)
        return draw.choice(ODD) if draw.random() < 0.5 else struct.unpack("<d", draw.randbytes(8))[0]

    def _numbers(self, draw: Random, name: str, before: list[Any], length: int) -> tuple[float, ...]:
        """What is set is often near its start value."""
        references = before[1] if name in ("SetReal", "SetFloat64") and before[1] else ()
        starts = [self.facts["variables"][i][2] if i < self.size else 0.0 for i in references] + [0.0] * length
        near = [start * draw.choice((1.0, 1.01, 0.5)) for start in starts[:length]]
        return tuple(start if draw.random() < 0.5 else self._number(draw) for start in near)

    def _reference(self, draw: Random, name: str, before: list[Any]) -> int:
        """Derivatives mostly ask for what is calculated by what is given; all else asks for anything."""
        if not often(draw, 20):
            return draw.choice((self.size, self.size + 1, 2**31, 2**32 - 1))
        if "Derivative" in name and often(draw, 5):
            return draw.choice(self.given if any(isinstance(one, tuple) for one in before) else self.calculated)
        return draw.choice(self.inputs) if draw.random() < 0.2 else draw.randrange(self.size)


def often(draw: Random, times: int) -> bool:
    """True, but for one time in that many and one."""
    return draw.randrange(times + 1) > 0


def length_of(parameters: tuple[Parameter, ...], arguments: tuple[Any, ...], place: int) -> int:
    """How many numbers of an array count: what the count after it says, else the first one of the call."""
    counts = [i for i, one in enumerate(parameters) if one.kind == "count" and not one.form]
    if parameters[place].form == "*":
        return 1
    return int(arguments[next((i for i in counts if i > place), counts[0])])
