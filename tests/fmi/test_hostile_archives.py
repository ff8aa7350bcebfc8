"""Archives and descriptions that nobody could have meant are one sentence each, and leave nothing."""

import struct
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from calls import calls_of
from commands import call
from ssp_files import SPACES, component, pack, system
from tiny_fmu import described, description

import cosim.fmi.variables
import cosim.support.archive
from cosim.api.show import show
from cosim.fmi.description import describe
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.variables import ports_of
from cosim.support.archive import BOMB
from cosim.support.errors import FmuError, ScenarioError
from cosim.system.scenario import read_scenario


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, for this test alone."""
    (folder := tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def changed(good: Path, bad: Path, *more: tuple[zipfile.ZipInfo | str, bytes]) -> Path:
    """Copy an archive and add members."""
    bad.write_bytes(good.read_bytes())
    with zipfile.ZipFile(bad, "a") as archive:
        for name, content in more:
            archive.writestr(name, content)
    return bad


def link(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.external_attr = 0o120777 << 16
    return info


NAMES = [
    ("/etc/cosim", "has an absolute name"),
    ("C:/cosim", "has a drive letter or a backslash in its name"),
    ("resources\\cosim", "has a drive letter or a backslash in its name"),
    ("resources/../../cosim", "has a name that leads elsewhere"),
    ("resources//cosim", "has a name that leads elsewhere"),
    ("resources/" + "x" * 300, "has a name that is too long"),
    ("x/" * 300 + "x", "has a name that is too long"),
    ("resources/a\nb", "has a name with characters that no file has"),
    (link("resources/link"), "is a link or a device, and only files and folders are unpacked"),
]


@pytest.mark.parametrize(("name", "sentence"), NAMES)
@pytest.mark.parametrize("kind", ["fmu", "ssp"])
@pytest.mark.usefixtures("read")
def test_a_member_with_such_a_name_is_refused(
    tiny: dict[int, Path], tmp_path: Path, temporary: Path, kind: str, name: zipfile.ZipInfo | str, sentence: str
) -> None:
    good = tiny[3] if kind == "fmu" else pack(tmp_path / "good.ssp", tiny[2], system(component("one")))
    bad = changed(good, tmp_path / f"bad.{kind}", (name, b"here"))
    with pytest.raises((FmuError, ScenarioError), match=sentence):
        FmuComponent(bad) if kind == "fmu" else read_scenario(bad)
    assert [one.name for one in tmp_path.rglob("*") if "cosim" in one.name] == []
    assert list(temporary.iterdir()) == []


def test_a_bomb_is_refused_before_it_is_unpacked(tiny: dict[int, Path], tmp_path: Path) -> None:
    bad = tmp_path / "bomb.fmu"
    bad.write_bytes(tiny[3].read_bytes())
    with zipfile.ZipFile(bad, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("resources/zeros", bytes(BOMB))
    with pytest.raises(FmuError, match=r"are \d+ times as large as their packing, and 200 is the most"):
        FmuComponent(bad)


@pytest.mark.parametrize(
    ("limit", "most", "sentence"),
    [("LARGEST", 100, "its members have .* GiB, and 0 are the most"), ("MEMBERS", 1, "2 members, and 1 are the most")],
)
def test_an_archive_of_too_much_is_refused(
    tiny: dict[int, Path], monkeypatch: pytest.MonkeyPatch, limit: str, most: int, sentence: str
) -> None:
    monkeypatch.setattr(cosim.support.archive, limit, most)
    with pytest.raises(FmuError, match=sentence):
        FmuComponent(tiny[3])


def with_field(good: bytes, field: int, value: int) -> bytes:
    """Write another 16-bit number into the last entry of the table of contents (and of nothing else)."""
    content = bytearray(good)
    struct.pack_into("<H", content, content.rindex(b"PK\x01\x02") + field, value)
    return bytes(content)


def with_a_bit_turned(good: bytes) -> bytes:
    content = bytearray(good)
    content[content.index(b"\x7fELF") + 1000] ^= 1
    return bytes(content)


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda good: with_field(good, 8, 1), "has a password"),
        (lambda good: with_field(good, 10, 99), r"is packed in a way that is not known \(99\)"),
        (with_a_bit_turned, r"tiny\.so\" cannot be unpacked: Bad CRC-32 for file"),
        *((lambda good, length=length: good[:length], r"bad\.fmu is no FMU") for length in (0, 10, 100, -1, -30)),
    ],
)
def test_an_archive_that_is_damaged_or_cut_short_is_refused_and_leaves_nothing(
    tiny: dict[int, Path], tmp_path: Path, temporary: Path, spoil: Callable[[bytes], bytes], sentence: str
) -> None:
    (bad := tmp_path / "bad.fmu").write_bytes(spoil(tiny[3].read_bytes()))
    with pytest.raises(FmuError, match=sentence):
        FmuComponent(bad)
    assert list(temporary.iterdir()) == []


def test_two_members_of_one_name_are_refused(tiny: dict[int, Path], tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Duplicate name"):
        bad = changed(tiny[3], tmp_path / "bad.fmu", ("modelDescription.xml", b"<other/>"))
    with pytest.raises(FmuError, match=r'it holds two members "modelDescription\.xml"'):
        FmuComponent(bad)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('valueReference="1"', 'valueReference="4294967296"', '"b" has the value reference 4294967296; a value refe'),
        ('valueReference="1"', 'valueReference="-1"', '"b" has the value reference -1; a value reference is a whole'),
        ('valueReference="1"', 'valueReference="1e3"', "cannot be read: invalid literal for int"),
        ('causality="output"', 'causality="gives"', 'Variable "y" (line 1) has an illegal combination of causality'),
        (
            'variability="fixed"',
            'variability="wobbly"',
            'Variable "k" (line 1) has an illegal combination of causality',
        ),
        ('min="0"', 'min="low"', '"k" has min = "low", which is no number'),
        ('name="b"', 'name="a"', 'the variable "a" is there twice'),
        ('name="b"', 'name=""', 'the variable "" has no name'),
    ],
)
def test_a_variable_that_no_fmu_can_have_is_named(
    tiny: dict[int, Path], tmp_path: Path, version: int, old: str, new: str, sentence: str
) -> None:
    text = description(version)
    assert old in text
    with pytest.raises(FmuError) as caught:
        FmuComponent(described(tiny[version], tmp_path / "bad.fmu", text.replace(old, new, 1)))
    assert sentence in str(caught.value)


def test_event_indicators_without_number_are_refused(tiny: dict[int, Path], tmp_path: Path) -> None:
    text = description(2).replace('guid="t"', 'guid="t" numberOfEventIndicators="99999999999"')
    with pytest.raises(FmuError, match=r"numberOfEventIndicators = 99999999999; 1,000,000 are the most"):
        FmuComponent(described(tiny[2], tmp_path / "bad.fmu", text))


LAUGHS = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10 if n else "ha" * 10}">' for n in range(10))


@pytest.mark.parametrize("coding", ["utf-8", "utf-16"])
@pytest.mark.parametrize("parts", ['<!ENTITY b SYSTEM "file:///etc/hostname">', LAUGHS], ids=["file", "bomb"])
@pytest.mark.parametrize(("kind", "member"), [("fmu", "modelDescription.xml"), ("ssp", "SystemStructure.ssd")])
def test_a_description_that_defines_its_own_parts_is_refused(
    tmp_path: Path, kind: str, member: str, parts: str, coding: str
) -> None:
    text = f'<?xml version="1.0" encoding="{coding}"?><!DOCTYPE a [{parts}]><a>&a9;</a>'
    with zipfile.ZipFile(tmp_path / f"bad.{kind}", "w") as archive:
        archive.writestr(member, text.encode(coding))
    with pytest.raises((FmuError, ScenarioError), match=f'{member}"? has a DOCTYPE'):
        FmuComponent(tmp_path / "bad.fmu") if kind == "fmu" else read_scenario(tmp_path / "bad.ssp")


def test_systems_that_use_each_other_without_end_are_refused(tiny: dict[int, Path], tmp_path: Path) -> None:
    inner = component("one")
    for _ in range(3000):
        inner = system(inner, name="sub")
    with pytest.raises(ScenarioError, match="nests systems more than 50 deep"):
        read_scenario(pack(tmp_path / "deep.ssp", tiny[2], inner))


def test_a_system_that_doubles_at_each_level_is_refused(tiny: dict[int, Path], tmp_path: Path) -> None:
    """Each of 20 systems uses the next one twice: a million FMUs from two kilobytes."""
    levels = []
    for level in range(20):
        twice = "".join(
            f'<ssd:Component name="{side}" source="#s{level + 1}" type="application/x-ssp-definition"/>'
            for side in ("left", "right")
        )
        whole = system(twice if level < 19 else component("one"), name=f"s{level}")
        levels.append(whole.replace("<ssd:System ", f'<ssd:System id="s{level}" ', 1))
    with pytest.raises(ScenarioError, match="it has more than 10,000 elements"):
        read_scenario(pack(tmp_path / "wide.ssp", tiny[2], system("".join(levels))))


# FMUs of many variables are read in little more than their XML takes; what would take all memory is refused before.

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
