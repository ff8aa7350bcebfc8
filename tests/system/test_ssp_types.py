"""SSP: connectors of every type and arrays are wired, mapped and given values."""

from pathlib import Path

from ssp_files import pack, system, values, wire

from cosim.master.simulate import run
from cosim.system.scenario import read_scenario


def typed(name: str, kind: str, type_: str, more: str = "") -> str:
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{type_}/>{more}</ssd:Connector>'


def mirrored(name: str, *connectors: str, bindings: str = "") -> str:
    """A component that is the mirror FMU."""
    return (
        f'<ssd:Component name="{name}" source="resources/tiny%202.fmu"><ssd:Connectors>{"".join(connectors)}'
        f"</ssd:Connectors><ssd:ParameterBindings>{bindings}</ssd:ParameterBindings></ssd:Component>"
    )


def test_every_type_is_wired_mapped_and_given_a_value(mirror: dict[int, Path], tmp_path: Path) -> None:
    kinds = ("Float32", "Int8", "UInt64", "Boolean", "String", "Enumeration", "Binary")
    into = [typed(f"{kind.lower()}_in", "input", kind) for kind in kinds]
    out = [typed(f"{kind.lower()}_out", "output", kind) for kind in kinds]
    values_ = {"Float32": 0.5, "Int8": -3, "UInt64": 2**63, "Boolean": "true", "String": "a &amp; b"}
    values_ |= {"Enumeration": "angry", "Binary": "00ff"}
    given_ = "".join(
        f'<ssv:Parameter name="{kind.lower()}_in"><ssv:{kind} value="{value}"/></ssv:Parameter>'
        for kind, value in values_.items()
    )
    moods = (
        '<ssc:EnumerationMappingTransformation><ssc:MapEntry source="angry" target="calm"/>'
        "</ssc:EnumerationMappingTransformation>"
    )
    numbers = (
        '<ssc:IntegerMappingTransformation><ssc:MapEntry source="-3" target="5"/></ssc:IntegerMappingTransformation>'
    )
    inside = {"Enumeration": moods, "Int8": numbers, "Boolean": TABLE}
    wires = "".join(wire(f"one.{kind.lower()}_out", f"two.{kind.lower()}_in", inside.get(kind, "")) for kind in kinds)
    elements = mirrored("one", *into, *out, bindings=values(given_)) + mirrored("two", *into, *out)
    recording = run(
        read_scenario(pack(tmp_path / "t.ssp", mirror[3], system(elements, wires), version="2.0"))
    ).recording
    found = {
        kind: recording.others.get(f"two.{kind.lower()}_out", recording.table.get(f"two.{kind.lower()}_out"))[-1]
        for kind in kinds
    }
    assert found == {
        "Float32": 0.5,
        "Int8": 5,
        "UInt64": 2**63,
        "Boolean": 0,
        "String": "a & b",
        "Enumeration": 10,
        "Binary": b"\x00\xff",
    }


def test_arrays_are_sized_wired_by_index_and_given_values(mirror: dict[int, Path], tmp_path: Path) -> None:
    size = '<ssc:Dimension sizeConnector="n"/>'
    connectors = [typed("n", "structuralParameter", "UInt64"), typed("u", "input", "Float64", size)]
    connectors += [typed("y", "output", "Float64", size), typed("float64_in", "input", "Float64")]
    connectors += [typed("float64_out", "output", "Float64")]
    sized = '<ssv:Parameter name="n"><ssv:UInt64 value="2"/></ssv:Parameter>'
    filled = '<ssv:Parameter name="u"><ssv:Float64 value="5 6"/><ssc:Dimension size="2"/></ssv:Parameter>'
    elements = mirrored("one", *connectors, bindings=values(sized + filled))
    elements += mirrored("two", *connectors, bindings=values(sized)) + mirrored("three", *connectors)
    wires = wire("one.y", "two.u") + wire("one.y", "three.float64_in", attributes='startIndices="2"')
    wires += wire("three.float64_out", "three.u", attributes='endIndices="3"')
    path = pack(tmp_path / "t.ssp", mirror[3], system(elements, wires), version="2.0")
    recording = run(read_scenario(path)).recording
    assert [recording[f"two.y[{n}]"][-1] for n in (1, 2)] == [5, 6]
    assert [recording[f"three.y[{n}]"][-1] for n in (1, 2, 3)] == [1, 2, 6]
    assert recording["three.float64_out"][-1] == 6


TABLE = (
    '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
    '<ssc:MapEntry source="false" target="true"/></ssc:BooleanMappingTransformation>'
)
