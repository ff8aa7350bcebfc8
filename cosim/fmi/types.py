"""FMI's types of variables: what each holds, and which of two holds every value of the other.

A wire never changes a value silently. It is refused where the target's type does not hold what the source's may give,
or, where only rare values do not fit (an Int64 beyond 2^53 as a double), watched. `cast = true` on a wire asks for the
nearest value of the target's type; what lies out of its range ends the run all the same.

Reference: Functional Mock-up Interface 3.0.2, 2.2.3 (data types).
"""

from collections.abc import Mapping
from math import prod

FLOATS = {"Float32": 24, "Float64": 53}
"""Bits of the significand: integers up to two to that power are exact."""
INTEGERS = {f"{sign}Int{bits}": bits for bits in (8, 16, 32, 64) for sign in ("", "U")}
"""Bits of integers."""
OPAQUE = ("String", "Binary")
"""Types whose values are carried as they are: no gain, no mean, no conversion."""
WIDE = ("Int64", "UInt64")
"""Integers of which a double does not hold all."""
OF_FMI2 = {"Real": "Float64", "Integer": "Int32"}


def function_of(kind: str, version: int) -> str:
    """Return how FMI's set and get functions call a type: `fmi2SetReal`, `fmi3SetInt64` for an enumeration."""
    names = {"Float64": "Real", "Int32": "Integer", "Enumeration": "Integer"}
    return names.get(kind, kind) if version == 2 else {"Enumeration": "Int64"}.get(kind, kind)


def limits(kind: str) -> tuple[int, int]:
    """Return the least and greatest value of an integer type.

    An enumeration of FMI 3 has 64 bits; one of FMI 2 has 32, and its items lie within them.
    """
    bits = INTEGERS.get(kind, 64)
    return (0, 2**bits - 1) if kind.startswith("U") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def refusal(source: str, target: str, items: tuple[Mapping[int, str], Mapping[int, str]] = ({}, {})) -> str:
    """Say why not every value of type `source` is one of type `target`; empty where each is, or nearly each.

    Args:
        source: FMI type of what gives.
        target: FMI type of what takes.
        items: names of the values of enumerations, of the source and of the target.
    """
    if "Enumeration" in (source, target):
        return _of_enumerations(source, target, *items)
    if source == target or (source in ("Boolean", "Clock") and target not in OPAQUE):
        return ""
    if source in OPAQUE or target in OPAQUE or target in ("Boolean", "Clock"):
        return f"{article(target)} cannot hold {article(source)}"
    if target in FLOATS:
        return "" if source in INTEGERS or source == "Float32" else _narrow(source, target)
    if source in FLOATS:
        return _narrow(source, target)
    inside = limits(target)[0] <= limits(source)[0] and limits(source)[1] <= limits(target)[1]
    return "" if inside else _narrow(source, target)


def _of_enumerations(source: str, target: str, have: Mapping[int, str], need: Mapping[int, str]) -> str:
    if source == target:
        strange = [f"{value} ({name})" for value, name in have.items() if need.get(value, name) != name]
        strange += [f"{value} ({name})" for value, name in have.items() if need and value not in need]
        return f"the target does not know {strange[0]}; map its items" if strange else ""
    if (source == "Enumeration" and (target in INTEGERS or target == "Float64")) or source in INTEGERS:
        return ""  # of an integer, each value must be an item when it comes
    return f"{article(target)} cannot hold every {source}"


def _narrow(source: str, target: str) -> str:
    return f"{article(target)} does not hold every {source}; cast = true takes the nearest value"


def castable(source: str, target: str) -> bool:
    """Say whether `cast = true` can bring values of one type into the other."""
    return not ({source, target} & {*OPAQUE, "Clock"})


def article(kind: str) -> str:
    """Write a type with its article."""
    return f"{'an' if kind[0] in 'EI' else 'a'} {kind}"


def elements(shape: tuple[int, ...]) -> list[tuple[int, ...]]:
    """List the indices of an array's elements in FMI's order (the last runs fastest), counted from 1."""
    found = []
    for number in range(prod(shape)):
        index = []
        for size in reversed(shape):
            index.append(number % size + 1)
            number //= size
        found.append(tuple(reversed(index)))
    return found


def indexed(name: str, index: tuple[int, ...]) -> str:
    """Name an element of an array as FMI's naming convention does: `A[1,2]`."""
    return f"{name}[{','.join(map(str, index))}]"
