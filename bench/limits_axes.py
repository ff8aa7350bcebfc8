"""Axes drawn at random, each with something concealed, in its loop: on the co-simulated plant, and behind a drive.

The scenario is that of `investigations.py` with other numbers. The drive alone has the narrow limits, the
loop that orders has wide ones: an order beyond, or a speed beyond, reaches the drive, which counts it. The drive is the
same (`drive.c`) in this process and, at the other end of UDP, as the virtual drive.
"""

import re
import sys
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim.data.recording import Recording
from cosim.hardware.machine import changed, read_machine
from cosim.hardware.session import Session
from cosim.hardware.simulated import Plant, SimulatedDrive
from cosim.hardware.structures import CDrive
from cosim.hardware.virtual import VirtualDrive
from cosim.hardware.wired import wire_up
from cosim.models.cache import with_fmus
from cosim.system.scenario import read_scenario
from cosim_investigation.drive import Driven
from cosim_investigation.limits import Limits
from cosim_investigation.machine import CoSimulated
from cosim_investigation.motions import Motion
from pyfmi_models.card import Card, read_card

sys.path.append(str(Path(__file__).parents[1] / "tests/tools"))
from investigations import BELIEVED, SCENARIO

QUIET = (r'\[signals\.(ripple|grain)\]\nkind = "noise"\nrms = \S+\nseed = \d\n\n', r'noise = "\w+"\n')
"""What a drive's scenario lacks: noise; its encoder has steps."""
QUANTUM = 1e-6
"""Of the drive's encoder [rad]."""
BEYOND = {"torque": 1e4, "slew": 1e7, "speed": 1e3, "following_error": 1e3, "jump": 1.0, "torque_mismatch": 1e4}
WIDE = changed(read_machine("simulated"), "wide", limits=BEYOND)
"""A loop without limits, where the drive's own are asked, SI: none is ever met."""


@dataclass(frozen=True)
class Axis:
    """An axis in its loop: as a recording is made of it, as a drive moves it, and what is believed of it."""

    concealed: str
    simulated: CoSimulated
    driven: CoSimulated
    card: Card
    bandwidth: float
    """Of its loop [Hz]."""

    @cached_property
    def home(self) -> float:
        """Where it stands behind a drive; asked once, as it is the same before each motion."""
        return Driven(self.driven, WIDE, fast=True).home


def concealed(rng: np.random.Generator, level: float) -> tuple[str, str]:
    """Effect and the lines of a card; about a tenth to all of the friction `level` [N m] in size."""
    size, phase = level * float(np.exp(rng.uniform(np.log(0.1), 0.0))), float(rng.uniform(-3, 3))
    turn, home = int(rng.integers(3, 60)), float(rng.uniform(-0.3, 0.3))
    every = {
        "nothing": "",
        "dwell_breakaway": f"torque_per_efold = {size / 5}",
        "cable_wrap": f"stiffness = {2 * size}\nhome = {home}",
        "gravity_unbalance": f"mgl = {size}\nphase = {phase}",
        "cogging": f"cycles_per_rev = {turn}\namplitude = {size / 2}\nphase = {phase}",
        "torque_offset": f"torque = {size / 2}",
        "friction_asymmetry": f"level_asymmetry = {0.5 * size / level}\nviscous_asymmetry = 0.1",
        "quadratic_drag": f"coefficient = {2 * size}",
        "periodic_disturbance": f"frequency_hz = {turn / 12}\namplitude = {size / 4}\nphase = {phase}",
    }
    name = str(rng.choice([*every]))
    return name, f'\n[[effects]]\neffect = "{name}"\n{every[name]}\n' if every[name] else ""


def axis(rng: np.random.Generator, folder: Path) -> Axis:
    """Draw inertia, friction and bandwidth evenly in their logarithm; the card believes numbers up to 15 % off."""
    inertia, level, bandwidth = (float(np.exp(rng.uniform(*np.log(e)))) for e in ((1, 20), (0.5, 5), (1.5, 5)))
    w = 2 * np.pi * bandwidth
    true = {"inertia": inertia, "sigma0": 4500 * level, "sigma1": 30 * level, "sigma2": 2 * level}
    true |= {"Fc": level, "Fs": level * float(rng.uniform(1, 1.3))}
    off = {name: value * float(rng.uniform(0.85, 1.15)) for name, value in true.items()}
    off["Fs"] = max(off["Fs"], off["Fc"])
    loop = {"kp": w**2, "kd": 2 * w, "observer_bandwidth": 8 * w, "torque_limit": 1e3}
    name, effect = concealed(rng, level)
    card, machine = folder / "card.toml", folder / "machine.toml"
    card.write_text(_with(BELIEVED, off | loop), "utf-8")
    machine.write_text(_with(BELIEVED, true | loop) + effect, "utf-8")
    simulated = CoSimulated(read_scenario(_scenario(folder / "plant.toml", card, card, level)), str(machine))
    driven = CoSimulated(read_scenario(_scenario(folder / "drive.toml", card, machine, 0.0)))
    return Axis(name, simulated, driven, read_card(card), bandwidth)


def _with(text: str, numbers: dict[str, float]) -> str:
    for name, value in numbers.items():
        text = re.sub(rf"^{name} = .*$", f"{name} = {value}", text, flags=re.MULTILINE)
    return text


def _scenario(path: Path, card: Path, plant: Path, level: float) -> Path:
    """The scenario of the tests with noise of the torque of 2 % of a level; for a drive (level 0) none, and steps."""
    text = SCENARIO.replace("rms = 0.05", f"rms = {0.02 * level}")
    if not level:
        for pattern in QUIET:
            text = re.sub(pattern, "", text)
        text = text.replace('from = "mount.q"\n', f'from = "mount.q"\nquantum = {QUANTUM}\n')
    text = text.replace('[components.mount]\ncard = "CARD"', f'[components.mount]\ncard = "{plant}"')
    path.write_text(text.replace("CARD", str(card)) + 'true_q = "mount.q"\ntrue_v = "mount.v"\n', "utf-8")
    return path


@dataclass(frozen=True)
class Narrow(Driven):
    """A drive in this process with a torque and a speed of its own, behind a loop that has none."""

    own: tuple[float, float] = (0.0, 0.0)
    stands: float = 0.0
    seen: list[CDrive] = field(default_factory=list)

    @cached_property
    def home(self) -> float:
        """Where the axis is known to stand."""
        return self.stands

    def _tighten(self, session: Session) -> None:
        """The hook before a session moves: it is the drive that is tightened here."""
        transport = session.transport
        if isinstance(transport, SimulatedDrive):
            transport.drive.torque, transport.drive.speed = self.own
            self.seen.append(transport.drive)


def on_a_drive(one: Axis, motion: Motion, limits: Limits, path: Path) -> tuple[Recording, dict[str, int]]:
    """Follow a motion in this process; the recording, and how often the drive itself found what is beyond a limit."""
    drive = Narrow(one.driven, WIDE, fast=True, own=(limits.torque, limits.speed), stands=one.home)
    found = drive.record(motion, 0, path)
    return found, {name: sum(int(getattr(own, name)) for own in drive.seen) for name in ("limited", "overspeeds")}


def over_udp(one: Axis, motion: Motion, limits: Limits, path: Path) -> tuple[Recording, dict[str, int]]:
    """The same on a virtual drive over UDP, in lockstep."""
    with ExitStack() as stack:
        wired = wire_up(with_fmus(one.driven.scenario), stack)
        plant = Plant(wired.plant, wired.torque, wired.position)
        narrow = changed(WIDE, "narrow", limits={**BEYOND, "torque": limits.torque, "speed": limits.speed})
        made = VirtualDrive(plant, narrow, one.driven.scenario.step, wired.quantum, lockstep=True)
        there = stack.enter_context(made)
        found = Driven(one.driven, changed(WIDE, "wide", adapter=there.url), fast=True).record(motion, 0, path)
        return found, {"limited": int(there.drive.limited), "overspeeds": int(there.drive.overspeeds)}
