"""What makes a diagnosis cheap changes none of its numbers."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.delivery.closed_loop import Loops
from cosim.diagnosis.measure import regression
from cosim.diagnosis.measure.regression import kernel
from cosim.estimation.fit import fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import prepare
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.card import read_card

FAULTS = """
import resource
import numpy as np
from cosim.support.memory import keep_freed_memory
if {kept}:
    keep_freed_memory()
for _ in range(20):
    several = [np.ones(1_000_000) for _ in range(8)]
    del several
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""


def test_a_black_box_is_the_same_in_chunks_of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    rows, others = rng.normal(size=(900, 3)), rng.normal(size=(700, 3))
    found = []
    for size in (64, 10_000):
        monkeypatch.setattr(regression, "CHUNK", size)
        found.append(kernel(rows, np.sin(rows[:, 0]) * rows[:, 1])(others))
    np.testing.assert_allclose(*found, rtol=1e-9, atol=1e-12)
    truth = np.sin(others[:, 0]) * others[:, 1]
    assert np.corrcoef(found[0], truth)[0, 1] > 0.95


def test_a_fit_reports_the_model_at_the_numbers_it_ended_with(tmp_path: Path) -> None:
    write_case(make_case(5000, (), duration=15.0), tmp_path)
    card, train, _ = given(str(tmp_path))
    prepared = prepare(train, 30.0)
    weight = np.where(prepared.recording_of == 0, 1.0, 0.0)
    for weights in (weight, np.ones_like(weight)):
        found = fit(card.plant(), prepared.pieces, weights, evaluations=4)
        torque, slopes = stacked(Inverse(card.plant(), found.free), prepared.pieces, found.values)
        np.testing.assert_allclose(found.torque, torque, rtol=1e-12)
        np.testing.assert_allclose(found.slopes, slopes, rtol=1e-9, atol=1e-12 * np.abs(slopes).max())


def test_equal_models_have_their_loop_closed_once(tmp_path: Path) -> None:
    write_case(make_case(5000, (), duration=15.0), tmp_path)
    card, _, held = given(str(tmp_path))
    other = replace(card, mount=card.mount.model_copy(update={"inertia": 2 * card.mount.inertia}))
    with Loops(card, [held]) as loops:
        for key, one in (("nominal", card), ("same", read_card(tmp_path / "card.toml")), ("other", other)):
            loops.close(key, one.plant())
        errors = loops.errors()
        assert loops.runs("nominal") is loops.runs("same")
    assert errors["nominal"] == errors["same"] != errors["other"]


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's allocator")
def test_freed_memory_stays_for_the_next_array() -> None:
    command = [sys.executable, "-c"]
    faults = [
        int(subprocess.run([*command, FAULTS.format(kept=kept)], capture_output=True, check=True).stdout)
        for kept in (True, False)
    ]
    assert faults[0] < faults[1] / 2


def test_a_direction_that_training_never_had_ends_no_black_box() -> None:
    """A motor that turns one way in training and both ways in validation: that feature has no spread."""
    random = np.random.default_rng(0)
    rows, others = (np.column_stack([random.normal(size=n), np.ones(n)]) for n in (400, 50))
    others[:25, 1] = -1.0
    found = kernel(rows, rows[:, 0])(others)
    assert np.isfinite(found).all()
    assert np.abs(found[25:] - others[25:, 0]).max() < 0.2
