"""FMUs of many variables are read in little more than their XML takes; what would take all memory is refused before."""

import zipfile
from pathlib import Path

import pytest
from calls import calls_of
from commands import call
from ssp_files import SPACES

import cosim.fmi.variables
from cosim.api.show import show
from cosim.fmi.description import describe
from cosim.fmi.variables import ports_of
from cosim.support.errors import FmuError, ScenarioError
from cosim.system.scenario import read_scenario

HEAD = {
    2: '<fmiModelDescription fmiVersion="2.0" modelName="m" guid="t">',
    3: '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">',
}


def fmu(folder: Path, version: int, variables: str, more: str = "") -> Path:
    """Write an FMU without a binary."""
    path = folder / "many.fmu"
    text = f'{HEAD[version]}<CoSimulation modelIdentifier="m"/>{more}<ModelVariables>{variables}</ModelVariables>'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", f"{text}<ModelStructure/></fmiModelDescription>")
    return path


def variable(version: int, number: int, more: str = "", inside: str = "") -> str:
    common = f'name="net.node[{number}].v" valueReference="{number}" causality="local" description="node {number}"'
    if version == 3:
        return f"<Float64 {common} {more}>{inside}</Float64>"
    return f"<ScalarVariable {common}><Real {more}/></ScalarVariable>"


@pytest.mark.parametrize("version", [2, 3])
def test_one_variable_more_is_little_more_to_show(
    version: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def shown(count: int) -> None:
        assert call("show", fmu(tmp_path, version, "".join(variable(version, one) for one in range(count)))) == 0
        assert f"net.node[{count - 1}].v" in capsys.readouterr().out

    shown(600)  # what is loaded once
    fewer, more = (calls_of(lambda count=count: shown(count)) for count in (600, 1200))  # type: ignore[misc]
    assert (more - fewer) / 600 < 150, "calls a variable: 37; drawn as a table 1,350"


def test_of_a_million_start_values_the_first_are_shown(tmp_path: Path) -> None:
    values = " ".join(["0.123456789012345"] * 1_000_000)
    path = fmu(tmp_path, 3, variable(3, 1, f'start="{values}"', '<Dimension start="1000000"/>'))
    start = show(path).tables["variables"][0]["start"]
    assert start == " ".join(["0.123456789012345"] * 11) + " ... (1,000,000 values)"


def test_a_description_that_names_many_large_arrays_makes_no_port_of_each_element(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cosim.fmi.variables, "MOST_TOGETHER", 4096)
    many = "".join(variable(3, one, "", '<Dimension start="1024"/>') for one in range(20))
    ports = ports_of(describe(fmu(tmp_path, 3, many)))
    assert len(ports) == 4096 + 20
    assert "net.node[0].v[1024]" in ports
    assert "net.node[19].v" in ports


@pytest.mark.parametrize("coding", ["utf-8", "utf-16"])
@pytest.mark.parametrize(
    ("inside", "sentence"),
    [
        ("<a/>" * 7_000_000, "7,0.* elements with .* attributes, which takes .* MB of memory; 800 are the most"),
        ("<a b='' c='' d='' e=''/>" * 1_000_000, "elements with 4,0.* attributes, which takes"),
        ("x" * (2**27), "has more than 128 MiB|are the most"),
    ],
    ids=["elements", "attributes", "text"],
)
@pytest.mark.parametrize("kind", ["fmu", "ssp"])
def test_xml_that_takes_all_memory_as_a_tree_is_refused_before(
    tmp_path: Path, kind: str, inside: str, sentence: str, coding: str
) -> None:
    path, member = tmp_path / f"bomb.{kind}", {"fmu": "modelDescription.xml", "ssp": "SystemStructure.ssd"}[kind]
    head = HEAD[2] if kind == "fmu" else f'<ssd:SystemStructureDescription {SPACES} version="1.0" name="s">'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(member, (head + inside).encode(coding))
    with pytest.raises((FmuError, ScenarioError), match=sentence):
        show(path) if kind == "fmu" else read_scenario(path)


def test_more_variables_than_can_be_read_in_time_are_refused_with_their_number(tmp_path: Path) -> None:
    path = fmu(tmp_path, 2, '<S name="a" valueReference="1"/>' * 300_001)
    with pytest.raises(FmuError, match=r"has 300,001 variables; 300,000 are the most"):
        show(path)
