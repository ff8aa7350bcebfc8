"""An FMU of another team as the base of a diagnosis: it follows the motion; an FMU in front of it corrects it."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from foreign_fmu import foreign
from simulating import simulate

from cosim.data.recording import Recording
from cosim.data.signals import Multisine
from cosim.delivery.correction_fmu import Correction
from cosim.diagnosis.black_box import Base, BlackBox, as_base
from cosim.estimation.prepare import prepare
from cosim.estimation.residuals import residuals
from cosim.fmi.alias import Alias
from cosim.master.simulate import run
from cosim.support.errors import InputError, WiringError
from cosim.system.scenario import read_scenario
from cosim.system.wire import Record
from pyfmi_models.card import Card, read_card
from pyfmi_models.correction import correction, left_out
from pyfmi_models.effects import Cogging
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.known_load import KnownLoad
from pyfmi_models.export import export_fmu

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
    tones = [0.07, 0.13, 0.19, 0.29]
    run = simulate(
        {"p": plant, "k": controller},
        WIRES,
        record={"tau": Record("k.tau", "mean"), "q": Record("p.q")},
        step=1e-4,
        ticks=10_000 * SECONDS,
        signals={"ref": Multisine(frequencies=tones, amplitudes=0.1, seed=seed, smooth_start=1.0, kind="multisine")},
        decimation=10,
        name=f"run{seed}",
    )
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
