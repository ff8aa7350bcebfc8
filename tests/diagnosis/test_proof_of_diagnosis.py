"""What proves a diagnosis beside its torque residual, and what makes it cheap and changes none of its numbers."""

import subprocess
import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from problems import problem_of

from cosim.data.recording import Recording
from cosim.delivery.closed_loop import LoopError, Loops
from cosim.diagnosis.answer.result import Trace
from cosim.diagnosis.measure import regression
from cosim.diagnosis.measure.loop_bias import loop_bias
from cosim.diagnosis.measure.regression import black_box_rms, kernel
from cosim.estimation.fit import fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import choose_cutoff
from cosim.estimation.problem import Problem
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.card import Card
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.mount import Mount


class Case(NamedTuple):
    """A mount that conceals a drag from its card."""

    card: Card
    train: list[Recording]
    held: Recording
    drag: float

    def problem(self) -> Problem:
        """That of the true structure."""
        mount = replace(self.card.plant(), effects=(QuadraticDrag(coefficient=self.drag),))
        cutoff = choose_cutoff(self.train, self.card.mount.inertia)
        return problem_of(mount, *self.train, cutoff=cutoff, slow=-1.0, sample=1e-3)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    folder = tmp_path_factory.mktemp("drag")
    made = make_case(5, ["quadratic_drag"], friction="lugre", duration=25.0)
    write_case(made, folder)
    return Case(*given(str(folder)), float(made.truth["effects"][0]["parameters"]["coefficient"]))


def blind(recording: Recording) -> Recording:
    """The same without a set point."""
    return replace(recording, table={name: column for name, column in recording.table.items() if name != "q_d"})


def loop_errors(card: Card, recording: Recording, **mounts: Mount) -> dict[str, LoopError]:
    with Loops(card, [recording]) as loops:
        for key, mount in mounts.items():
            loops.close(key, mount)
        return loops.errors()


def test_the_true_model_follows_the_recorded_set_point_better(case: Case) -> None:
    problem = case.problem()
    found = loop_errors(case.card, case.held, nominal=case.card.plant(), after=problem.fit(problem.mount, 25).mount)
    assert found["after"].position < 0.6 * found["nominal"].position
    assert found["after"].torque < 0.6 * found["nominal"].torque


def test_no_loop_is_closed_without_a_controller_or_a_set_point(case: Case) -> None:
    assert loop_errors(case.card, blind(case.held), nominal=case.card.plant()) == {}
    assert loop_errors(replace(case.card, controller=None), case.held, nominal=case.card.plant()) == {}


def test_equal_models_have_their_loop_closed_once(case: Case) -> None:
    plant = case.card.plant()
    other = replace(plant, axis=replace(plant.axis, inertia=2 * plant.axis.inertia))
    with Loops(case.card, [case.held]) as loops:
        for key, one in (("nominal", plant), ("same", case.card.plant()), ("other", other)):
            loops.close(key, one)
        errors = loops.errors()
        assert loops.runs("nominal") is loops.runs("same")
    assert errors["nominal"] == errors["same"] != errors["other"]


def test_the_loop_does_not_bias_a_right_model_and_a_planted_bias_is_seen(case: Case) -> None:
    problem = case.problem()
    fit = problem.fit(problem.mount, 25)
    weight = np.ones(len(fit.residual))
    assert loop_bias(problem.prepared, fit, weight)["biased"] is False
    index = fit.free.index("friction.sigma2")
    noise = np.random.default_rng(1).standard_normal(len(fit.residual))
    # An error in the derivative that the residual knows too, and the set point does not: what noise does in a loop.
    slopes = fit.slopes.copy()
    size = 0.5 * slopes[:, index].std()
    slopes[:, index] += size * noise
    # Noise that is white over more rows (2.5 a cutoff, not 1.4) pushes a block's mean by less.
    push = 0.3 * abs(fit.values[index]) * size * noise
    biased = loop_bias(problem.prepared, replace(fit, slopes=slopes, residual=fit.residual + push), weight)
    assert biased["p_value"] < 1e-3


def test_without_a_set_point_nothing_is_said_of_bias(case: Case) -> None:
    problem = case._replace(train=[blind(one) for one in case.train]).problem()
    assert loop_bias(problem.prepared, problem.fit(problem.mount, 5), problem.weight) == {}


def test_a_fit_reports_the_model_at_the_numbers_it_ended_with(case: Case) -> None:
    problem, plant = case.problem(), case.card.plant()
    pieces = problem.prepared.pieces
    for weights in (np.where(problem.prepared.recording_of == 0, 1.0, 0.0), problem.weight):
        found = fit(plant, pieces, weights, evaluations=4)
        torque, slopes = stacked(Inverse(plant, found.free), pieces, found.values)
        np.testing.assert_allclose(found.torque, torque, rtol=1e-12)
        np.testing.assert_allclose(found.slopes, slopes, rtol=1e-9, atol=1e-12 * np.abs(slopes).max())


def traced(seed: int, heldout: bool = False) -> Trace:
    """A smooth torque over position, and a tenth of noise."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 30.0, 1 / 240)
    q = np.sin(0.8 * t + seed)
    tau = np.sin(5 * q) + 0.1 * rng.standard_normal(len(t))
    signals = {"t": t, "q": q, "v": 0.8 * np.cos(0.8 * t + seed), "tau": tau, "missing": tau}
    return Trace(name="run", heldout=heldout, **signals, **dict.fromkeys(("before", "after", "band"), 0 * t))


def test_a_black_box_learns_what_is_smooth_and_leaves_the_noise() -> None:
    held = traced(3, heldout=True)
    assert 0.1 < black_box_rms([traced(1), traced(2), held]) < 0.3 * float(np.sqrt(np.mean(held.missing**2)))


def test_a_black_box_is_the_same_in_chunks_of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    rows, others = rng.normal(size=(900, 3)), rng.normal(size=(700, 3))
    found = []
    for size in (64, 10_000):
        monkeypatch.setattr(regression, "CHUNK", size)
        found.append(kernel(rows, np.sin(rows[:, 0]) * rows[:, 1])(others))
    np.testing.assert_allclose(*found, rtol=1e-9, atol=1e-12)
    assert np.corrcoef(found[0], np.sin(others[:, 0]) * others[:, 1])[0, 1] > 0.95


def test_a_direction_that_training_never_had_ends_no_black_box() -> None:
    """A motor that turns one way in training and both ways in validation: that feature has no spread."""
    random = np.random.default_rng(0)
    rows, others = (np.column_stack([random.normal(size=n), np.ones(n)]) for n in (400, 50))
    others[:25, 1] = -1.0
    found = kernel(rows, rows[:, 0])(others)
    assert np.isfinite(found).all()
    assert np.abs(found[25:] - others[25:, 0]).max() < 0.2


FAULTS = """
from resource import RUSAGE_SELF, getrusage
import numpy as np
from cosim.support.memory import keep_freed_memory
for keep in (lambda: None, keep_freed_memory):
    keep()
    begun = getrusage(RUSAGE_SELF).ru_minflt
    for _ in range(20):
        several = [np.ones(1_000_000) for _ in range(8)]
        del several
    print(getrusage(RUSAGE_SELF).ru_minflt - begun)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's allocator")
def test_freed_memory_stays_for_the_next_array() -> None:
    before, after = subprocess.run([sys.executable, "-c", FAULTS], capture_output=True, check=True).stdout.split()
    assert int(after) < int(before) / 2
