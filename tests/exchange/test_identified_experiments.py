"""An FMU with other numbers does not carry experiments that only the old numbers meet."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from experiment_archives import bundle, manifest, with_files
from motor_fmu import motor, recorded

import cosim
from cosim.calibration.left_behind import MANIFEST, left_behind
from cosim.master.simulate import simulate
from cosim.system.system import System
from cosim.system.wire import Record, Wire

T = 0.01 * np.arange(101)


@pytest.fixture(scope="module")
def carrying(tmp_path_factory) -> Path:
    """The motor with an experiment that it passes as it is."""
    folder = tmp_path_factory.mktemp("carrying")
    fmu, current = motor(folder, 3), 2 * np.sin(9 * T)
    system = System(
        components={"m": fmu},
        records={"w": Record("m.w")},
        wires=[Wire("i.value", "m.i")],
        signals={"i": current},
        step=0.01,
        ticks=100,
        last=True,
    )
    reference = {"time": T, "w": simulate(system).recording.table["w"]}
    return with_files(fmu, folder / "carrying.fmu", bundle({"time": T, "i": current}, reference))


def test_an_identified_fmu_passes_its_own_check(carrying, tmp_path):
    assert "chirp" in str(cosim.check(carrying))
    table = recorded(carrying, {"J": 0.03}, rows=150)
    done = cosim.identify(table, fmu=carrying, free=["J"], starts=1, workers=1, out=tmp_path / "numbers")
    checked = cosim.check(done.files["fmu"])
    assert checked.passed, str(checked)
    assert "chirp" not in str(checked)
    with zipfile.ZipFile(done.files["fmu"]) as archive:
        names = archive.namelist()
    assert not [name for name in names if name.startswith("extra/org.fmi")]
    assert any(name.startswith("binaries/") for name in names)


def archive_of(path: Path, files: dict[str, str | bytes]) -> zipfile.ZipFile:
    with zipfile.ZipFile(path, "w") as target:
        for name, content in files.items():
            target.writestr(name, content)
    return zipfile.ZipFile(path)


def test_other_files_stay_and_no_source_reaches_beyond_the_folder(tmp_path):
    """An experiment that names the description as its reference does not take it away."""
    folder = MANIFEST.rpartition("/")[0]
    entries = [
        ("application/x-ma-hs-experiments", "a.exp", "experiment/smoke-test"),
        ("text/html", "b.html", "document"),
    ]
    text = manifest(*entries, ("text/csv", "r.csv", "result"), ("text/csv", "s.csv", "other"))
    inside = '<Experiments><Stimuli source="s.csv"/><References source="../../modelDescription.xml"/></Experiments>'
    files = {MANIFEST: text, f"{folder}/a.exp": inside, f"{folder}/s.csv": "time\n0\n", "modelDescription.xml": "<x/>"}
    with archive_of(tmp_path / "some.zip", files) as archive:
        gone, left = left_behind(archive)
    assert gone == {MANIFEST, *(f"{folder}/{name}" for name in ("a.exp", "r.csv", "s.csv"))}
    assert b"b.html" in left
    assert not any(name in left for name in (b"a.exp", b"r.csv", b"s.csv"))


def test_an_archive_without_a_manifest_loses_nothing_and_one_that_cannot_be_read_stays(tmp_path):
    with archive_of(tmp_path / "none.zip", {"modelDescription.xml": "<x/>"}) as archive:
        assert left_behind(archive) == (frozenset(), b"")
    with archive_of(tmp_path / "torn.zip", {MANIFEST: "<torn"}) as archive:
        assert left_behind(archive) == (frozenset(), b"<torn")
