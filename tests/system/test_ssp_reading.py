"""Any team's SSP runs here, and what cannot be read is one sentence with culprit, rule and choices."""

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

from cosim.api.show import show
from cosim.data.recording import Recording
from cosim.master.simulate import run
from cosim.support.errors import ScenarioError
from cosim.system.scenario import read_scenario


def test_transformations_parameters_and_the_experiment_are_those_of_the_archive(read) -> None:
    transformed = wire("one.y", "two.a", linear(factor=2, offset=0.25))
    file = '<ssd:ParameterBinding source="resources/two.ssv"/>'
    elements = component("one", DRIVEN) + component("two", file)
    scenario = read(system(elements, transformed), two_ssv=parameter_set(real("mode", 1) + real("k", 3)))
    assert (scenario.step, scenario.stop, scenario.name) == (1e-3, 0.01, "t")
    recording = run(scenario).recording
    assert list(recording) == ["t", "one.y", "two.y"]
    np.testing.assert_array_equal(recording["one.y"], [0] + [0.5] * 9)
    np.testing.assert_allclose(recording["two.y"], [0] + [3 * 0.25] + [3 * 1.25] * 8)


def test_nested_systems_are_flat_and_their_transformations_chain(read) -> None:
    inner = system(
        component("one"),
        wire("in", "one.a", linear(factor=2)) + wire("one.y", "out"),
        name="sub",
        connectors=connector("in", "input") + connector("out", "output"),
        bindings=values(real("one.mode", 1)),
    )
    wires = wire("drive.y", "sub.in", linear(offset=0.1)) + wire("sub.out", "last.a")
    outer = system(
        component("drive", DRIVEN) + inner + component("last", FOLLOWS),
        wires + wire("last.y", "result") + wire("outside", "last.b"),
        connectors=connector("result", "output") + connector("outside", "input"),
        bindings=values(real("sub.one.k", 10)),
    )
    recording = run(read(outer)).recording
    np.testing.assert_allclose(recording["sub/one.y"][2:], 10 * 2 * (0.5 + 0.1))
    np.testing.assert_allclose(recording["last.y"][3:], 12.0)  # its input from outside stays at its start value
    np.testing.assert_array_equal(recording["result"], recording["last.y"])


def test_a_value_from_outside_goes_through_every_link_on_its_way_in(read) -> None:
    into = wire("in", "one.a", linear(offset=1))
    inner = system(component("one", FOLLOWS), into, name="sub", connectors=connector("in", "input"))
    wires, given = wire("outside", "sub.in", linear(factor=2)), values(real("outside", 5))
    outer = system(inner, wires, connectors=connector("outside", "input"), bindings=given)
    np.testing.assert_allclose(run(read(outer)).recording["sub/one.y"][2:], 5 * 2 + 1)


def test_outer_and_later_bindings_win_and_prefixes_and_mappings_rename(read) -> None:
    scaled = mapped(values(real("gain", 3)), ("gain", "k"), inside=linear(factor=2, offset=1))
    one = component("one", values(real("k", 1)) + scaled)
    two = component("two", values(real("k", 1)))
    outer = values(real("k", 4) + real("b", 180, "deg"), 'prefix="two."')
    scenario = read(system(one + two, bindings=outer))
    assert scenario.components["one"].parameters == {"k": 7.0}
    assert scenario.components["two"].parameters == pytest.approx({"k": 4.0, "b": np.pi})


@pytest.mark.parametrize(
    ("unit", "attributes", "factor"),
    [
        ("deg", "", 180 / np.pi),
        ("deg", 'suppressUnitConversion="true"', 1.0),
        ("half turns", "", 1 / np.pi),  # which only the archive knows
        ("", "", 1.0),
    ],
)
def test_the_unit_of_a_connector_counts_where_its_fmu_states_none(
    unit: str, attributes: str, factor: float, read, tiny: dict[int, Path], tmp_path: Path
) -> None:
    fmu = foreign(tiny[2], tmp_path / "f.fmu", names={}, a="")
    two = component("two", FOLLOWS).replace('"a" kind="input"><ssc:Real', f'"a" kind="input"><ssc:Real unit="{unit}"')
    inside = system(component("one", DRIVEN) + two, wire("one.y", "two.a", attributes=attributes))
    base = '<ssc:BaseUnit rad="1" factor="3.141592653589793"/>'
    inside += f'<ssd:Units><ssc:Unit name="half turns">{base}</ssc:Unit></ssd:Units>'
    recording = run(read(inside, fmu)).recording
    np.testing.assert_allclose(recording["two.y"][2:], 0.5 * factor)


def test_interfaces_are_those_asked_for_and_a_connection_may_be_written_from_its_end(read) -> None:
    asked = {"one": "CoSimulation", "two": "any", "three": "ModelExchange"}
    elements = "".join(component(name, kind=f'implementation="{said}"') for name, said in asked.items())
    scenario = read(system(elements, wire("two.a", "one.y")))
    assert [one.interface for one in scenario.components.values()] == ["co-simulation", "", "model-exchange"]
    assert [(one.source, one.target) for one in scenario.wires] == [("one.y", "two.a")]


def test_parameters_that_no_fmu_has_and_what_is_assumed_are_told(read) -> None:
    scenario = read(system(component("one", values(real("kk", 1)))), experiment="")
    assert "Not set, because their FMUs do not have them: one.kk." in scenario.notes
    assert "It says no stop and step, which is assumed." in scenario.notes
    assert (scenario.stop, scenario.ticks) == (1.0, 1000)


@pytest.mark.usefixtures("read")
def test_run_and_show_take_an_ssp(tiny: dict[int, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = pack(tmp_path / "a b.ssp", tiny[2], system(component("one", DRIVEN + values(real("kk", 1)))))
    for command in (["show", str(path)], ["run", str(path), "--out", str(tmp_path / "out")]):
        assert call(*command) == 0
    said = capsys.readouterr()
    assert "one.y" in said.out
    assert "one.kk" in said.err
    assert len(Recording.read(tmp_path / "out" / "recording.parquet", required=())) == 10


TWO = component("one") + component("two")


def alone(bindings: str = "", **more: str) -> str:
    return system(component("one", bindings, **more))


def joined(*wires: str) -> str:
    return system(TWO, "".join(wires))


def circle() -> str:
    through = system("", wire("in", "out"), "sub", connector("in", "input") + connector("out", "output"))
    return system(through + component("one"), wire("sub.out", "sub.in") + wire("sub.out", "one.a"))


CONTRARY = component("one").replace('"y" kind="output"><ssc:Real', '"y" kind="output"><ssc:Real unit="deg"')
WRONG = {
    '"one.y" is in deg, but its FMU says rad': system(CONTRARY),
    'etc/passwd" lies outside the archive': alone(source="../../etc/passwd"),
    '"/etc/passwd" lies outside the archive': alone(source="/etc/passwd"),
    'a.fmu" lies outside the archive': alone(source="https://example.org/a.fmu"),
    '"resources/b.fmu" is missing; there are: resources/tiny 2.fmu': alone(source="resources/b.fmu"),
    '"one" .*: .* is no FMU: it is not a zip archive': alone(source="SystemStructure.ssd"),
    '"one" is of the kind text/x-modelica': alone(kind='type="text/x-modelica; path=A.B"'),
    't.ssp, resources/tiny%202.fmu, is an SSP .* "SystemStructure.ssd" is missing': alone(
        kind='type="application/x-ssp-package"'
    ),
    "it has no component": system(""),
    'two elements are called "one"': system(component("one") * 2),
    'names "three", which does not exist; there are: one, two': joined(wire("three.y", "one.a")),
    '"one.x" is no connector; there are: a, b, y': joined(wire("one.x", "two.a")),
    '"one.a" is joined to "two.a", and a connection goes from': joined(wire("one.a", "two.a")),
    '"two.a" is fed twice, by "one.y" and by "two.y"': joined(wire("one.y", "two.a"), wire("two.y", "two.a")),
    'the Boolean mapping of "two.a" holds "yes"': joined(wire("one.y", "two.a", BOOLEANS.replace("true", "yes"))),
    'the Boolean mapping of "two.a" names "0" twice': joined(wire("one.y", "two.a", BOOLEANS.replace("true", "0", 1))),
    'factor = "2,5" is no finite': joined(wire("one.y", "two.a", linear(factor="2,5"))),
    'the parameter "k" = "much" is no Real': alone(values(real("k", "much"))),
    '"one.a" is given in kg: "kg" cannot become "rad"': alone(values(real("a", 1, "kg"))),
    '"s.ssv" is missing': alone('<ssd:ParameterBinding source="s.ssv"/>'),
    '"s.ssv" lies inside a component': alone('<ssd:ParameterBinding source="s.ssv" sourceBase="component"/>'),
    "neither a source nor a ssv:ParameterSet": alone("<ssd:ParameterBinding/>"),
    '"one.a" is fed by a circle': circle(),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_cannot_be_read_is_one_sentence(said: str, read) -> None:
    with pytest.raises(ScenarioError, match=said) as raised:
        read(WRONG[said])
    assert "\n" not in str(raised.value)
    assert "is an SSP that cannot run: " in str(raised.value)


def test_other_versions_are_refused_and_a_late_start_is_kept(read) -> None:
    assert read(system(TWO), version="2.0").ticks == 10
    with pytest.raises(ScenarioError, match=r'SystemStructure.ssd is of version "3.0", and only SSP 1 and 2 are read'):
        read(system(TWO), version="3.0")
    late = read(system(TWO), experiment='<ssd:DefaultExperiment startTime="5" stopTime="6"/>')
    assert (late.start, late.stop) == (5.0, 6.0)
    with pytest.raises(ScenarioError, match="it starts at -5 s; a run starts at 0 s or later"):
        read(system(TWO), experiment='<ssd:DefaultExperiment startTime="-5"/>')
    with pytest.raises(ScenarioError, match="it starts at 5 s and stops at 4 s; it must stop later than it starts"):
        read(system(TWO), experiment='<ssd:DefaultExperiment startTime="5" stopTime="4"/>')


@pytest.mark.usefixtures("read")
def test_damaged_archives_are_refused(tiny: dict[int, Path], tmp_path: Path) -> None:
    path = tmp_path / "t.ssp"
    with pytest.raises(ScenarioError, match="does not exist"):
        read_scenario(path)
    good = pack(path, tiny[2], system(TWO)).read_bytes()
    path.write_bytes(good[: len(good) // 2])
    with pytest.raises(ScenarioError, match="it is no zip archive"):
        read_scenario(path)
    middle = len(good) // 2
    path.write_bytes(good[:middle] + bytes(byte ^ 255 for byte in good[middle : middle + 40]) + good[middle + 40 :])
    with pytest.raises(ScenarioError, match=r'"resources/tiny 2.fmu" is damaged or encrypted'):
        read_scenario(path)
    for text in ("<a>", '<?xml version="1.0" encoding="none-such"?><a/>', '<?xml version="1.0" encoding="utf-7"?><a/>'):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("SystemStructure.ssd", text)
        with pytest.raises(ScenarioError, match="is not valid XML"):
            read_scenario(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("notes.txt", "")
    with pytest.raises(ScenarioError, match=r'"SystemStructure.ssd" is missing'):
        read_scenario(path)
    assert not (tmp_path / "cache").exists() or not list((tmp_path / "cache").rglob("*.partial"))


# An archive with several systems lets one be chosen; bindings and mappings that reach nothing are named.


@pytest.fixture
def two(read, tiny: dict[int, Path], tmp_path: Path) -> Path:
    """An archive with a second system, called "fast", in Fast.ssd."""
    path = pack(tmp_path / "two.ssp", tiny[2], system(component("one", DRIVEN)))
    other = values(real("mode", 1) + real("a", 2.0))
    with zipfile.ZipFile(path, "a") as archive:
        text = archive.read("SystemStructure.ssd").decode().replace(DRIVEN, other).replace('name="t"', 'name="fast"')
        archive.writestr("Fast.ssd", text)
        archive.writestr("resources/Inner.ssd", text)
    return path


def last(source: object) -> float:
    return float(run(read_scenario(str(source))).recording["one.y"][-1])


def test_another_system_of_an_archive_is_chosen_by_its_file_or_its_name(two: Path) -> None:
    assert [last(two), last(f"{two}#Fast.ssd"), last(f"{two}#fast")] == [0.5, 2.0, 2.0]
    said = (
        "It holds more than one system, of which SystemStructure.ssd is run; the others are: two.ssp#Fast.ssd (fast)."
    )
    assert said in read_scenario(two).notes
    assert said in show(two).facts.values()
    assert said in run(read_scenario(two)).statistics["notes"]
    assert not any("more than one" in note for note in read_scenario(f"{two}#Fast.ssd").notes)
    assert show(f"{two}#fast").facts["scenario"] == "fast"


def test_a_system_that_an_archive_does_not_have_is_named_with_those_it_has(two: Path) -> None:
    with pytest.raises(ScenarioError, match=r'it has no SSD "Slow\.ssd"; there are: Fast\.ssd, System'):
        read_scenario(f"{two}#Slow.ssd")


def test_in_a_folder_any_ssd_is_the_system(two: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(two) as archive:
        archive.extractall(tmp_path / "folder")
    assert [last(tmp_path / "folder" / name) for name in ("SystemStructure.ssd", "Fast.ssd")] == [0.5, 2.0]


def test_an_ssd_that_cannot_be_read_and_is_not_run_stops_nothing(two: Path) -> None:
    with zipfile.ZipFile(two, "a") as archive:
        archive.writestr("Broken.ssd", "<broken")
    assert last(two) == 0.5
    assert any("two.ssp#Broken.ssd (unreadable)" in note for note in read_scenario(two).notes)


GAINS = values(real("gain", 3.0) + real("offset", 1.0))


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (
            system(component("one", mapped(GAINS, ("gian", "k"), ("offset", "a")))),
            '"k" is not set: its mapping names "gian", and the set holds gain, offset.',
        ),
        (
            system(component("one"), bindings=values(real("one.k", 2.0) + real("onne.k", 2.0) + real("k", 1.0))),
            "Not set, because no element has these names: onne.k, k.",
        ),
        (
            system(component("one"), bindings=values(real("k", 2.0), 'prefix="two."')),
            "Not set, because no element has these names: two.k.",
        ),
        (
            system(
                system(component("one"), name="sub"), bindings=values(real("sub.one.kk", 2.0) + real("sub.two.k", 1))
            ),
            "Not set, because no element has these names: sub.two.k.",
        ),
    ],
)
def test_what_is_bound_to_nothing_is_noted(inside: str, said: str, read) -> None:
    scenario = read(inside)
    assert said in scenario.notes
    assert said in run(scenario).statistics["notes"]


def test_two_sources_of_one_target_are_refused(read) -> None:
    with pytest.raises(ScenarioError, match='a parameter mapping has two sources of "k", "gain" and "offset"'):
        read(system(component("one", mapped(GAINS, ("gain", "k"), ("offset", "k")))))


def test_start_values_travel_through_an_archive(read) -> None:
    """A wire of an SSP brings its value at the start, as one of a scenario does."""
    at_once = component("one", values(real("mode", 2) + real("a", 0.5))) + component("two", values(real("mode", 2)))
    assert run(read(system(at_once, wire("one.y", "two.a")))).recording["two.y"][0] == 0.5
