"""The SSP of a card: valid, the same bytes again, and the same motion in every tool that runs it."""

import hashlib
import importlib
import io
import posixpath
import subprocess
import sys
import zipfile
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import call
from export_models import controller, finish, symbols, variable
from fmpy.ssp.ssd import read_ssd, read_ssv, validate_tree
from lxml import etree
from ssp_tools import SIGNALS, TOOLS

from cosim.data.signals import Sine
from cosim.master.simulate import run
from cosim.models.system import system_of
from cosim.support.units import unit
from cosim.system.scenario import read_scenario
from pyfmi_models.card import parse_card, read_card
from pyfmi_models.errors import CardError, ExportError
from pyfmi_models.export import srmd
from pyfmi_models.export.ssp import Connection, System, export_ssp
from pyfmi_models.setpoint import Sine as SetPoint

STEPS = 3000


@pytest.fixture(scope="module")
def ssp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ssp")
    assert call("export", "paper_mount", "--ssp", "--fmi", "2", "--out", folder) == 0
    return folder / "paper_mount.ssp"


@pytest.fixture(scope="module")
def inside(ssp: Path) -> dict[str, bytes]:
    return files_in(ssp)


def files_in(path: Path | io.BytesIO) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def own(ssp: Path) -> np.ndarray:
    """The first STEPS steps of `cosim run`."""
    scenario = replace(read_scenario(ssp), ticks=STEPS + 1)
    recording = run(scenario).recording
    return np.column_stack([recording[name] for name in SIGNALS])


def test_the_structure_and_the_parameter_sets_are_valid_ssp_1_0(inside: dict[str, bytes]) -> None:
    schemas = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}
    checked = [name for name in inside if Path(name).suffix in schemas]
    for name in checked:
        validate_tree(etree.fromstring(inside[name]), schemas[Path(name).suffix])
    assert len(checked) == 4


def test_units_are_defined_by_base_units_as_they_are_known_here(tmp_path: Path) -> None:
    """Of a card with a time in milliseconds among SI: powers and factor are those that `--units` reads by the name."""
    text = (files("pyfmi_models") / "cards" / "paper_mount.toml").read_text("utf-8")
    card = parse_card(text + '\n[[effects]]\neffect = "delay"\ndelay_ms = 2.0\n', "late.toml")
    made = files_in(export_ssp(system_of(card), tmp_path / "a.ssp"))
    roots = [etree.fromstring(made[name]) for name in made if name.endswith((".ssd", ".ssv"))]
    found = {one.get("name"): dict(one[0].attrib) for root in roots for one in root.iter("{*}Unit")}
    assert {"ms", "N.m", "rad/s2"} <= found.keys()
    for name, base in found.items():
        known = unit(name)
        assert float(base.pop("factor", 1.0)) == known.factor
        assert tuple(int(base.get(one, 0)) for one in ("m", "kg", "s", "A", "K")) == known.dimension


def test_the_metadata_say_what_a_model_was_identified_from_and_how_well(tmp_path: Path) -> None:
    origin = {
        "recordings": [{"name": "run1.csv", "sha256": "ab" * 32, "role": "train"}],
        "evidence": "held-out RMS 0.79 refitted, 0.10 with the effects",
    }
    card = replace(read_card("paper_mount"), origin=origin)
    made = files_in(export_ssp(system_of(card), tmp_path / "a.ssp"))
    root, content = etree.fromstring(made["resources/mount.srmd"]), made["resources/mount.fmu"]
    assert "resources/reference.srmd" not in made
    assert root.tag == f"{{{srmd.NAMESPACES['srmd']}}}SimulationResourceMetaData"
    assert (root.get("version"), root.get("data"), root.get("checksumType")) == ("1.0.0", "mount.fmu", "SHA3-256")
    assert root.get("checksum") == hashlib.sha3_256(content).hexdigest()
    entries = {one.get("keyword"): one.text for one in root.iter(f"{{{srmd.NAMESPACES['stc']}}}ClassificationEntry")}
    assert entries["recordings.0.name"] == "run1.csv"
    assert entries["recordings.0.sha256"] == "ab" * 32
    assert entries["evidence"] == origin["evidence"]


def test_an_fmu_that_was_identified_lists_what_lies_in_it_beside_the_model(inside: dict[str, bytes]) -> None:
    """As FMI-LS-REF has it: name and place of the manifest, its attributes, roles, and sources from there on."""
    space = "{http://fmi-standard.org/fmi-ls-manifest}"
    mount, reference = (files_in(io.BytesIO(inside[f"resources/{name}.fmu"])) for name in ("mount", "reference"))
    folder = "extra/org.fmi-standard.fmi-ls-ref"
    assert not [name for name in reference if name.startswith("extra")], "nobody identified it"
    root = etree.fromstring(mount[f"{folder}/fmi-ls-manifest.xml"])
    assert (root.tag, root.get(f"{space}fmi-ls-name")) == ("fmiReferences", "org.fmi-standard.fmi-ls-ref")
    assert root.get(f"{space}fmi-ls-version") == "1.0.0-beta.1"
    assert root.get(f"{space}fmi-ls-description").startswith("Layered Standard providing information on related files")
    listed = {one.get("source"): (one.get("role"), one.get("type")) for one in root}
    assert listed == {
        "../../documentation/index.html": ("document", "text/html"),
        "identification.srmd": ("meta-data", "application/x-srmd-meta-data"),
        "card.ssv": ("parameter", "application/x-ssp-parameter-set"),
    }
    assert {one.tag for one in root} == {"Related"}
    assert {posixpath.normpath(f"{folder}/{source}") for source in listed} <= set(mount)
    assert mount[f"{folder}/card.ssv"] == inside["resources/mount.ssv"]
    told = etree.fromstring(mount[f"{folder}/identification.srmd"])
    assert told.get("checksum") is None, "an archive cannot state its own hash"
    outside = etree.fromstring(inside["resources/mount.srmd"])
    assert [one.text for one in told.iter()] == [one.text for one in outside.iter()]


def test_a_card_that_nothing_was_identified_from_says_so(inside: dict[str, bytes]) -> None:
    assert b"none: the numbers are those of the card" in inside["resources/controller.srmd"]


def test_two_exports_have_the_same_bytes(ssp: Path, tmp_path: Path) -> None:
    again = export_ssp(system_of(read_card("paper_mount")), tmp_path / "again.ssp")
    assert again.read_bytes() == ssp.read_bytes()


def test_the_ssp_wires_what_the_shipped_scenario_wires(ssp: Path) -> None:
    structure, scenario = read_ssd(ssp), read_scenario("sidereal")
    wires = {
        (f"{one.startElement}.{one.startConnector}", f"{one.endElement}.{one.endConnector}")
        for one in structure.system.connections
    }
    assert wires == {(wire.source, wire.target) for wire in scenario.wires}
    again = read_scenario(ssp)
    assert (again.step, again.stop) == (scenario.step, scenario.stop)


def test_parameter_sets_hold_the_numbers_of_the_card_with_units(ssp: Path) -> None:
    found = {one.name: one for one in read_ssv(ssp, "resources/mount.ssv").parameters}
    wanted = read_card("paper_mount").plant().parameters()
    assert {name: (float(one.value), one.unit) for name, one in found.items()} == {
        one.name: (one.start, one.unit) for one in wanted
    }


def test_the_delay_of_each_wire_is_written_down(inside: dict[str, bytes]) -> None:
    root, page = etree.fromstring(inside["SystemStructure.ssd"]), inside["documentation/index.html"].decode()
    told = {one.get("startElement"): one.get("description") for one in root.iter("{*}Connection")}
    assert "acts from tick k + 1 on: a delay of one step" in told["controller"]
    assert "delay" not in told["reference"]
    assert "quantum of 1.46292e-09" in told["mount"]
    assert all(sentence in page.replace("&#39;", "'") for sentence in told.values())


@pytest.mark.parametrize("tool", TOOLS)
def test_other_tools_run_the_ssp_and_find_the_same_motion(tool: str, ssp: Path, own: Any, tmp_path: Path) -> None:
    try:
        importlib.import_module(TOOLS[tool])
    except (ImportError, OSError) as error:
        pytest.skip(f"{tool} is not installed: {error}")
    runner, out = Path(__file__).parents[2] / "bench" / "ssp_tools.py", tmp_path / "rows.npy"
    command = [sys.executable, str(runner), tool, str(ssp), "1e-4", str(STEPS), str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    rows = np.load(out)
    # FMPy and ecos add up the time, so their set point is off by v times the sum's rounding, some 1e-13 s.
    scale = np.abs(own).max(axis=0)
    np.testing.assert_allclose(rows / scale, own / scale, rtol=0, atol=1e-10)
    assert np.abs(np.diff(own[:, 0])).max() > 0  # something moves


def test_the_set_point_is_that_of_a_scenario() -> None:
    t = np.arange(0, 12, 0.01)
    wanted = Sine(kind="sine", frequency=0.3, amplitude=2e-3, phase=0.4, smooth_start=1.5).stream(0.01)(np.arange(1200))
    model = SetPoint(name="r", frequency=0.3, amplitude=2e-3, phase=0.4, smooth_start=1.5).model()
    p = [one.start for one in model.parameters]
    found = np.array([model.equations(one, [], [], p)[1].full().ravel() for one in t]).T
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-16)


def test_a_card_without_controller_is_refused_in_one_sentence(tmp_path: Path, capsys: Any) -> None:
    with pytest.raises(CardError, match=r"there is no \[controller\] section"):
        system_of(read_card("emps"))
    assert call("export", "emps", "--ssp", "--out", tmp_path) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def motor():
    t, x, u, p = symbols(1, 1, 0)
    return finish("motor", [t, x, u, p], [u], [x[0]], inputs=(variable("torque", "N.m"),),
                  states=(variable("x"),), outputs=(variable("angle", "m"),))  # fmt: skip


@pytest.mark.parametrize(
    ("source", "target", "said"),
    [
        ("c.command", "m.torq", r'"m.torq" is no input; there are: torque'),
        ("c.comand", "m.torque", r'"c.comand" is no output; there are: command, done'),
        ("m.angle", "c.measured", r'"c.measured" \[rad\] is fed by "m.angle" \[m\]'),
    ],
)
def test_a_wire_that_does_not_fit_is_named(source: str, target: str, said: str) -> None:
    wires = (Connection(source=source, target=target),)
    parts = {"c": controller(), "m": motor()}
    with pytest.raises(ExportError, match=said):
        System(name="s", description="", components=parts, connections=wires, step=1e-3, stop=1.0)


def test_a_linear_axis_is_wired_in_metres() -> None:
    tuning = '[controller]\nkp = 100.0\nkd = 20.0\ncompensation = "C2a"\n'
    axis = 'inertia = 9.0\n[friction]\nmodel = "lugre"\nsigma0 = 1e6\nFc = 2.0\n'
    system = system_of(parse_card(f'[mount]\nmotion = "linear"\n{axis}{tuning}', "slide.toml"))
    units = {one.name: one.unit for one in system.components["controller"].parameters}
    assert (units["observer_bandwidth"], units["torque_limit"], units["compensation.sigma0"]) == ("rad/s", "N", "N/m")
    assert {one.unit for one in system.components["reference"].outputs} == {"m", "m/s", "m/s2"}
