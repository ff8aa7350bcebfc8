"""A card in other simulators: what files hold moves as the FMU does, and what they lose is what the table says."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import call
from nested_runs import InFmpy

from cosim.api.export import export
from cosim.estimation.filters import lowpass
from cosim_simulators import FORMATS
from cosim_simulators.measure import Held, hold
from cosim_simulators.motion import PERIODS, along_default, top_speed
from pyfmi_models.card import read_card
from pyfmi_models.effects import ActuatorLag, Cogging, Delay, Effect, GravityUnbalance, TorqueOffset
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.compliance import LoadSideCompliance
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.export import export_fmu
from pyfmi_models.mount import Mount

PERIOD, SECONDS = 1e-3, 8.0
"""Of the loop, and how long it runs [s]."""
HERTZ = 8.0
"""Bandwidth of the position loop [Hz]."""


def asked(mount: Mount) -> np.ndarray:
    """Set point, its speed and acceleration: (3, rows)."""
    t, top = np.arange(0, SECONDS, PERIOD), top_speed(mount)
    rise = np.clip(t / 1.0, 0, 1)
    rise = rise**3 * (10 - 15 * rise + 6 * rise**2)
    q = rise * sum(top / 2 * period / (2 * np.pi) * np.sin(2 * np.pi * t / period) for period in PERIODS)
    v = np.gradient(q, PERIOD)
    return np.array([q, v, np.gradient(v, PERIOD)])


def looped(mount: Mount, read: Callable[[], float], step: Callable[[int, float], None]) -> np.ndarray:
    """Torque and position in each period, (rows, 2), of PD with acceleration ahead; the torque is held for one."""
    omega, last, rows = 2 * np.pi * HERTZ, 0.0, []
    for k, (q_d, v_d, a_d) in enumerate(asked(mount).T):
        q = read()
        v, last = (q - last) / PERIOD, q
        torque = float(mount.axis.inertia) * (a_d + omega**2 * (q_d - q) + 2 * 0.7 * omega * (v_d - v))
        rows.append((torque, q))
        step(k, torque)
    return np.array(rows)


def in_fmu(mount: Mount, folder: Path) -> np.ndarray:
    path = folder / "plant.fmu"
    export_fmu(mount.model(), path, fmi=3, force=True)
    fmu = InFmpy(path, PERIOD)
    fmu.start()

    def step(k: int, torque: float) -> None:
        fmu.set({"tau": torque})
        fmu.fmu.doStep(k * PERIOD, PERIOD)

    return looped(mount, lambda: fmu.get(["q"])[0], step)


def in_mujoco(mount: Mount, text: str) -> np.ndarray:
    """In MuJoCo, whose steps divide the period."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    def step(_: int, torque: float) -> None:
        data.ctrl[0] = torque
        mujoco.mj_step(model, data, round(PERIOD / model.opt.timestep))
        mujoco.mj_forward(model, data)

    return looped(mount, lambda: float(data.sensor("q").data[0]), step)


def apart(one: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """RMS difference of the torque below 30 Hz, and RMS of the torque itself, after 1 s [N m]."""
    first, second = (lowpass(rows[:, 0].copy(), PERIOD, 30.0)[1000:-200] for rows in (one, other))
    return float(np.sqrt(np.mean((first - second) ** 2))), float(np.sqrt(np.mean(first**2)))


LOADS = (
    Cogging(cycles_per_rev=240, amplitude=0.5, phase=0.4),
    GravityUnbalance(mgl=3.0, phase=0.7),
    TorqueOffset(torque=1.2),
    CableWrap(stiffness=20.0, home=0.1),
    QuadraticDrag(coefficient=60.0),
)
DRIVE = Delay(delay_ms=3.0), ActuatorLag(time_constant_ms=4.0)


def mount(*effects: Effect) -> Mount:
    """The paper's mount with these effects."""
    return replace(read_card("paper_mount").plant(), effects=effects)


def held_by(simulator: str, plant: Mount) -> tuple[Held, str]:
    held = hold(plant, FORMATS[simulator], along_default(plant))
    return held, FORMATS[simulator].text(held.mount, plant, "a test")


@pytest.mark.parametrize(
    ("plant", "share"),
    [
        pytest.param(mount(), 0.002, id="lugre"),
        pytest.param(read_card("emps").plant(), 0.02, id="coulomb, linear"),
        pytest.param(mount(*LOADS), 0.002, id="loads"),
        pytest.param(mount(*DRIVE), 0.01, id="drive"),
        pytest.param(mount(Backlash(gap_rad=2e-3, load_friction=0.3)), 0.02, id="play"),
        pytest.param(mount(LoadSideCompliance(resonance_hz=60.0, encoder_share=0.5)), 0.03, id="spring"),
    ],
)
def test_what_mujoco_holds_moves_as_the_fmu(plant: Mount, share: float, tmp_path: Path) -> None:
    """`share`: of the torque; MuJoCo's dry friction creeps, and its contact is of first order in the time step."""
    held, text = held_by("mujoco", plant)
    assert held.lost == pytest.approx(0, abs=1e-9)
    assert not any("nearest" in one.note for one in held.rows), "it is the card's own law"
    difference, size = apart(in_fmu(plant, tmp_path), in_mujoco(plant, text))
    assert difference < share * size


def test_what_mujoco_loses_in_a_loop_is_what_the_table_says(tmp_path: Path) -> None:
    """Friction by direction becomes one law and a constant; the table measures that along another motion as fast."""
    plant = read_card("paper_mount_directional").plant()
    held, text = held_by("mujoco", plant)
    difference, _ = apart(in_fmu(plant, tmp_path), in_mujoco(plant, text))
    assert held.lost == pytest.approx(difference, rel=0.15)
    assert 0.05 < held.lost < 0.2, "a level by direction is held, the rest of the numbers is not"
    without, _ = held_by("urdf", plant)
    assert without.lost > 5 * held.lost


def test_the_error_on_a_recording_stands_beside_that_of_the_card(tmp_path: Path) -> None:
    tau, q = in_fmu(mount(), tmp_path).T
    table = {"t": np.arange(len(q)) * PERIOD, "tau": tau + np.random.default_rng(1).normal(0, 0.1, len(q)), "q": q}
    done = export("paper_mount", tmp_path / "out", fmi=3, mujoco=True, urdf=True, recording=table)
    mujoco, urdf = done.held
    assert mujoco.ratio == pytest.approx(1, abs=0.05)
    assert urdf.ratio > 1.5, "a level and a viscous coefficient are no Stribeck curve"
    assert urdf.held_error == pytest.approx((urdf.card_error**2 + urdf.lost**2) ** 0.5, rel=0.1)
    text = (tmp_path / "out" / "paper_mount_simulators.txt").read_text()
    assert f"({urdf.ratio - 1:+.1%})" in text


def test_a_part_that_is_not_held_is_named_with_its_torque() -> None:
    plant = mount(Cogging(cycles_per_rev=240, amplitude=0.5, harmonics=(0.5,)))
    lost = {one.part: one.lost for one in held_by("urdf", plant)[0].rows}
    assert 0.2 < lost["cogging"] < 0.5, "the RMS of a wave of 0.5 N m, less what is faster than 30 Hz"
    mujoco = {one.part: one for one in held_by("mujoco", plant)[0].rows}["cogging"]
    assert 0 < mujoco.lost < lost["cogging"]
    assert "harmonics" in mujoco.note


def test_urdf_is_read_by_others_and_says_the_cards_numbers(tmp_path: Path) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    plant = read_card("emps").plant()
    path = tmp_path / "emps.urdf"
    path.write_text(held_by("urdf", plant)[1])
    (joint,) = yourdfpy.URDF.load(str(path), load_meshes=False).robot.joints
    assert (joint.type, joint.limit.effort) == ("prismatic", 351.5)
    assert (float(joint.dynamics.friction), float(joint.dynamics.damping)) == (20.3935, 203.5034)


def test_an_unbalance_in_a_urdf_pulls_as_the_cards_at_every_position() -> None:
    mujoco = pytest.importorskip("mujoco")
    plant = mount(GravityUnbalance(mgl=3.0, phase=0.7))
    model = mujoco.MjModel.from_xml_string(held_by("urdf", plant)[1])
    model.opt.gravity[:] = (0, 0, -9.81)
    data = mujoco.MjData(model)
    for q in (-2.0, 0.0, 0.3, 1.5, 4.0):
        data.qpos[0] = q
        mujoco.mj_forward(model, data)
        assert data.qfrc_bias[0] == pytest.approx(3 * np.sin(q + 0.7), abs=1e-6)
    assert model.body_inertia[-1].max() + model.body_mass[-1] * (model.body_ipos[-1] ** 2).sum() == pytest.approx(30)


def test_isaac_text_is_usd_with_friction_per_degree(tmp_path: Path) -> None:
    usd = pytest.importorskip("pxr.Usd")
    held, text = held_by("isaac", mount())
    path = tmp_path / "joint.usda"
    path.write_text(text)
    stage = usd.Stage.Open(str(path))
    joint = stage.GetPrimAtPath("/joint/axis")
    assert joint.GetTypeName() == "PhysicsRevoluteJoint"
    shown = [one for one in joint.GetAttributes() if "physxJoint" in one.GetName()]
    numbers = {one.GetName().split(":")[-1]: one.Get() for one in shown}
    assert numbers["staticFrictionEffort"] == pytest.approx(3.322)
    law = held.mount.friction
    assert numbers["dynamicFrictionEffort"] == pytest.approx(law.Fc)
    assert numbers["viscousFrictionCoefficient"] == pytest.approx(law.sigma2 * np.pi / 180)


def test_the_command_writes_files_and_a_table_overwrites_nothing_and_needs_its_recording(tmp_path, capsys) -> None:
    asked = ["export", "paper_mount", "--fmi", "3", "--mujoco", "--urdf", "--isaac", "--json", "--out", str(tmp_path)]
    assert call(*asked) == 0
    told = json.loads(capsys.readouterr().out)
    assert {Path(told[name]).name for name in ("mujoco", "urdf", "isaac", "table")} <= {
        one.name for one in tmp_path.iterdir()
    }
    assert [one["simulator"] for one in told["held"]] == ["mujoco", "urdf", "isaac"]
    assert call(*asked) == 2
    assert "exists already" in capsys.readouterr().err
    asked = ["export", "paper_mount", "--urdf", "--recording", "none.csv", "--out", str(tmp_path / "o")]
    assert call(*asked) == 2
    assert "none.csv" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()
