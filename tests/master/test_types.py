"""Wires, parameters and recordings of every FMI type: values arrive as they are, or a sentence says why not."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mirror_fmu import EDGES, LOOPS, description, named
from simulating import alone, pair, simulate
from tiny_fmu import described

from cosim.data.recording import Recording
from cosim.fmi.component import Port
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.values import prepared
from cosim.master.loop import library
from cosim.master.pool import Pool
from cosim.support.errors import FmuError, WiringError
from cosim.system.algorithm import Iterated
from cosim.system.faults import Freeze
from cosim.system.wire import Record, Wire

ARRIVES = [
    *((kind, edge, edge) for kind, edges in EDGES.items() for edge in edges),
    ("Float64", 0.1, 0.1),
    ("Float32", 0.5, 0.5),
    ("Int64", -(2**60) - 1, -(2**60) - 1),
    ("Boolean", True, 1.0),
    ("Enumeration", "angry", 30.0),
    ("String", "größer, \U0001f52d", "größer, \U0001f52d"),
    ("Binary", "00ff10", b"\x00\xff\x10"),
]
"""Types, what a parameter says, and what is recorded."""


@LOOPS
@pytest.mark.parametrize(("kind", "value", "inside"), ARRIVES)
def test_a_value_of_each_type_goes_from_end_to_end_and_into_the_recording(
    kind: str, value: Any, inside: Any, compiled: bool, mirror: dict[int, Path]
) -> None:
    into, out = named(kind)
    record = {"there": f"two.{out}", "on the way": f"two.{into}"}
    given: dict[str, Any] = {"parameters": {"one": {into: value}}, "compiled": compiled}
    recording = pair(mirror[3], [Wire(f"one.{out}", f"two.{into}")], record, **given)
    for name, since in (("there", 2), ("on the way", 1)):
        column = recording.others.get(name, recording.table.get(name))
        assert list(column[since:]) == [inside] * (4 - since)
        assert column[0] != inside or inside == 0


@LOOPS
def test_fmi_2_has_value_references_for_each_type_apart(compiled: bool, mirror: dict[int, Path]) -> None:
    values = {"real": 0.25, "integer": -7, "boolean": True, "string": "told"}
    wires = [Wire(f"one.{one}_out", f"two.{one}_in") for one in values]
    parameters = {"one": {f"{one}_in": value for one, value in values.items()}}
    record = {name: f"two.{name}_out" for name in values}
    recording = pair(mirror[2], wires, record, parameters=parameters, compiled=compiled)
    columns = recording.table | recording.others
    assert {name: columns[name][-1] for name in values} == values


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
    given: dict[str, Any] = {"parameters": {"one": {f"{name}_in": "angry"}}, "compiled": compiled}
    wires = [Wire(f"one.{name}_out", f"two.{name}_in")]
    assert pair(moody, wires, {"mood": f"two.{name}_out"}, **given)["mood"][-1] == angry


def test_text_is_recorded_with_its_changes_and_read_again(mirror: dict[int, Path], tmp_path: Path) -> None:
    path = tmp_path / "r.parquet"
    record = {"text": "one.text", "big": "one.int64_out", "mood": "one.enumeration_out", "x": "one.float64_out"}
    parameters = {"one": {"int64_in": 2**60 + 1, "enumeration_in": 30}}
    recording = alone(mirror[3], [], record, step=0.5, ticks=6, path=path, parameters=parameters).recording
    assert recording.changes("text") == [(0.0, ""), (0.5, "step 0"), (1.0, "step 1"), (2.0, "step 2")]
    assert list(recording.table) == ["t", "big", "mood", "x"]
    assert recording.origin["items"] == {"mood": {"10": "calm", "30": "angry"}}
    from pyarrow import parquet

    assert parquet.read_table(path)["big"].to_pylist()[-1] == 2**60 + 1
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


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        *(
            ({named(kind)[0]: beyond}, f"is {beyond}; an? {kind} takes whole numbers from {low} to {high}")
            for kind, (low, high) in EDGES.items()
            for beyond in (low - 1, high + 1)
        ),
        ({"int8_in": 1.5}, '"one.int8_in" is 1.5; an Int8 takes whole numbers'),
        ({"enumeration_in": "sad"}, r'"one.enumeration_in" is "sad"; its items are: 10 \(calm\), 30 \(angry\)'),
        ({"enumeration_in": 20}, r'"one.enumeration_in" is 20; its items are: 10 \(calm\)'),
        ({"string_in": 3}, '"one.string_in" is 3; it must be text'),
        ({"string_in": "a\0b"}, "cannot hold a zero byte"),
        ({"binary_in": "0g"}, "written in hexadecimal digits"),
        ({"float32_in": 1e39}, '"one.float32_in" is 1e.39; that is beyond a Float32'),
        ({"float64_in": "much"}, '"one.float64_in" is "much"; it must be a number'),
        ({"u": [1.0, 2.0]}, '"one.u" is .*; it has 3 elements, and 2 are given'),
        ({"float64_in": [1.0]}, "it is one value, no array"),
        ({"n": 2, "u": [1.0, 2.0, 3.0]}, "it has 2 elements, and 3 are given"),
        ({"n": -1}, '"one.n" is -1; a UInt64 takes whole numbers'),
    ],
)
def test_a_parameter_that_is_none_of_its_type_is_refused(
    parameters: dict[str, Any], said: str, mirror: dict[int, Path]
) -> None:
    with pytest.raises(FmuError, match=said):
        alone(mirror[3], [], {"x": "one.float64_out"}, parameters={"one": parameters})


@pytest.mark.parametrize(
    ("value", "inside"),
    [
        *((value, True) for value in (True, "true", 1, 1.0)),
        *((value, False) for value in (False, "false", 0, 0.0)),
        *((value, None) for value in (2, -1, 0.5, "True", "yes", "", None)),
    ],
)
def test_a_boolean_parameter_is_true_or_false_as_it_is_written_or_refused(value: Any, inside: bool | None) -> None:
    refused = pytest.raises(FmuError, match="it must be true or false")
    with refused if inside is None else nullcontext():
        assert prepared(Port("b", 0, "parameter", type="Boolean"), value, "one.b") == [inside]


HANGS = Freeze.model_validate({"on": "two.string_in", "kind": "freeze", "from": 0.1})
ENDS = "one.string_out", "two.string_in"


@pytest.mark.parametrize(
    ("wire", "more", "said"),
    [
        (Wire(*ENDS, gain=2.0), {}, "a String is carried as it is: no gain"),
        (Wire("s", "two.string_in"), {}, '"two.string_in" is a String, and the signal is a number'),
        (Wire(*ENDS), {"faults": [HANGS]}, "faults act on num"),
        (Wire(*ENDS), {"record": {"x": Record("two.string_out", "mean")}}, "is a String; sample it"),
        (Wire(*ENDS), {"record": {"x": "two.nothing"}}, "it does not exist; two has: float64_in"),
        (Wire("one.y[1]", "two.u[0]"), {}, r'"two.u\[0\]" cannot be fed: it does not exist'),
    ],
)
def test_what_a_type_cannot_do_is_refused(wire: Wire, more: dict[str, Any], said: str, mirror: dict[int, Path]) -> None:
    given: dict[str, Any] = {"record": {"x": "two.float64_out"}, "signals": {"s": 1.0}} | more
    with pytest.raises(WiringError, match=said):
        pair(mirror[3], [wire], **given)


def test_components_agree_within_a_tick_on_real_numbers_only(mirror: dict[int, Path], tiny: dict[int, Path]) -> None:
    together = Iterated(kind="iterated", components=("one", "two"))
    with FmuComponent(tiny[3]) as one, FmuComponent(mirror[3]) as two:
        two.__class__ = type("Rewinding", (FmuComponent,), {"can_get_and_set_state": True})
        both, wires = {"one": one, "two": two}, [Wire("two.int8_out", "one.a")]
        with pytest.raises(WiringError, match=r'from "two.int8_out" to "one.a" carries an Int8; values that'):
            simulate(both, wires, record={"y": "one.y"}, step=0.1, ticks=2, algorithm=together)


def test_a_second_run_of_the_same_component_begins_anew(mirror: dict[int, Path]) -> None:
    record = {"y": "one.y", "s": "one.text"}
    with FmuComponent(mirror[3]) as same:
        for parameters, last in (({"n": 2, "u": [5, 6]}, [5, 6]), ({}, [1, 2, 3]), ({"n": 1, "u": [4]}, [4])):
            recording = alone(same, [], record, parameters={"one": parameters}).recording
            assert [recording[f"y[{n + 1}]"][-1] for n in range(len(last))] == last
            assert recording.changes("s")[0] == (0.0, "")


def test_without_the_compiled_loop_other_types_are_refused(
    mirror: dict[int, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.master.typed.library", lambda: None)
    with pytest.raises(WiringError, match=r'"one.int8_out" is no double, and other types need the compiled loop'):
        alone(mirror[3], [], {"x": "one.int8_out"})
