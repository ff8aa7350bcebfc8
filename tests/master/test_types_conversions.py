"""From one FMI type to another: only where nothing is lost, else a sentence with the variable and the value."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mirror_fmu import mirror, named
from simulating import simulate
from test_types import LOOPS

from cosim.master.simulate import Options, run
from cosim.support.errors import StepError, WiringError
from cosim.system.algorithm import GaussSeidel
from cosim.system.scenario import parse_scenario
from cosim.system.wire import Record, Wire

__all__ = ["mirror"]

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
    recording = simulate(
        {"one": mirror[3], "two": mirror[3]},
        [Wire(f"one.{named(source)[1]}", f"two.{named(target)[0]}")],
        record={"y": f"two.{named(target)[1]}"},
        step=0.1,
        ticks=4,
        parameters={"one": {named(source)[0]: value}},
        algorithm=GaussSeidel(kind="gauss-seidel", order=["one", "two"]),  # no item is 0, which an output begins with
    ).recording
    assert recording["y"][-1] == value


@pytest.mark.parametrize(("source", "target"), NARROWER)
def test_a_type_that_does_not_is_refused_in_a_sentence(source: str, target: str, mirror: dict[int, Path]) -> None:
    wire = Wire(f"one.{named(source)[1]}", f"two.{named(target)[0]}")
    with pytest.raises(WiringError, match=NARROWER[source, target]) as raised:
        simulate({"one": mirror[3], "two": mirror[3]}, [wire], record={"y": "two.float64_out"}, step=0.1, ticks=4)
    assert wire.target in str(raised.value)
    assert wire.source in str(raised.value)


def fed_by_a_signal(mirror: dict[int, Path], kind: str, values: Any, compiled: bool = True, **wire: Any) -> np.ndarray:
    into, out = named(kind)
    recording = simulate(
        {"m": mirror[3]},
        [Wire("s", f"m.{into}", **wire)],
        record={"y": f"m.{out}"},
        step=0.1,
        ticks=len(values),
        signals={"s": np.array(values, dtype=float)},
        compiled=compiled,
    ).recording
    return recording["y"]


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
    with pytest.raises(StepError, match=r'at tick 1 .*"m.int8_in" is fed 128; an Int8 takes whole numbers from -128'):
        fed_by_a_signal(mirror, "Int8", [0.0, 128.0], compiled, cast=True)
    with pytest.raises(StepError, match=r'"m.float32_in" is fed 1.*e\+300; that is beyond'):
        fed_by_a_signal(mirror, "Float32", [1e300], compiled, cast=True)


@LOOPS
@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        ("Int32", 2.5, "an Int32 takes whole numbers from -2147483648 to 2147483647"),
        ("UInt8", -1.0, "a UInt8 takes whole numbers from 0 to 255"),
        ("Boolean", 2.0, "a Boolean takes 0 or 1"),
        ("Enumeration", 20.0, r"its items are: 10 \(calm\), 30 \(angry\)"),
        ("Float32", 0.1, "a Float32 cannot hold that exactly; cast = true takes the nearest value"),
    ],
)
def test_a_signal_that_does_not_fit_ends_the_run_with_the_variable_and_the_value(
    kind: str, value: float, said: str, compiled: bool, mirror: dict[int, Path]
) -> None:
    good = 10.0 if kind == "Enumeration" else 0.0
    with pytest.raises(StepError, match=rf'at tick 2 .*"m.{named(kind)[0]}" is fed .*{said}') as raised:
        fed_by_a_signal(mirror, kind, [good, good, value], compiled)
    assert f"is fed {value!r}".removesuffix(".0") in str(raised.value)
    np.testing.assert_array_equal(fed_by_a_signal(mirror, kind, [good] * 3, compiled), [good] * 3)


def test_an_integer_beyond_2_53_is_exact_or_an_error_but_never_rounded(mirror: dict[int, Path]) -> None:
    def through(target: str, record: str | Record, value: int) -> Any:
        return simulate(
            {"one": mirror[3], "two": mirror[3]},
            [Wire("one.int64_out", f"two.{target}_in")],
            record={"y": record},
            step=0.1,
            ticks=4,
            parameters={"one": {"int64_in": value}},
        ).recording

    assert through("int64", "two.int64_out", 2**53 + 1).others["y"][-1] == 2**53 + 1
    assert through("float64", "two.float64_out", 2**53 - 1)["y"][-1] == 2**53 - 1
    with pytest.raises(StepError, match=r'"one.int64_out" is 9007199254740992, and of integers only those below 2'):
        through("float64", "two.float64_out", 2**53 + 1)
    with pytest.raises(StepError, match=r'"two.int64_out" is 9007199254740992'):
        through("int64", Record("two.int64_out", "mean"), 2**53 + 1)


@LOOPS
def test_a_map_puts_values_and_items_in_the_place_of_others(compiled: bool, mirror: dict[int, Path]) -> None:
    text = f"""
    step = 0.1
    stop = 0.4
    [components.one]
    fmu = "{mirror[3]}"
    parameters = {{ enumeration_in = "angry", int8_in = 3, boolean_in = true }}
    [components.two]
    fmu = "{mirror[3]}"
    [[connections]]
    from = "one.enumeration_out"
    to = "two.enumeration_in"
    map = {{ angry = "calm", calm = "angry" }}
    [[connections]]
    from = "one.int8_out"
    to = "two.int8_in"
    map = {{ 3 = 5, 5 = 7 }}
    [[connections]]
    from = "one.boolean_out"
    to = "two.boolean_in"
    map = {{ true = false, false = true }}
    [record]
    signals = {{ mood = "two.enumeration_in", n = "two.int8_in", not = "two.boolean_in" }}
    """
    recording = run(parse_scenario(text, "x.toml", Path()), Options(compiled=compiled)).recording
    assert (recording["mood"][0], recording["mood"][-1]) == (30.0, 10.0)
    assert recording["n"][-1] == 5.0
    assert (recording["not"][0], recording["not"][-1]) == (1.0, 0.0)
    wrongs = {
        'angry = "sad"': 'names "sad", which "two.enumeration_in" does not have; there are: calm, angry',
        "30 = 20": r"leaves 30 \(angry\), which the target does not know",
    }
    for wrong, said in wrongs.items():
        with pytest.raises(WiringError, match=said):
            run(parse_scenario(text.replace('angry = "calm", calm = "angry"', wrong), "x.toml", Path()))
