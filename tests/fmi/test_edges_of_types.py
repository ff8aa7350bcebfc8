"""The edges of FMI's types: the least and the greatest value arrive, the next one beyond is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mirror_fmu import named
from simulating import pair, simulate

from cosim.fmi.component import Port
from cosim.fmi.types import refusal
from cosim.fmi.values import prepared
from cosim.support.errors import FmuError, StepError, WiringError
from cosim.system.conversions import check_wire
from cosim.system.wire import Wire

EDGES = {
    "Int8": (-128, 127),
    "UInt8": (0, 255),
    "Int16": (-32_768, 32_767),
    "UInt16": (0, 65_535),
    "Int32": (-2_147_483_648, 2_147_483_647),
    "UInt32": (0, 4_294_967_295),
    "Int64": (-9_223_372_036_854_775_808, 9_223_372_036_854_775_807),
    "UInt64": (0, 18_446_744_073_709_551_615),
}
"""FMI 3.0.2, 2.4.3: what each integer type holds."""
AS_DOUBLE = {
    "Int64": (-(2.0**63), 2.0**63 - 1024, -(2.0**63) - 2048, 2.0**63),
    "UInt64": (0.0, 2.0**64 - 2048, -1.0, 2.0**64),
}
"""Of 64 bits: the least and greatest double within, and the nearest beyond."""


def fed(mirror: dict[int, Path], kind: str, values: list[float], output: str = "") -> np.ndarray:
    """What an input of a type is fed, recorded at its output of the step after."""
    into, out = named(kind)
    return simulate(
        {"m": mirror[3]},
        [Wire("s", f"m.{into}")],
        record={"y": f"m.{output or out}"},
        step=0.1,
        ticks=len(values),
        signals={"s": np.array(values, dtype=float)},
    ).recording["y"]


@pytest.mark.parametrize("kind", EDGES)
def test_a_wire_carries_the_edges_of_each_integer_and_nothing_beyond(kind: str, mirror: dict[int, Path]) -> None:
    low, high = EDGES[kind]
    least, most, below, above = AS_DOUBLE.get(kind, (low, high, low - 1, high + 1))
    if kind in AS_DOUBLE:  # no double that is recorded is exact there
        fed(mirror, kind, [least, most, 0.0, 0.0], "float64_out")
    else:
        np.testing.assert_array_equal(fed(mirror, kind, [least, most, 0.0, 0.0])[1:3], [least, most])
    for beyond in (below, above):
        with pytest.raises(StepError, match=f"takes whole numbers from {low} to {high}"):
            fed(mirror, kind, [0.0, beyond, 0.0], "float64_out")


@pytest.mark.parametrize("kind", EDGES)
def test_a_parameter_takes_the_edges_of_each_integer_and_nothing_beyond(kind: str, mirror: dict[int, Path]) -> None:
    low, high = EDGES[kind]
    into, out = named(kind)

    def read(value: int) -> object:
        found = pair(
            mirror[3], [Wire(f"one.{out}", f"two.{into}")], {"y": f"two.{out}"}, parameters={"one": {into: value}}
        )
        return (found.others["y"] if "y" in found.others else found["y"])[-1]

    assert [read(low), read(high)] == [low, high]
    for beyond in (low - 1, high + 1):
        with pytest.raises(FmuError, match=f"takes whole numbers from {low} to {high}"):
            read(beyond)


@pytest.mark.parametrize(("value", "fits"), [(3.4028234663852886e38, True), (3.402823669209385e38, False)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_float32_takes_its_largest_number_and_none_beyond(
    value: float, fits: bool, sign: float, mirror: dict[int, Path]
) -> None:
    if fits:
        assert fed(mirror, "Float32", [sign * value] * 3)[-1] == sign * value
    else:
        with pytest.raises(StepError, match="beyond a Float32"):
            fed(mirror, "Float32", [0.0, sign * value, 0.0])


HAVE = {1: "calm", 2: "angry"}


@pytest.mark.parametrize(
    ("need", "said"),
    [
        (HAVE, ""),
        (HAVE | {3: "asleep"}, ""),
        ({}, ""),
        ({1: "calm", 2: "hungry"}, "the target does not know 2 (angry)"),
        ({1: "angry", 2: "calm"}, "the target does not know 1 (calm)"),
        ({1: "calm"}, "the target does not know 2 (angry)"),
        ({1: "calm", 3: "angry"}, "the target does not know 2 (angry)"),
    ],
)
def test_enumerations_are_joined_only_where_each_item_has_the_same_name_there(need: dict[int, str], said: str) -> None:
    ends = [Port(name, 0, "output", type="Enumeration", items=items) for name, items in (("y", HAVE), ("u", need))]
    wire = Wire("one.y", "two.u")
    if said:
        assert refusal("Enumeration", "Enumeration", (HAVE, need)).startswith(said)
        with pytest.raises(WiringError, match="map its items"):
            check_wire(wire, *ends)
    else:
        check_wire(wire, *ends)


def test_an_item_is_none_of_an_enumeration_unless_it_is_there(mirror: dict[int, Path]) -> None:
    """The mirror's enumeration has 10 and 30, and nothing between."""
    assert list(fed(mirror, "Enumeration", [30.0, 10.0, 30.0, 10.0])[1:]) == [30, 10, 30]
    for wrong in (9.0, 11.0, 29.0, 31.0, 20.0):
        with pytest.raises(StepError, match=r"its items are: 10 \(calm\), 30 \(angry\)"):
            fed(mirror, "Enumeration", [10.0, wrong, 10.0], "float64_out")


@pytest.mark.parametrize(("value", "fits"), [(0.0, True), (1.0, True), (-1.0, False), (2.0, False), (0.5, False)])
def test_a_boolean_takes_zero_and_one(value: float, fits: bool, mirror: dict[int, Path]) -> None:
    if fits:
        assert fed(mirror, "Boolean", [value] * 3)[-1] == value
    else:
        with pytest.raises(StepError, match="a Boolean takes 0 or 1"):
            fed(mirror, "Boolean", [0.0, value, 0.0])


@pytest.mark.parametrize(
    ("value", "inside"),
    [(True, 1.0), (False, 0.0), ("true", 1.0), ("false", 0.0), (1, 1.0), (0, 0.0), (1.0, 1.0), (0.0, 0.0)],
)
def test_a_boolean_parameter_is_true_or_false_as_it_is_written(value: Any, inside: float) -> None:
    port = Port("b", 0, "parameter", type="Boolean")
    assert prepared(port, value, "m.b") == [bool(inside)]


@pytest.mark.parametrize("value", [2, -1, 0.5, "True", "yes", "", None])
def test_a_boolean_parameter_that_is_neither_is_refused(value: Any) -> None:
    with pytest.raises(FmuError, match="it must be true or false"):
        prepared(Port("b", 0, "parameter", type="Boolean"), value, "m.b")
