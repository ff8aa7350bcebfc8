"""SSP 1 and 2 as other tools write them: units of sets, empty names, dictionaries, nested archives, files beside."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from commands import call
from foreign_fmu import foreign
from ssp_files import (
    BOOLEANS,
    DRIVEN,
    FOLLOWS,
    SPACES,
    component,
    connector,
    linear,
    mapped,
    pack,
    parameter_set,
    real,
    system,
    values,
    wire,
)

from cosim.master.simulate import run
from cosim.support.errors import ScenarioError
from cosim.system.scenario import read_scenario


def last(scenario, name: str) -> float:
    return float(run(scenario).recording[name][-1])


def test_an_empty_element_name_means_the_system_itself(read) -> None:
    ends = 'startElement="" startConnector="in" endElement="one" endConnector="a"'
    inner = system(component("one", FOLLOWS), f"<ssd:Connection {ends}/>", "sub", connector("in", "input"))
    scenario = read(system(component("drive", DRIVEN) + inner, wire("drive.y", "sub.in")))
    assert last(scenario, "sub/one.y") == 0.5


def test_units_are_converted_before_a_transformation_acts(read, tiny: dict[int, Path], tmp_path: Path) -> None:
    """SSP: "the value of source is already converted to the target unit in the formula"."""
    fmu = foreign(tiny[2], tmp_path / "f.fmu", names={}, a="")
    two = component("two", FOLLOWS).replace('"a" kind="input"><ssc:Real', '"a" kind="input"><ssc:Real unit="deg"')
    shift = linear(factor=2, offset=1)
    found = last(read(system(component("one", DRIVEN) + two, wire("one.y", "two.a", shift)), fmu), "two.y")
    assert found == pytest.approx(2 * np.degrees(0.5) + 1, rel=1e-15)
    turned = mapped(values(real("angle", 180, "deg")), ("angle", "one.a"), inside=shift)
    scenario = read(system(component("one"), bindings=turned))
    assert scenario.components["one"].parameters["a"] == pytest.approx(2 * np.pi + 1, rel=1e-15)


def test_a_set_has_units_of_its_own_and_equal_unknown_ones_pass(read, tiny: dict[int, Path], tmp_path: Path) -> None:
    base = '<ssc:BaseUnit rad="1" factor="3.141592653589793"/>'
    units = f'<ssv:Units><ssc:Unit name="half turn">{base}</ssc:Unit></ssv:Units></ssv:ParameterSet>'
    file = parameter_set(real("a", 0.5, "half turn")).replace("</ssv:ParameterSet>", units)
    binding = '<ssd:ParameterBinding source="resources/s.ssv"/>'
    scenario = read(system(component("one", binding)), s_ssv=file)
    np.testing.assert_allclose(scenario.components["one"].parameters["a"], np.pi / 2)
    fmu = foreign(tiny[2], tmp_path / "f.fmu", names={}, a="quiz")
    scenario = read(system(component("one", values(real("a", 3, "quiz")))), fmu)
    assert scenario.components["one"].parameters["a"] == 3
    with pytest.raises(ScenarioError, match=r'"one.a" is given in deg: "quiz" is no unit known here'):
        read(system(component("one", values(real("a", 3, "deg")))), fmu)


def test_only_what_a_mapping_names_is_applied(read) -> None:
    binding = mapped(values(real("gain", 3) + real("mode", 1)), ("gain", "k"))
    assert read(system(component("one", binding))).components["one"].parameters == {"k": 3.0}


def test_what_is_given_to_a_connector_of_a_system_goes_where_it_is_wired(read) -> None:
    inner = system(
        component("one", values(real("mode", 1) + real("k", 9))).replace(
            "<ssd:Connectors>", "<ssd:Connectors>" + connector("k", "parameter")
        ),
        wire("gain", "one.k", linear(factor=2)) + wire("in", "one.a"),
        name="sub",
        connectors=connector("gain", "parameter") + connector("in", "input"),
        bindings=values(real("gain", 1) + real("in", 0.25)),
    )
    scenario = read(system(inner, bindings=values(real("sub.gain", 3))))
    assert scenario.components["sub/one"].parameters == {"mode": 1.0, "k": 6.0, "a": 0.25}
    assert last(scenario, "sub/one.y") == 1.5


DICTIONARY = (
    f'<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"><ssb:SignalDictionary {SPACES} version="1.0">'
    '<ssb:DictionaryEntry name="angle"><ssc:Real unit="deg"/></ssb:DictionaryEntry>'
    "</ssb:SignalDictionary></ssd:SignalDictionary></ssd:SignalDictionaries>"
)


def reference(name: str, kind: str, dictionary: str = "bus") -> str:
    connectors = f"<ssd:Connectors>{connector('angle', kind)}</ssd:Connectors>"
    tag = "ssd:SignalDictionaryReference"
    return f'<{tag} name="{name}" dictionary="{dictionary}">{connectors}</{tag}>'


def test_signals_of_a_dictionary_reach_every_reference_in_its_unit(read) -> None:
    inner = system(component("one", FOLLOWS) + reference("seen", "inout"), wire("seen.angle", "one.a"), "sub")
    outer = system(component("drive", DRIVEN) + reference("said", "inout") + inner, wire("drive.y", "said.angle"))
    outer = outer.replace("</ssd:System>", DICTIONARY + "</ssd:System>", 2).replace(DICTIONARY, "", 1)
    assert last(read(outer), "sub/one.y") == pytest.approx(0.5, rel=1e-15)
    with pytest.raises(ScenarioError, match=r'"said" refers to the signal dictionary "bus", which does not exist'):
        read(outer.replace(DICTIONARY, ""))
    twice = outer.replace(wire("drive.y", "said.angle"), wire("drive.y", "said.angle") * 2)
    with pytest.raises(ScenarioError, match=r'"\(bus\).angle" is fed twice'):
        read(twice)
    with pytest.raises(ScenarioError, match=r'"said.speed" is no connector; there are: angle'):
        read(outer.replace(wire("drive.y", "said.angle"), wire("drive.y", "said.speed")))


def test_systems_come_from_other_archives_other_ssds_and_by_their_id(
    read, tiny: dict[int, Path], tmp_path: Path
) -> None:
    through = wire("in", "one.a") + wire("one.y", "out")
    connectors = connector("in", "input") + connector("out", "output")
    inside = system(component("one", FOLLOWS), through, "sub", connectors)
    nested = pack(tmp_path / "n.ssp", tiny[2], inside).read_bytes()
    described = f'<ssd:SystemStructureDescription {SPACES} version="2.0" name="n">'
    alone = described + inside.replace("resources/", "") + "</ssd:SystemStructureDescription>"
    named = inside.replace("<ssd:System ", '<ssd:System id="twin" ')

    def other(name: str, source: str, kind: str) -> str:
        stronger = f"<ssd:ParameterBindings>{values(real('one.k', 3))}</ssd:ParameterBindings>"
        return f'<ssd:Component name="{name}" source="{source}" type="{kind}">{stronger}</ssd:Component>'

    elements = component("drive", DRIVEN) + other("a", "resources/n.ssp", "application/x-ssp-package")
    elements += other("b", "resources/n.ssd", "application/x-ssp-definition") + named
    elements += other("c", "#twin", "application/x-ssp-definition")
    joined = "".join(wire("drive.y", f"{name}.in") for name in "abc")
    path = pack(tmp_path / "t.ssp", tiny[2], system(elements, joined), n_ssd=alone)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources/n.ssp", nested)
    recording = run(read_scenario(path)).recording
    for name in "abc":
        assert recording[f"{name}/one.y"][-1] == 1.5
    assert recording["sub/one.y"][-1] == 0.0


def test_systems_that_hold_themselves_are_refused(read) -> None:
    itself = '<ssd:Component name="again" source="#me" type="application/x-ssp-definition"/>'
    inner = system(component("one") + itself, name="sub").replace("<ssd:System ", '<ssd:System id="me" ')
    with pytest.raises(ScenarioError, match="nests systems more than 50 deep"):
        read(system(inner))


def test_a_component_without_a_source_gives_nothing_and_that_is_said(read) -> None:
    planned = component("later").replace('source="resources/tiny%202.fmu"', "")
    scenario = read(system(component("one", FOLLOWS) + planned, wire("later.y", "one.a")))
    assert 'The component "later" has no source' in scenario.notes[0]
    assert not scenario.wires


def test_files_beside_the_archive_are_read_only_when_asked(tiny: dict[int, Path], tmp_path: Path) -> None:
    (tmp_path / "shared.fmu").write_bytes(tiny[2].read_bytes())
    path = pack(tmp_path / "t.ssp", tiny[2], system(component("one", DRIVEN, source="../shared.fmu")))
    with pytest.raises(ScenarioError, match="only what is inside is read; --outside reads files beside it too"):
        read_scenario(path)
    assert last(read_scenario(path, outside=True), "one.y") == 0.5
    assert call("run", path, "--out", tmp_path / "out") == 2
    assert call("run", path, "--out", tmp_path / "out", "--outside") == 0
    for source, said in (
        ("http://127.0.0.1/a.fmu", "is no file of this computer"),
        ("file://server/a.fmu", "is no file of this computer"),
        ("/etc/passwd", "is no file of a kind that is read; there are: .fmu, .ssp"),
        ("../missing.fmu", "is no file of a kind that is read"),
    ):
        wrong = pack(tmp_path / "w.ssp", tiny[2], system(component("one", source=source)))
        with pytest.raises(ScenarioError, match=said):
            read_scenario(wrong, outside=True)


def test_an_unpacked_archive_is_read_by_its_ssd(read, tiny: dict[int, Path], tmp_path: Path) -> None:
    packed = pack(tmp_path / "t.ssp", tiny[2], system(component("one", DRIVEN)))
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(tmp_path / "folder")
    ssd = tmp_path / "folder" / "SystemStructure.ssd"
    assert last(read_scenario(ssd), "one.y") == 0.5
    (tmp_path / "folder" / "resources" / "tiny 2.fmu").unlink()
    with pytest.raises(ScenarioError, match=r'"resources/tiny%202.fmu" is missing'):
        read_scenario(ssd)
    (tmp_path / "folder" / "resources" / "tiny 2.fmu").symlink_to(tiny[2])
    with pytest.raises(ScenarioError, match="is a link that leads out of the folder"):
        read_scenario(ssd)


def of_omsimulator(step: str) -> str:
    """A system whose step an annotation of OMSimulator says."""
    oms = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
    master = f'<o:SimulationInformation xmlns:o="{oms}"><o:FixedStepMaster stepSize="{step}"/>'
    master += "</o:SimulationInformation>"
    said = f'<ssd:Annotations><ssc:Annotation type="org.openmodelica">{master}</ssc:Annotation></ssd:Annotations>'
    return system(component("one")).replace("</ssd:System>", said + "</ssd:System>")


def test_the_step_of_omsimulator_counts_and_a_stop_between_steps_is_cut(read) -> None:
    scenario = read(of_omsimulator("0.003"), experiment='<ssd:DefaultExperiment stopTime="0.01"/>')
    assert (scenario.step, scenario.ticks) == (0.003, 3)
    assert scenario.notes == ("Its stop of 0.01 s is no whole number of steps; the run ends at 0.009 s.",)


@pytest.mark.parametrize(("stop", "step"), [("1e300", "1e-14"), ("1e11", "1e-9"), ("1e308", "1e-308"), ("1e-300", "1")])
def test_more_steps_than_can_be_counted_are_a_sentence(read, stop: str, step: str) -> None:
    with pytest.raises(ScenarioError):
        read(of_omsimulator(step), experiment=f'<ssd:DefaultExperiment stopTime="{stop}"/>')


def test_an_fmu_without_a_binary_for_this_machine_is_named_by_its_component(
    read, tiny: dict[int, Path], tmp_path: Path
) -> None:
    bare = tmp_path / "bare.fmu"
    with zipfile.ZipFile(tiny[2]) as source, zipfile.ZipFile(bare, "w") as target:
        for name in source.namelist():
            target.writestr(name.replace("/tiny.", "/other."), source.read(name))
    with pytest.raises(ScenarioError, match=r'"one" \(.*asks for binaries/.*/tiny\..*, and there is only: other\.'):
        read(system(component("one")), bare)


# Connectors of every type and arrays are wired, mapped and given values.


def typed(name: str, kind: str, type_: str, more: str = "") -> str:
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{type_}/>{more}</ssd:Connector>'


def mirrored(name: str, *connectors: str, bindings: str = "") -> str:
    """A component that is the mirror FMU."""
    return (
        f'<ssd:Component name="{name}" source="resources/tiny%202.fmu"><ssd:Connectors>{"".join(connectors)}'
        f"</ssd:Connectors><ssd:ParameterBindings>{bindings}</ssd:ParameterBindings></ssd:Component>"
    )


def test_every_type_is_wired_mapped_and_given_a_value(read, mirror: dict[int, Path]) -> None:
    kinds = ("Float32", "Int8", "UInt64", "Boolean", "String", "Enumeration", "Binary")
    into = [typed(f"{kind.lower()}_in", "input", kind) for kind in kinds]
    out = [typed(f"{kind.lower()}_out", "output", kind) for kind in kinds]
    values_ = {"Float32": 0.5, "Int8": -3, "UInt64": 2**63, "Boolean": "true", "String": "a &amp; b"}
    values_ |= {"Enumeration": "angry", "Binary": "00ff"}
    given_ = "".join(
        f'<ssv:Parameter name="{kind.lower()}_in"><ssv:{kind} value="{value}"/></ssv:Parameter>'
        for kind, value in values_.items()
    )
    inside = {"Boolean": BOOLEANS}
    for kind, of, source, target in (("Enumeration", "Enumeration", "angry", "calm"), ("Int8", "Integer", "-3", "5")):
        tag = f"ssc:{of}MappingTransformation"
        inside[kind] = f'<{tag}><ssc:MapEntry source="{source}" target="{target}"/></{tag}>'
    wires = "".join(wire(f"one.{kind.lower()}_out", f"two.{kind.lower()}_in", inside.get(kind, "")) for kind in kinds)
    elements = mirrored("one", *into, *out, bindings=values(given_)) + mirrored("two", *into, *out)
    recording = run(read(system(elements, wires), mirror[3], version="2.0")).recording
    columns = recording.table | recording.others
    assert [columns[f"two.{kind.lower()}_out"][-1] for kind in kinds] == [0.5, 5, 2**63, 0, "a & b", 10, b"\x00\xff"]


def test_arrays_are_sized_wired_by_index_and_given_values(read, mirror: dict[int, Path]) -> None:
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
    recording = run(read(system(elements, wires), mirror[3], version="2.0")).recording
    assert [recording[f"two.y[{n}]"][-1] for n in (1, 2)] == [5, 6]
    assert [recording[f"three.y[{n}]"][-1] for n in (1, 2, 3)] == [1, 2, 6]
    assert recording["three.float64_out"][-1] == 6
