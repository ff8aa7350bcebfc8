"""An FMU with other numbers carries the recording they were judged on, not experiments that only the old ones meet."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from experiment_archives import FOLDER, bundle, manifest, with_files
from motor_fmu import driven, motor, recorded

import cosim
from cosim.fmi.manifest import manifest_of
from cosim.fmi.own_starts import MEMBER, as_member, own_starts
from cosim_calibration.left_behind import MANIFEST, left_behind

T = 0.01 * np.arange(101)


@pytest.fixture(scope="module")
def carrying(tmp_path_factory) -> Path:
    """The motor with an experiment that it passes as it is."""
    folder = tmp_path_factory.mktemp("carrying")
    fmu, current = motor(folder, 3), 2 * np.sin(9 * T)
    reference = {"time": T, "w": driven(fmu, current)["w"]}
    return with_files(fmu, folder / "carrying.fmu", bundle({"time": T, "i": current}, reference))


@pytest.fixture(scope="module")
def identified(carrying, tmp_path_factory) -> Path:
    """The motor with a page beside its experiment, identified from one run and judged on another."""
    folder = tmp_path_factory.mktemp("identified")
    rows = ("application/x-ma-hs-experiments", "a.exp", "experiment"), ("text/html", "page.html", "document")
    more = {"page.html": "<p/>", "fmi-ls-manifest.xml": manifest(*rows)}
    with zipfile.ZipFile(carrying) as archive:
        kept = {one: archive.read(one) for one in archive.namelist() if not one.endswith("fmi-ls-manifest.xml")}
    archive_of(folder / "plain.fmu", kept).close()
    with_page = with_files(folder / "plain.fmu", folder / "theirs.fmu", more)
    runs = [recorded(carrying, {"J": 0.03, "Fc": 0.16}, rows=150, seed=seed) for seed in (1, 2)]
    given = {"J": 0.02, "Fc": 0.16}  # Fc stays, and is not the start value that the FMU states
    done = cosim.identify(
        runs[0], heldout=runs[1], fmu=with_page, free=["J"], set=given, starts=1, workers=1, out=folder / "numbers"
    )
    return done.files["fmu"]


def test_an_identified_fmu_carries_the_recording_kept_out_and_passes_its_own_check(identified):
    checked = cosim.check(identified)
    assert checked.passed, str(checked)
    (outcome,) = checked.checked.outcomes
    assert outcome.experiment.name == "heldout 1"
    assert [one.name for one in outcome.compared] == ["w", "phi"]
    assert len(outcome.times) == 150
    with zipfile.ZipFile(identified) as archive:
        names = archive.namelist()
        measured = archive.read(f"{FOLDER}/identified/measured.csv").decode().splitlines()
    assert len(names) == len(set(names))
    assert any(name.startswith("binaries/") for name in names)
    first = np.array([float(row.split(",")[1]) for row in measured[1:]])
    gap = np.sqrt(np.mean((first - outcome.reference["w"]) ** 2))
    assert 0 < gap < 0.05 * np.ptp(first)  # noise of the recording, and not another curve
    assert f"w {gap:.3g} rad/s" in outcome.experiment.description


def test_the_manifest_keeps_its_other_entries_and_a_second_identification_replaces_the_experiment(identified, tmp_path):
    assert [one.member for one in manifest_of(identified).related if one.role == "document"] == [f"{FOLDER}/page.html"]
    table = recorded(identified, {"J": 0.025}, rows=150)
    done = cosim.identify(table, fmu=identified, free=["J"], starts=1, workers=1, out=tmp_path / "again")
    again = manifest_of(done.files["fmu"])
    assert [one.main_role for one in again.related].count("experiment") == 1
    assert f"{FOLDER}/page.html" in [one.member for one in again.related]
    checked = cosim.check(done.files["fmu"])
    assert checked.passed, str(checked)
    assert "fitted" in checked.checked.outcomes[0].experiment.description


def test_an_fmu_whose_number_was_changed_afterwards_fails(identified, tmp_path):
    with zipfile.ZipFile(identified) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    files[MEMBER] = as_member({"J": 1.02 * own_starts(identified)["J"]})
    archive_of(tmp_path / "changed.fmu", files).close()
    checked = cosim.check(tmp_path / "changed.fmu")
    assert not checked.passed
    assert not checked.checked.outcomes[0].compared[0].passed


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
