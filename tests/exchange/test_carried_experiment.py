"""What this project exports carries an experiment by which it can be checked elsewhere."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.data.recording import Recording
from cosim.delivery.experiment import of_recording, sines, with_experiment
from cosim.fmi.domain import KEY, Domain, entries_of
from pyfmi_models.card import read_card
from pyfmi_models.export import export_fmu
from pyfmi_models.export.related import identified

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"


@pytest.fixture(scope="module")
def exported(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    cosim.export("emps", folder, fmi=3)
    return folder


def test_an_exported_fmu_passes_the_experiment_that_it_carries(exported):
    for path in exported.glob("*.fmu"):
        done = cosim.check(path)
        assert done.passed, str(done)
        assert done.checked.outcomes[0].compared
        assert done.checked.standard == "FMI-LS-REF 1.0.0-beta.1"


def test_equal_cards_still_give_equal_bytes(exported, tmp_path):
    again = cosim.export("emps", tmp_path, fmi=3)
    for path in again.fmus:
        assert path.read_bytes() == (exported / path.name).read_bytes()


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


def test_the_range_in_which_a_model_is_proven_is_shown(tmp_path):
    domains = (Domain("speed", -2.6, 3.6, "rad/s"), Domain("position", 0.1, 0.5, "rad"))
    told = identified("improved", {"version": "1", KEY: entries_of(domains)}, b"")
    path = export_fmu(read_card("paper_mount").plant().model(), tmp_path / "a.fmu", related=told)
    facts = cosim.show(path).facts
    assert facts["proven for"] == "speed -2.6 to 3.6 rad/s; position 0.1 to 0.5 rad"
    assert "meta-data" in facts["brings along"]


def test_an_fmu_without_a_recording_is_asked_for_sines_of_two_seconds():
    """Also where the model is sampled: ten of its steps lie between two rows."""
    card = read_card("paper_mount")
    for model, every in ((card.plant().model(), 0.01), (card.controller_model(), 10 / card.controller.loop_hz)):
        times = sines(model).times
        np.testing.assert_allclose(np.diff(times), every)
        assert (times[0], times[-1]) == (0.0, pytest.approx(2.0))
