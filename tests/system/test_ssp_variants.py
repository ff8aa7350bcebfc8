"""An archive with several systems lets one be chosen; bindings and mappings that reach nothing are named."""

import zipfile
from pathlib import Path

import pytest
from ssp_files import SPACES, component, pack, real, system, values, wire

from cosim.api.show import show
from cosim.master.simulate import run
from cosim.support.errors import ScenarioError
from cosim.system.scenario import read_scenario

DRIVEN = values(real("mode", 1) + real("a", 0.5))


@pytest.fixture
def two(tiny: dict[int, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An archive with a second system, called "fast", in Fast.ssd."""
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "cache"))
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


def mapped(*pairs: tuple[str, str]) -> str:
    entries = "".join(f'<ssm:MappingEntry source="{source}" target="{target}"/>' for source, target in pairs)
    mapping = f'<ssm:ParameterMapping {SPACES} version="1.0">{entries}</ssm:ParameterMapping>'
    binding = values(real("gain", 3.0) + real("offset", 1.0))
    return binding.replace(
        "</ssd:ParameterBinding>", f"<ssd:ParameterMapping>{mapping}</ssd:ParameterMapping></ssd:ParameterBinding>"
    )


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (
            system(component("one", mapped(("gian", "k"), ("offset", "a")))),
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
def test_what_is_bound_to_nothing_is_noted(
    inside: str, said: str, tiny: dict[int, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "cache"))
    scenario = read_scenario(pack(tmp_path / "t.ssp", tiny[2], inside))
    assert said in scenario.notes
    assert said in run(scenario).statistics["notes"]


def test_two_sources_of_one_target_are_refused(tiny: dict[int, Path], tmp_path: Path) -> None:
    inside = system(component("one", mapped(("gain", "k"), ("offset", "k"))))
    with pytest.raises(ScenarioError, match='a parameter mapping has two sources of "k", "gain" and "offset"'):
        read_scenario(pack(tmp_path / "t.ssp", tiny[2], inside))


def test_start_values_travel_through_an_archive(
    tiny: dict[int, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wire of an SSP brings its value at the start, as one of a scenario does."""
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "cache"))
    at_once = values(real("mode", 2) + real("a", 0.5))
    inside = system(component("one", at_once) + component("two", values(real("mode", 2))), wire("one.y", "two.a"))
    recording = run(read_scenario(pack(tmp_path / "t.ssp", tiny[2], inside))).recording
    assert recording["two.y"][0] == 0.5
