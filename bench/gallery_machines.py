"""The machines of the gallery: which recordings, how they are read, what their owners know, under which licence."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import measured
import measured_later
import numpy as np
import pandas as pd

Tables = dict[str, pd.DataFrame]


class Given(NamedTuple):
    """What a diagnosis of a machine is given: card, recordings to fit and held out, `--columns`, `--units`."""

    card: str
    recordings: tuple[Tables, Tables]
    columns: tuple[str, ...] = ()
    units: tuple[str, ...] = ()


@dataclass(frozen=True)
class Shown:
    """A machine of the gallery."""

    id: str
    title: str
    known: str
    source: str
    over: str
    """What the picture of the error goes over: "position" or "speed"."""
    load: Callable[[Path], Given]
    """From the folder of all machines."""
    generated: bool = False


def of_bench(make: Callable[[Path], Any], folder: str, number: int = 0) -> Callable[[Path], Given]:
    """A machine as bench/measured.py reads it, by its place there."""

    def load(data: Path) -> Given:
        one = list(make(data / folder))[number]
        return Given(one.card, (one.train, one.heldout), one.columns, one.units)

    return load


def of_folder(folder: str, card: str, train: str, held: str, *columns: str) -> Callable[[Path], Given]:
    """A machine whose folder holds a card and recordings, named without their suffix."""

    def load(data: Path) -> Given:
        home = data / folder
        fitted, kept = ({n: pd.read_parquet(home / f"{n}.parquet") for n in names.split()} for names in (train, held))
        return Given((home / card).read_text("utf-8"), (fitted, kept), columns)

    return load


def emps(data: Path) -> Given:
    """Bang-bang motion of a ball screw axis by the published asymmetric model, with a delay of the force."""
    card = (files("pyfmi_models") / "cards" / "emps.toml").read_text("utf-8")
    return Given(card, tuple({f"made_{k}": _emps(k)} for k in (1, 2)))  # type: ignore[arg-type]


RATE, LAPS, LAP = 1000, 4, 6.24
"""Hz, laps of the published motion, seconds of one."""
MASS, DELAY, NOISE = 95.154, 0.55e-3, 1.2
"""kg and s as published or seen there; N RMS, what the standard model leaves without its named physics."""
FORWARD, BACKWARD = (166.7061, 20.144), (240.4236, 20.6277)
"""N s/m and N for each direction (Janot, Gautier, Brunot 2019, asymmetric model)."""


def _emps(seed: int) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    t = np.arange(round(LAPS * LAP * RATE)) / RATE
    speeds = np.repeat(rng.uniform(0.03, 0.12, 2 * LAPS), round(LAP * RATE / 2)) * np.sign(np.sin(2 * np.pi * t / LAP))
    v = np.convolve(np.pad(speeds, 150, mode="edge"), np.ones(301) / 301, "valid")
    a = np.gradient(v, t)
    viscous, level = (np.where(v > 0, one, other) for one, other in zip(FORWARD, BACKWARD, strict=True))
    force = MASS * a + viscous * v + level * np.tanh(v / 1e-3) - 3.1648
    early = np.interp(t + DELAY, t, force)
    q = _travelled(v, RATE)
    return pd.DataFrame({"t": t, "q": q, "q_ref": q, "force": early + rng.normal(0, NOISE, t.size)})


def _travelled(v: np.ndarray, rate: float) -> np.ndarray:
    """Position at the moments at which the speed is given, by trapezes: a plain sum would be half a sample early."""
    return np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1])) / rate)


JOINT = """
[mount]
name = "joint_2"
inertia = 9.0
torque_limit = 330.0
machine = "harmonic_drive"
[friction]
model = "coulomb"
Fc = 8.0
sigma2 = 12.0
"""


def joint(data: Path) -> Given:
    """Triangles of a robot joint that carries its arm, by what was fitted to the measured one."""
    return Given(JOINT, tuple({f"made_{k}": _joint(k)} for k in (1, 2)))  # type: ignore[arg-type]


GRAVITY, SHARE = 113.6, 0.058
"""N m; friction per load, as fitted to the measured joint."""


def _joint(seed: int) -> pd.DataFrame:
    rng = np.random.default_rng(seed + 10)
    rate, seconds = 100, 30
    t = np.arange(rate * seconds) / rate
    speeds = (
        np.repeat(rng.uniform(0.1, 0.9, seconds // 2), 2 * rate) * np.tile(np.repeat([1, -1], 2 * rate), 8)[: t.size]
    )
    v = np.convolve(np.pad(speeds, 15, mode="edge"), np.ones(31) / 31, "valid")
    q = -1.4 + _travelled(v, rate)
    load = GRAVITY * np.sin(q)
    friction = (7.5 + SHARE * np.abs(load)) * np.tanh(v / 5e-3) + 14.0 * v
    tau = 9.0 * np.gradient(v, t) + friction + load + rng.normal(0, 0.6, t.size)
    return pd.DataFrame({"t": t, "q": q, "tau": tau})


MACHINES = (
    Shown(
        "brushless_motor",
        "Brushless motor at one turn a second",
        "cogging of 72 waves a turn, 4 to 6 mN·m, also of 12, 18, 24 and 36",
        "`heitor-andrade/laas_anti_cogging`, BSD 3-Clause; torque from the current by an assumed 0.025 N·m/A.",
        "position",
        of_bench(measured_later.anticogging, "anticogging_motor"),
    ),
    Shown(
        "pendulum",
        "Pendulum on a quasi-direct drive",
        "a weight of 0.55 kg at 0.5 m: 2.9 N·m, the torque reading 1.2 to 1.4 times too large; a late torque reading",
        "`dfki-ric-underactuated-lab`, torque-limited simple pendulum, BSD 3-Clause (2021).",
        "position",
        of_bench(measured_later.pendulum, "quasi_direct_pendulum"),
    ),
    Shown(
        "elbow",
        "Elbow of a double pendulum",
        "gravity of the sum of both angles and coupling to the shoulder; both move at once",
        "`dfki-ric-underactuated-lab/double_pendulum`, BSD 3-Clause (2022, DFKI RIC Underactuated Robotics Lab).",
        "position",
        of_folder("double_pendulum", "card_elbow.toml", "run_12 run_00", "run_13", "tau=tau2", "q=q2", "v=v2"),
    ),
    Shown(
        "lead_screw",
        "Lead screw under a constant payload",
        "a constant torque of the payload, and Stribeck friction near 6 rad/s",
        "`RViMLab/TRO2021-Dynamic-Modelling` (Mablekos-Alexiou, da Cruz, Bergeles, IEEE T-RO 37, 2021), MIT; one speed "
        "a recording, no position.",
        "speed",
        of_bench(measured.screws, "screw_drives"),
    ),
    Shown(
        "lift",
        "Vertical screw axis of a mobile robot",
        "a constant weight of 0.98 in the robot's own unit of effort; one run meets its end stop",
        "TIAGo of PAL Robotics in `thanhndv212/figaroh-examples`, Apache 2.0 as its README states.",
        "speed",
        of_folder("tiago_lift_arm", "card_lift.toml", "lift_a lift_b", "lift_c"),
    ),
    Shown(
        "arm",
        "Second arm joint of a mobile robot",
        "gravity of 1.74 in the robot's own unit of effort, contacts that bend; all joints move at once",
        "TIAGo of PAL Robotics in `thanhndv212/figaroh-examples`, Apache 2.0 as its README states.",
        "position",
        of_folder("tiago_lift_arm", "card_arm2.toml", "arm2_a arm2_b", "arm2_c"),
    ),
    Shown(
        "ball_screw",
        "Ball screw axis (EMPS)",
        "asymmetric friction, an offset, a delay of the force of 0.55 ms",
        "The licence of the measured benchmark is not stated: this is its published asymmetric model (Janot, Gautier, "
        "Brunot, Workshop on Nonlinear System Identification Benchmarks, 2019) on a motion made up here.",
        "speed",
        emps,
        generated=True,
    ),
    Shown(
        "robot_joint",
        "Robot joint with harmonic drive that carries its arm",
        "gravity of 114 N·m, friction that grows with the load by 0.058",
        "The measured recordings of a UR10e state no licence: gravity and load friction as fitted to them, inertia, "
        "friction and motion made up here.",
        "position",
        joint,
        generated=True,
    ),
)
