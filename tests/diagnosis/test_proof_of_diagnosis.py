"""What proves a diagnosis beside its torque residual, and what makes it cheap and changes none of its numbers."""

import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from foreign_fmu import foreign
from problems import problem_of
from simulating import simulate

from cosim.data.recording import Recording
from cosim.data.signals import Multisine
from cosim.delivery.closed_loop import LoopError, Loops
from cosim.delivery.correction_fmu import Correction
from cosim.diagnosis.answer.result import Trace
from cosim.diagnosis.black_box import Base, BlackBox, as_base
from cosim.diagnosis.measure import regression
from cosim.diagnosis.measure.loop_bias import loop_bias
from cosim.diagnosis.measure.regression import black_box_rms, kernel
from cosim.estimation.fit import fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import choose_cutoff, prepare
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import residuals
from cosim.fmi.alias import Alias
from cosim.master.simulate import run
from cosim.support.errors import InputError, WiringError
from cosim.system.scenario import read_scenario
from cosim.system.wire import Record
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.card import Card, read_card
from pyfmi_models.correction import correction, left_out
from pyfmi_models.effects import Cogging
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.known_load import KnownLoad
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.export import export_fmu
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


# An FMU of another team as the base of a diagnosis: it follows the motion; an FMU in front of it corrects it.

CARD = read_card("paper_mount")
RIPPLE = Cogging(cycles_per_rev=20, amplitude=0.6, phase=0.3)
CONCEALED = replace(CARD, effects=(RIPPLE,))
NAMES = {"tau": "Motor.torque", "q": "Encoder.angle", "v": "Encoder.speed"}
SECONDS = 14


@dataclass(frozen=True)
class Team:
    """Their FMU of the card's physics, and recordings of a mount that also has a ripple."""

    box: BlackBox
    recordings: tuple[Recording, ...]
    rough: Card


FED = {"position": "q_d", "velocity": "v_d", "acceleration": "a_d"}
WIRES = [("k.tau", "p.tau"), ("p.q", "k.q"), *((f"ref.{theirs}", f"k.{ours}") for theirs, ours in FED.items())]


def recorded(plant: Path, controller: Path, seed: int) -> Recording:
    tones, taken = [0.07, 0.13, 0.19, 0.29], {"tau": Record("k.tau", "mean"), "q": Record("p.q")}
    ref = Multisine(kind="multisine", frequencies=tones, amplitudes=0.1, seed=seed, smooth_start=1.0)
    times: Any = {"step": 1e-4, "ticks": 10_000 * SECONDS, "decimation": 10}
    fmus = {"p": plant, "k": controller}
    run = simulate(fmus, WIRES, record=taken, signals={"ref": ref}, name=f"run{seed}", **times)
    assert run.recording is not None
    return run.recording


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Team:
    folder = tmp_path_factory.mktemp("team")
    controller = export_fmu(CARD.controller_model(), folder / "controller.fmu", fmi=3)
    real = export_fmu(CONCEALED.plant().model(), folder / "real.fmu", fmi=3)
    theirs = foreign(export_fmu(CARD.plant().model(), folder / "ours.fmu", fmi=2), folder / "theirs.fmu", names=NAMES)
    rough = replace(CARD, mount=CARD.mount.model_copy(update={"inertia": 20.0}), controller=None)
    box = BlackBox(theirs, {ours: Alias(name) for ours, name in NAMES.items()})
    return Team(box, tuple(recorded(real, controller, seed) for seed in (1, 2)), rough)


@pytest.fixture(scope="module")
def base(team: Team) -> Base:
    return as_base(team.box, team.recordings[:1], team.recordings[::-1], team.rough)


def test_the_card_that_is_most_like_the_fmu_has_its_numbers(base: Base) -> None:
    """The rough card is a third off in inertia; the FMU is this card's own physics."""
    assert base.card.mount.inertia == pytest.approx(CARD.mount.inertia, rel=5e-3)
    assert base.unlike < 0.05
    assert "theirs.fmu (SHA-256" in base.train[0].notes[-1]
    # Each that is held out is treated like one that is fitted.
    assert [one.name for one in base.heldout] == ["run2", "run1"]
    assert np.array_equal(base.heldout[1]["tau"], base.train[0]["tau"])


def test_what_is_missing_beside_the_card_is_what_is_missing_beside_the_fmu(base: Base) -> None:
    prepared = prepare(base.heldout[:1], 30.0)
    (missing,), piece = residuals(prepared, base.card.plant()), prepared.pieces[0]
    ripple = 0.6 * np.cos(20 * piece.q + 0.3)
    inside = piece.inside & (np.abs(piece.v) > 0.02)
    assert np.std((missing - piece.lowpass(ripple))[inside]) < 0.1 * np.std(ripple[inside])


@pytest.mark.parametrize(
    ("names", "error", "sentence"),
    [
        ({"tau": "disturbance", "q": "Encoder.angle"}, InputError, "does not follow the recorded motion"),
        ({"tau": "Motor.Torque"}, WiringError, r'stands for "Motor.Torque", which does not exist; .*Motor.torque'),
    ],
)
def test_an_fmu_that_is_asked_wrongly_is_refused(
    team: Team, names: dict[str, str], error: type[Exception], sentence: str
) -> None:
    box = BlackBox(team.box.fmu, {ours: Alias(name) for ours, name in names.items()})
    with pytest.raises(error, match=sentence):
        as_base(box, team.recordings[:1], team.recordings[1:], team.rough)


@pytest.mark.parametrize("is_known", [(True, False), (False, True), (True, True)])
def test_a_correction_reads_what_either_mount_reads(is_known: tuple[bool, bool]) -> None:
    """A load of 2 N m that only one of both knows is what they differ by; one that both know is none."""
    load = KnownLoad(gain=1.0)
    mounts = [replace(CARD.plant(), effects=(load,) if own else ()) for own in is_known]
    found = correction(mounts[0], mounts[1])
    assert [one.name for one in found.inputs] == ["tau", "q", "v", "load_torque"]
    states, parameters = ([one.start for one in group] for group in (found.states, found.parameters))
    out = float(found.equations(0.0, states, [5.0, 0.0, 0.0, 2.0], parameters)[1])
    assert out == pytest.approx(5.0 + 2.0 * (is_known[0] - is_known[1]))


def test_what_a_torque_cannot_give_is_left_out_by_name() -> None:
    sensor = EncoderEccentricity(cycles_per_rev=1.0, amplitude_rad=1e-4, phase=0.0)
    assert left_out(replace(CARD.plant(), effects=(RIPPLE, sensor))) == ("encoder_eccentricity",)


def test_the_improvement_comes_as_an_ssp_that_runs(team: Team, base: Base, tmp_path: Path) -> None:
    told = Correction(team.box, base.card, 0.2, 0.2).deliver(replace(base.card, effects=(RIPPLE,)), tmp_path)
    assert told["ssp"] == "improved.ssp"
    done = run(read_scenario(tmp_path / "improved.ssp"))
    assert done.statistics["steps"] == 150_000
    assert np.all(np.isfinite(done.recording["plant.Encoder.angle"] if done.recording else np.nan))


def test_without_a_speed_there_is_no_ssp_and_it_says_why(team: Team, base: Base, tmp_path: Path) -> None:
    names = {ours: one for ours, one in team.box.variables.items() if ours != "v"}
    told = Correction(replace(team.box, variables=names), base.card, 0.2, 0.2).deliver(base.card, tmp_path)
    assert "their FMU has no v; say which of its variables that is (--variables v=...)" in told["no_ssp"]
    assert not (tmp_path / "improved.ssp").exists()
