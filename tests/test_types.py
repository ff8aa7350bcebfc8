"""Wires, parameters and recordings of every FMI type: values arrive as they are, or a sentence says why not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mirror_fmu import KINDS, description, mirror, named
from simulating import simulate
from tiny_fmu import described, tiny

from cosim.data.recording import Recording
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.types import elements, indexed
from cosim.master.loop import library
from cosim.master.pool import Pool
from cosim.master.simulate import Options, run
from cosim.support.errors import FmuError, StepError, WiringError
from cosim.system.algorithm import GaussSeidel, Iterated
from cosim.system.faults import Freeze
from cosim.system.scenario import parse_scenario
from cosim.system.wire import Record, Wire

__all__ = ["mirror", "tiny"]

LOOPS = pytest.mark.parametrize("compiled", [True, False])
VALUES: dict[str, Any] = {
    "Float64": 0.1,
    "Float32": 0.5,
    "Int8": -128,
    "UInt8": 255,
    "Int16": -32768,
    "UInt16": 65535,
    "Int32": -(2**31),
    "UInt32": 2**32 - 1,
    "Int64": -(2**60) - 1,
    "UInt64": 2**64 - 1,
    "Boolean": True,
    "Enumeration": "angry",
    "String": "größer, \U0001f52d",
    "Binary": "00ff10",
}
ARRIVES = VALUES | {"Boolean": 1.0, "Enumeration": 30.0, "Binary": b"\x00\xff\x10"}


def chain(*kinds: str) -> list[Wire]:
    """Wires from one mirror to the next."""
    return [Wire(f"one.{named(kind)[1]}", f"two.{named(kind)[0]}") for kind in kinds]


@LOOPS
@pytest.mark.parametrize("kind", KINDS)
def test_a_value_of_each_type_goes_from_end_to_end_and_into_the_recording(
    kind: str, compiled: bool, mirror: dict[int, Path]
) -> None:
    into, out = named(kind)
    recording = simulate(
        {"one": mirror[3], "two": mirror[3]},
        chain(kind),
        record={"there": f"two.{out}", "on the way": f"two.{into}"},
        step=0.1,
        ticks=4,
        parameters={"one": {into: VALUES[kind]}},
        compiled=compiled,
    ).recording
    for name, since in (("there", 2), ("on the way", 1)):
        column = recording.others.get(name, recording.table.get(name))
        assert list(column[since:]) == [ARRIVES[kind]] * (4 - since)
        assert column[0] != ARRIVES[kind]


@LOOPS
@pytest.mark.parametrize("kind", ["Real", "Integer", "Boolean", "String"])
def test_fmi_2_has_value_references_for_each_type_apart(kind: str, compiled: bool, mirror: dict[int, Path]) -> None:
    values = {"Real": 0.25, "Integer": -7, "Boolean": True, "String": "told"}
    wires = [Wire(f"one.{one}_out", f"two.{one}_in") for one in ("real", "integer", "boolean", "string")]
    recording = simulate(
        {"one": mirror[2], "two": mirror[2]},
        wires,
        record={name: f"two.{name}_out" for name in ("real", "integer", "boolean", "string")},
        step=0.1,
        ticks=4,
        parameters={"one": {f"{one.lower()}_in": value for one, value in values.items()}},
        compiled=compiled,
    ).recording
    column = recording.others if kind == "String" else recording.table
    assert column[kind.lower()][-1] == values[kind]


@LOOPS
@pytest.mark.parametrize(("fmi", "angry"), [(3, 2**40 + 1), (3, -(2**40)), (2, -30), (2, 2**31 - 1)])
def test_an_item_may_have_any_value_of_its_version(
    mirror: dict[int, Path], tmp_path: Path, fmi: int, angry: int, compiled: bool
) -> None:
    items = f'<Item name="calm" value="0"/><Item name="angry" value="{angry}"/>'
    xml = description(3).replace('name="angry" value="30"', f'name="angry" value="{angry}"')
    if fmi == 2:
        moods = f'<TypeDefinitions><SimpleType name="Mood"><Enumeration>{items}</Enumeration></SimpleType>'
        xml = description(2).replace("<ModelVariables>", f"{moods}</TypeDefinitions><ModelVariables>")
        xml = xml.replace('<Integer start="0"/>', '<Enumeration declaredType="Mood" start="0"/>')
        xml = xml.replace("<Integer/>", '<Enumeration declaredType="Mood"/>')
    name = {2: "integer", 3: "enumeration"}[fmi]
    moody = described(mirror[fmi], tmp_path / "moody.fmu", xml)
    recording = simulate(
        {"one": moody, "two": moody},
        [Wire(f"one.{name}_out", f"two.{name}_in")],
        record={"mood": f"two.{name}_out"},
        step=0.1,
        ticks=4,
        parameters={"one": {f"{name}_in": "angry"}},
        compiled=compiled,
    ).recording
    assert recording["mood"][-1] == angry


def test_text_is_recorded_with_its_changes_and_read_again(mirror: dict[int, Path], tmp_path: Path) -> None:
    path = tmp_path / "r.parquet"
    done = simulate(
        {"m": mirror[3]},
        [],
        record={"text": "m.text", "big": "m.int64_out", "mood": "m.enumeration_out", "x": "m.float64_out"},
        step=0.5,
        ticks=6,
        path=path,
        parameters={"m": {"int64_in": 2**60 + 1, "enumeration_in": 30}},
    )
    recording = done.recording
    assert recording.changes("text") == [(0.0, ""), (0.5, "step 0"), (1.0, "step 1"), (2.0, "step 2")]
    assert list(recording.table) == ["t", "big", "mood", "x"]
    assert recording.origin["items"] == {"mood": {"10": "calm", "30": "angry"}}
    from pyarrow import parquet

    table = parquet.read_table(path)
    assert table["big"].to_pylist()[-1] == 2**60 + 1
    again = recording.write(tmp_path / "again.parquet")
    assert Recording.read(again, required=()).changes("text") == recording.changes("text")


def test_a_run_keeps_only_the_texts_that_it_still_needs() -> None:
    pool = Pool(library())
    numbers = [pool.number(f"text {number}".encode()) for number in range(1000)]
    assert len(set(numbers)) == 1000
    assert pool.number(b"text 7") == numbers[7]
    assert pool.number(b"") == 0
    assert pool.sweep(np.array(numbers[5:8], dtype=float)) == 4
    assert [pool.content(number) for number in numbers[5:8]] == [b"text 5", b"text 6", b"text 7"]
    assert pool.number(b"text 6") == numbers[6]
    assert pool.content(pool.number(b"\0\1\0")) == b"\0\1\0"


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


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"int8_in": 128}, '"m.int8_in" is 128; an Int8 takes whole numbers from -128 to 127.'),
        ({"int8_in": 1.5}, '"m.int8_in" is 1.5; an Int8 takes whole numbers'),
        ({"uint64_in": -1}, '"m.uint64_in" is -1; a UInt64 takes whole numbers from 0 to 18446744073709551615'),
        ({"boolean_in": 2}, '"m.boolean_in" is 2; it must be true or false'),
        ({"enumeration_in": "sad"}, r'"m.enumeration_in" is "sad"; its items are: 10 \(calm\), 30 \(angry\)'),
        ({"enumeration_in": 20}, r'"m.enumeration_in" is 20; its items are: 10 \(calm\)'),
        ({"string_in": 3}, '"m.string_in" is 3; it must be text'),
        ({"string_in": "a\0b"}, "cannot hold a zero byte"),
        ({"binary_in": "0g"}, "written in hexadecimal digits"),
        ({"float32_in": 1e39}, '"m.float32_in" is 1e.39; that is beyond a Float32'),
        ({"float64_in": "much"}, '"m.float64_in" is "much"; it must be a number'),
        ({"u": [1.0, 2.0]}, '"m.u" is .*; it has 3 elements, and 2 are given'),
        ({"float64_in": [1.0]}, "it is one value, no array"),
        ({"n": 2, "u": [1.0, 2.0, 3.0]}, "it has 2 elements, and 3 are given"),
        ({"n": -1}, '"m.n" is -1; a UInt64 takes whole numbers'),
    ],
)
def test_a_parameter_that_is_none_of_its_type_is_refused(
    parameters: dict[str, Any], said: str, mirror: dict[int, Path]
) -> None:
    with pytest.raises(FmuError, match=said):
        simulate({"m": mirror[3]}, [], record={"x": "m.float64_out"}, step=0.1, ticks=2, parameters={"m": parameters})


HANGS = Freeze.model_validate({"on": "two.string_in", "kind": "freeze", "from": 0.1})


@pytest.mark.parametrize(
    ("wires", "more", "said"),
    [
        ([Wire("one.string_out", "two.string_in", gain=2.0)], {}, "a String is carried as it is: no gain"),
        ([Wire("s", "two.string_in")], {}, '"two.string_in" is a String, and the signal is a number'),
        (chain("String"), {"faults": [HANGS]}, "faults act on num"),
        (chain("String"), {"record": {"x": Record("two.string_out", "mean")}}, "is a String; sample it"),
        (chain("Int32"), {"record": {"x": "two.nothing"}}, "it does not exist; two has: float64_in"),
    ],
)
def test_what_a_type_cannot_do_is_refused(
    wires: list[Wire], more: dict[str, Any], said: str, mirror: dict[int, Path]
) -> None:
    options = {"record": {"x": "two.float64_out"}, "step": 0.1, "ticks": 2, "signals": {"s": 1.0}} | more
    with pytest.raises(WiringError, match=said):
        simulate({"one": mirror[3], "two": mirror[3]}, wires, **options)


def test_components_agree_within_a_tick_on_real_numbers_only(mirror: dict[int, Path], tiny: dict[int, Path]) -> None:
    with FmuComponent(tiny[3]) as one, FmuComponent(mirror[3]) as two:
        two.__class__ = type("Rewinding", (FmuComponent,), {"can_get_and_set_state": True})
        with pytest.raises(WiringError, match=r'from "two.int8_out" to "one.a" carries an Int8; values that'):
            simulate(
                {"one": one, "two": two},
                [Wire("two.int8_out", "one.a")],
                record={"y": "one.y"},
                step=0.1,
                ticks=2,
                algorithm=Iterated(kind="iterated", components=("one", "two")),
            )


@LOOPS
def test_arrays_are_wired_whole_and_by_index_and_recorded_as_columns(compiled: bool, mirror: dict[int, Path]) -> None:
    recording = simulate(
        {"one": mirror[3], "two": mirror[3]},
        [Wire("one.y", "two.u"), Wire("one.z[2,1]", "two.w[1,2]"), Wire("one.y[2]", "two.float64_in", gain=10.0)],
        record={"y": "two.y", "z": "two.z", "x": "two.float64_out", "u": "two.u"},
        step=0.1,
        ticks=4,
        parameters={"one": {"u": [7, 8, 9], "w": [[10, 20, 30], [40, 50, 60]]}},
        compiled=compiled,
    ).recording
    names = [indexed("y", one) for one in elements((3,))] + [indexed("z", one) for one in elements((2, 3))]
    assert list(recording)[1:] == [*names, "x", "u[1]", "u[2]", "u[3]"]
    assert [recording[name][-1] for name in names] == [7, 8, 9, 1, 40, 3, 4, 5, 6]
    assert recording["x"][-1] == 80
    assert [recording[f"u[{n}]"][-1] for n in (1, 2, 3)] == [7, 8, 9]


@LOOPS
def test_structural_parameters_size_arrays_before_they_are_wired(compiled: bool, mirror: dict[int, Path]) -> None:
    big = {"n": 5, "u": [1, 2, 3, 4, 5]}
    recording = simulate(
        {"one": mirror[3], "two": mirror[3]},
        [Wire("one.y", "two.u")],
        record={"y": "two.y"},
        step=0.1,
        ticks=4,
        parameters={"one": big, "two": {"n": 5}},
        compiled=compiled,
    ).recording
    assert [recording[f"y[{n}]"][-1] for n in range(1, 6)] == [1, 2, 3, 4, 5]
    with pytest.raises(WiringError, match=r'"two.u" has 3 elements and "one.y" 5 elements; wire arrays of one shape'):
        simulate(
            {"one": mirror[3], "two": mirror[3]},
            [Wire("one.y", "two.u")],
            record={"y": "two.y"},
            step=0.1,
            ticks=4,
            parameters={"one": big},
        )


def test_an_element_of_an_array_is_set_beside_the_start_values_of_the_others(mirror: dict[int, Path]) -> None:
    recording = simulate(
        {"m": mirror[3]}, [], record={"y": "m.y"}, step=0.1, ticks=2, parameters={"m": {"u[2]": 9.0}}
    ).recording
    assert [recording[f"y[{n}]"][-1] for n in (1, 2, 3)] == [1, 9, 3]


@pytest.mark.parametrize("start", ["1 x 3", f"1 {'9' * 5000} 3", "1 ² 3"])
def test_start_values_of_an_array_that_are_no_numbers_are_refused(
    mirror: dict[int, Path], tmp_path: Path, start: str
) -> None:
    bad = described(mirror[3], tmp_path / "bad.fmu", description(3).replace('start="1 2 3"', f'start="{start}"'))
    with pytest.raises(FmuError, match="must be a number"):
        simulate({"m": bad}, [], record={"y": "m.y"}, step=0.1, ticks=2, parameters={"m": {"u[3]": 9.0}})


@pytest.mark.parametrize(
    ("wire", "said"),
    [
        (Wire("one.y", "two.float64_in"), '"two.float64_in" has one value and "one.y" 3 elements'),
        (Wire("one.float64_out", "two.u"), '"two.u" has 3 elements and "one.float64_out" one value'),
        (Wire("one.z", "two.u"), '"two.u" has 3 elements and "one.z" 2 x 3 elements'),
        (Wire("one.y[4]", "two.u[1]"), "which is not an output"),
        (Wire("one.y[1]", "two.u[0]"), r'"two.u\[0\]" cannot be fed: it does not exist'),
    ],
)
def test_arrays_that_do_not_fit_are_refused(wire: Wire, said: str, mirror: dict[int, Path]) -> None:
    with pytest.raises(WiringError, match=said):
        simulate({"one": mirror[3], "two": mirror[3]}, [wire], record={"x": "two.float64_out"}, step=0.1, ticks=2)


def test_a_second_run_of_the_same_component_begins_anew(mirror: dict[int, Path]) -> None:
    with FmuComponent(mirror[3]) as m:
        for parameters, last in (({"n": 2, "u": [5, 6]}, [5, 6]), ({}, [1, 2, 3]), ({"n": 1, "u": [4]}, [4])):
            recording = simulate(
                {"m": m}, [], record={"y": "m.y", "s": "m.text"}, step=0.1, ticks=3, parameters={"m": parameters}
            ).recording
            names = [f"y[{n}]" for n in range(1, len(last) + 1)]
            assert [recording[name][-1] for name in names] == last
            assert recording.changes("s")[0] == (0.0, "")


def test_without_the_compiled_loop_other_types_are_refused(
    mirror: dict[int, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.master.typed.library", lambda: None)
    with pytest.raises(WiringError, match=r'"m.int8_out" is no double, and other types need the compiled loop'):
        simulate({"m": mirror[3]}, [], record={"x": "m.int8_out"}, step=0.1, ticks=2)
