"""An FMU with other numbers carries the recording they were judged on, not experiments that only the old ones meet."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from experiment_archives import FOLDER, bundle, manifest, with_files
from motor_fmu import driven, recorded

import cosim
from cosim.data.recording import Recording
from cosim.delivery.experiment import of_recording, sines, with_experiment
from cosim.fmi.manifest import manifest_of
from cosim.fmi.own_starts import MEMBER, as_member, own_starts
from cosim_calibration.left_behind import MANIFEST, left_behind
from pyfmi_models.card import read_card
from pyfmi_models.export import export_fmu

T = 0.01 * np.arange(101)


@pytest.fixture(scope="module")
def identified(fmu, tmp_path_factory) -> Path:
    """The motor with an experiment that it passes and a page, identified from one run and judged on another."""
    folder, current = tmp_path_factory.mktemp("identified"), 2 * np.sin(9 * T)
    files = bundle({"time": T, "i": current}, {"time": T, "w": driven(fmu, current)["w"]})
    rows = ("application/x-ma-hs-experiments", "a.exp", "experiment"), ("text/html", "page.html", "document")
    more = {"page.html": "<p/>", "fmi-ls-manifest.xml": manifest(*rows)}
    with_page = with_files(fmu, folder / "theirs.fmu", files | more)
    runs = [recorded(fmu, {"J": 0.03, "Fc": 0.16}, rows=150, seed=seed) for seed in (1, 2)]
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
    text = manifest(
        ("application/x-ma-hs-experiments", "a.exp", "experiment/smoke-test"),
        ("text/html", "b.html", "document"),
        ("text/csv", "r.csv", "result"),
        ("text/csv", "s.csv", "other"),
    )
    inside = '<Experiments><Stimuli source="s.csv"/><References source="../../modelDescription.xml"/></Experiments>'
    files = {MANIFEST: text, f"{FOLDER}/a.exp": inside, f"{FOLDER}/s.csv": "time\n0\n", "modelDescription.xml": "<x/>"}
    with archive_of(tmp_path / "some.zip", files) as archive:
        gone, left = left_behind(archive)
    assert gone == {MANIFEST, *(f"{FOLDER}/{name}" for name in ("a.exp", "r.csv", "s.csv"))}
    assert b"b.html" in left
    assert not any(name in left for name in (b"a.exp", b"r.csv", b"s.csv"))
    with archive_of(tmp_path / "none.zip", {"modelDescription.xml": "<x/>"}) as archive:
        assert left_behind(archive) == (frozenset(), b"")
    with archive_of(tmp_path / "torn.zip", {MANIFEST: "<torn"}) as archive:
        assert left_behind(archive) == (frozenset(), b"<torn"), "what cannot be read stays"


# What this project exports carries an experiment by which it can be checked elsewhere.


def test_an_exported_fmu_passes_the_experiment_that_it_carries_and_equal_cards_give_equal_bytes(tmp_path):
    once, again = (cosim.export("emps", tmp_path / name, fmi=3) for name in ("once", "again"))
    for path, same in zip(once.fmus, again.fmus, strict=True):
        assert path.read_bytes() == same.read_bytes()
        done = cosim.check(path)
        assert done.passed, str(done)
        assert done.checked.outcomes[0].compared
        assert done.checked.standard == "FMI-LS-REF 1.0.0-beta.1"


def test_the_torque_of_a_recording_is_the_stimulus_and_what_was_measured_lies_beside(tmp_path):
    model = read_card("paper_mount").plant().model()
    t = 1e-3 * np.arange(3000)
    table = {"t": t, "tau": 20 * np.sin(6 * t), "q": 1e-3 * np.cos(6 * t), "tau_d": t}
    stimulus = of_recording(Recording("night", table), model)
    path = tmp_path / "improved.fmu"
    with_experiment(lambda related: export_fmu(model, path, fmi=3, force=True, related=related), stimulus)
    done = cosim.check(path)
    assert done.passed, str(done)
    assert done.checked.outcomes[0].experiment.name == "night"
    with zipfile.ZipFile(path) as archive:
        measured = archive.read(f"{FOLDER}/measured.csv").decode().splitlines()
        assert measured[0] == "time,q"
        assert len(measured) == 2001
        assert "tau" in archive.read(f"{FOLDER}/stimulus.csv").decode().splitlines()[0]


def test_an_fmu_without_a_recording_is_asked_for_sines_of_two_seconds():
    """Also where the model is sampled: ten of its steps lie between two rows."""
    card = read_card("paper_mount")
    for model, every in ((card.plant().model(), 0.01), (card.controller_model(), 10 / card.controller.loop_hz)):
        times = sines(model).times
        np.testing.assert_allclose(np.diff(times), every)
        assert (times[0], times[-1]) == (0.0, pytest.approx(2.0))
