"""From one FMI type to another: only where nothing is lost, else a sentence with the variable and the value."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mirror_fmu import EDGES, LOOPS, description, named
from simulating import alone, pair
from small_loop import text_of
from tiny_fmu import described

from cosim.fmi.component import Port
from cosim.fmi.types import elements, indexed, refusal
from cosim.master.simulate import Options, run
from cosim.support.errors import FmuError, StepError, WiringError
from cosim.system.algorithm import GaussSeidel
from cosim.system.conversions import check_wire
from cosim.system.scenario import Scenario, parse_scenario
from cosim.system.wire import Record, Wire

WIDER = [
    ("Float32", "Float64"),
    ("Int8", "Int16"),
    ("UInt8", "Int16"),
    ("UInt32", "Int64"),
    ("Int32", "Float64"),
    ("Int64", "Float64"),
    ("Int16", "Float32"),
    ("Boolean", "UInt8"),
    ("Boolean", "Float64"),
    ("Enumeration", "Int64"),
    ("Int32", "Enumeration"),
    ("Enumeration", "Float64"),
]
NARROWER = {
    ("Float64", "Float32"): "a Float32 does not hold every Float64; cast = true",
    ("Float64", "Int32"): "an Int32 does not hold every Float64; cast = true",
    ("Int16", "Int8"): "an Int8 does not hold every Int16; cast = true",
    ("Int8", "UInt8"): "an UInt8|a UInt8 does not hold every Int8",
    ("UInt64", "Int64"): "an Int64 does not hold every UInt64",
    ("Int8", "Boolean"): "a Boolean cannot hold an Int8",
    ("Float64", "Enumeration"): "an Enumeration cannot hold every Float64",
    ("String", "Binary"): "a Binary cannot hold a String",
    ("Float64", "String"): "a String cannot hold a Float64",
    ("String", "Float64"): "a Float64 cannot hold a String",
}


@pytest.mark.parametrize(("source", "target"), WIDER)
def test_a_type_that_holds_all_values_of_another_takes_them(source: str, target: str, mirror: dict[int, Path]) -> None:
    value = {"Boolean": True, "Enumeration": 30}.get(source, 30 if target == "Enumeration" else 100)
    given: dict[str, Any] = {"parameters": {"one": {named(source)[0]: value}}}
    given["algorithm"] = GaussSeidel(kind="gauss-seidel", order=["one", "two"])
    wires = [Wire(f"one.{named(source)[1]}", f"two.{named(target)[0]}")]
    assert pair(mirror[3], wires, {"y": f"two.{named(target)[1]}"}, **given)["y"][-1] == value


@pytest.mark.parametrize(
    ("source", "target", "said"),
    [
        *((named(source)[1], named(target)[0], said) for (source, target), said in NARROWER.items()),
        ("y", "float64_in", '"two.float64_in" has one value and "one.y" 3 elements'),
        ("float64_out", "u", '"two.u" has 3 elements and "one.float64_out" one value'),
        ("z", "u", '"two.u" has 3 elements and "one.z" 2 x 3 elements'),
        ("y[4]", "u[1]", '"two.u[1]" is fed by "one.y[4]", which is not an output'),
    ],
)
def test_a_type_or_an_array_that_does_not_fit_is_refused_in_a_sentence(
    source: str, target: str, said: str, mirror: dict[int, Path]
) -> None:
    with pytest.raises(WiringError, match=said.replace("[", r"\[")) as raised:
        pair(mirror[3], [Wire(f"one.{source}", f"two.{target}")], {"y": "two.float64_out"})
    assert f"two.{target}" in str(raised.value)
    assert f"one.{source}" in str(raised.value)


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


def fed_by_a_signal(mirror: dict[int, Path], kind: str, values: Any, compiled: bool = True, **wire: Any) -> np.ndarray:
    """What an input of a type is fed, recorded at its output of the step after; large integers are not recorded."""
    into, out = named(kind)
    given: dict[str, Any] = {"signals": {"s": np.array(values, dtype=float)}, "compiled": compiled}
    record = {"y": "one.float64_out" if kind.endswith("64") else f"one.{out}"}
    return alone(mirror[3], [Wire("s", f"one.{into}", **wire)], record, ticks=len(values), **given).recording["y"]


@pytest.mark.parametrize(
    ("changes", "straight"),
    [({}, True), ({"gain": 2.0}, False), ({"offset": 1.0}, False), ({"quantum": 1.0}, False), ({"noise": "n"}, False)],
)
def test_a_wire_that_changes_nothing_is_straight(changes: dict[str, Any], straight: bool) -> None:
    assert Wire("one.y", "two.u", **changes).straight is straight


@LOOPS
def test_a_cast_takes_the_nearest_value_and_never_one_out_of_range(compiled: bool, mirror: dict[int, Path]) -> None:
    found = fed_by_a_signal(mirror, "Int8", [0.4, 0.6, -1.5, 127.4, 0.0], compiled, cast=True)
    np.testing.assert_array_equal(found, [0, 0, 1, -2, 127])
    found = fed_by_a_signal(mirror, "Float32", [0.1, 0.1, 0.1], compiled, cast=True)
    assert found[-1] == np.float32(0.1)
    with pytest.raises(StepError, match=r'at tick 1 .*"one.int8_in" is fed 128; an Int8 takes whole numbers from -128'):
        fed_by_a_signal(mirror, "Int8", [0.0, 128.0], compiled, cast=True)
    with pytest.raises(StepError, match=r'"one.float32_in" is fed 1.*e\+300; that is beyond'):
        fed_by_a_signal(mirror, "Float32", [1e300], compiled, cast=True)


def test_a_cast_between_components_is_of_numbers_only(mirror: dict[int, Path]) -> None:
    cast, parameters = Wire("one.int16_out", "two.int8_in", cast=True), {"one": {"int16_in": -100}}
    assert pair(mirror[3], [cast], {"y": "two.int8_out"}, parameters=parameters)["y"][-1] == -100
    with pytest.raises(WiringError, match="a Binary cannot hold a String"):
        pair(mirror[3], [Wire("one.string_out", "two.binary_in", cast=True)], {"y": "two.int8_out"})


AS_DOUBLE = {
    "Int64": (-(2.0**63), 2.0**63 - 1024, -(2.0**63) - 2048, 2.0**63),
    "UInt64": (0.0, 2.0**64 - 2048, -1.0, 2.0**64),
}
"""Of 64 bits: the least and greatest double within, and the nearest beyond."""


def at_its_edges(kind: str) -> list[tuple[str, float, float, str]]:
    low, high = EDGES[kind]
    least, most, below, above = AS_DOUBLE.get(kind, (low, high, low - 1, high + 1))
    said = f"an? {kind} takes whole numbers from {low} to {high}"
    return [(kind, least, below, said), (kind, most, above, said)]


@LOOPS
@pytest.mark.parametrize(
    ("kind", "good", "bad", "said"),
    [
        *(row for kind in EDGES for row in at_its_edges(kind)),
        ("Int32", 0.0, 2.5, "an Int32 takes whole numbers from -2147483648 to 2147483647"),
        *(("Boolean", good, bad, "a Boolean takes 0 or 1") for good, bad in ((0.0, -1.0), (1.0, 2.0), (1.0, 0.5))),
        *(("Enumeration", 10.0, bad, r"its items are: 10 \(calm\), 30 \(angry\)") for bad in (9.0, 11.0, 20.0)),
        *(("Enumeration", 30.0, bad, r"its items are: 10 \(calm\), 30 \(angry\)") for bad in (29.0, 31.0)),
        ("Float32", 0.0, 0.1, "a Float32 cannot hold that exactly; cast = true takes the nearest value"),
        *(
            ("Float32", sign * 3.4028234663852886e38, sign * 3.402823669209385e38, "beyond a Float32")
            for sign in (1, -1)
        ),
    ],
)
def test_a_signal_that_does_not_fit_ends_the_run_with_the_variable_and_the_value(
    kind: str, good: float, bad: float, said: str, compiled: bool, mirror: dict[int, Path]
) -> None:
    """The least and the greatest value arrive, the next one beyond is refused."""
    with pytest.raises(StepError, match=rf'at tick 2 .*"one.{named(kind)[0]}" is fed .*{said}') as raised:
        fed_by_a_signal(mirror, kind, [good, good, bad], compiled)
    assert float(str(raised.value).partition(" is fed ")[2].partition(";")[0]) == bad
    found = fed_by_a_signal(mirror, kind, [good] * 3, compiled)
    if kind not in AS_DOUBLE:
        np.testing.assert_array_equal(found[1:], [good] * 2)


def test_an_integer_beyond_2_53_is_exact_or_an_error_but_never_rounded(mirror: dict[int, Path]) -> None:
    def through(target: str, record: str | Record, value: int) -> Any:
        wires = [Wire("one.int64_out", f"two.{target}_in")]
        return pair(mirror[3], wires, {"y": record}, parameters={"one": {"int64_in": value}})

    assert through("int64", "two.int64_out", 2**53 + 1).others["y"][-1] == 2**53 + 1
    assert through("float64", "two.float64_out", 2**53 - 1)["y"][-1] == 2**53 - 1
    with pytest.raises(StepError, match=r'"one.int64_out" is 9007199254740992, and of integers only those below 2'):
        through("float64", "two.float64_out", 2**53 + 1)
    with pytest.raises(StepError, match=r'"two.int64_out" is 9007199254740992'):
        through("int64", Record("two.int64_out", "mean"), 2**53 + 1)


def with_maps(fmu: Path, moods: dict[str, Any]) -> Scenario:
    parameters = {"enumeration_in": "angry", "int8_in": 3, "boolean_in": True}
    maps = {"enumeration": moods, "int8": {"3": 5, "5": 7}, "boolean": {"true": False, "false": True}}
    wires = {f"two.{kind}_in": {"from": f"one.{kind}_out", "map": one} for kind, one in maps.items()}
    signals = {"mood": "two.enumeration_in", "n": "two.int8_in", "not": "two.boolean_in"}
    both = {"one": {"fmu": fmu, "parameters": parameters}, "two": {"fmu": fmu}}
    text = text_of(wires, step=0.1, stop=0.4, components=both, record={"signals": signals})
    return parse_scenario(text, "x.toml", Path())


@LOOPS
def test_a_map_puts_values_and_items_in_the_place_of_others(compiled: bool, mirror: dict[int, Path]) -> None:
    moods = {"angry": "calm", "calm": "angry"}
    recording = run(with_maps(mirror[3], moods), Options(compiled=compiled)).recording
    assert (recording["mood"][0], recording["mood"][-1]) == (30.0, 10.0)
    assert recording["n"][-1] == 5.0
    assert (recording["not"][0], recording["not"][-1]) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("moods", "said"),
    [
        ({"angry": "sad"}, 'names "sad", which "two.enumeration_in" does not have; there are: calm, angry'),
        ({"30": 20}, r"leaves 30 \(angry\), which the target does not know"),
    ],
)
def test_a_map_to_what_is_not_there_is_refused(moods: dict[str, Any], said: str, mirror: dict[int, Path]) -> None:
    with pytest.raises(WiringError, match=said):
        run(with_maps(mirror[3], moods))


# Arrays of FMI 3: wired whole and by index, sized by structural parameters, given start values.


@LOOPS
def test_arrays_are_wired_whole_and_by_index_and_recorded_as_columns(compiled: bool, mirror: dict[int, Path]) -> None:
    wires = [Wire("one.y", "two.u"), Wire("one.z[2,1]", "two.w[1,2]"), Wire("one.y[2]", "two.float64_in", gain=10.0)]
    record = {"y": "two.y", "z": "two.z", "x": "two.float64_out", "u": "two.u"}
    parameters = {"one": {"u": [7, 8, 9], "w": [[10, 20, 30], [40, 50, 60]]}}
    recording = pair(mirror[3], wires, record, parameters=parameters, compiled=compiled)
    names = [indexed("y", one) for one in elements((3,))] + [indexed("z", one) for one in elements((2, 3))]
    assert list(recording)[1:] == [*names, "x", "u[1]", "u[2]", "u[3]"]
    assert [recording[name][-1] for name in names] == [7, 8, 9, 1, 40, 3, 4, 5, 6]
    assert recording["x"][-1] == 80
    assert [recording[f"u[{n}]"][-1] for n in (1, 2, 3)] == [7, 8, 9]


@LOOPS
def test_structural_parameters_size_arrays_before_they_are_wired(compiled: bool, mirror: dict[int, Path]) -> None:
    big, wires, record = {"n": 5, "u": [1, 2, 3, 4, 5]}, [Wire("one.y", "two.u")], {"y": "two.y"}
    recording = pair(mirror[3], wires, record, parameters={"one": big, "two": {"n": 5}}, compiled=compiled)
    assert [recording[f"y[{n}]"][-1] for n in range(1, 6)] == [1, 2, 3, 4, 5]
    with pytest.raises(WiringError, match=r'"two.u" has 3 elements and "one.y" 5 elements; wire arrays of one shape'):
        pair(mirror[3], wires, record, parameters={"one": big})


def test_an_element_of_an_array_is_set_beside_the_start_values_of_the_others(mirror: dict[int, Path]) -> None:
    recording = alone(mirror[3], [], {"y": "one.y"}, parameters={"one": {"u[2]": 9.0}}).recording
    assert [recording[f"y[{n}]"][-1] for n in (1, 2, 3)] == [1, 9, 3]


@pytest.mark.parametrize("start", ["1 x 3", f"1 {'9' * 5000} 3", "1 ² 3"])
def test_start_values_of_an_array_that_are_no_numbers_are_refused(
    mirror: dict[int, Path], tmp_path: Path, start: str
) -> None:
    bad = described(mirror[3], tmp_path / "bad.fmu", description(3).replace('start="1 2 3"', f'start="{start}"'))
    with pytest.raises(FmuError, match="must be a number"):
        alone(bad, [], {"y": "one.y"}, parameters={"one": {"u[3]": 9.0}})
