"""The motion along which a joint is compared: a recording's, or where there is none a motion made from the card."""

from dataclasses import dataclass
from math import pi

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.prepare import PROTOCOL_HZ, Prepared, choose_cutoff, prepare
from pyfmi_models.friction.base import each_way
from pyfmi_models.mount import Mount

SECONDS, RATE = 40.0, 500.0
"""Length [s] and sample rate [Hz] of the motion where there is no recording."""
PERIODS = (20.0, 3.7)
"""Periods of its two sines [s]: a slow one, and a faster one that reverses the axis about ten times."""
TOP = 4.0
"""Its highest speed in units of the speed over which friction falls: there a Stribeck curve has fallen."""


@dataclass(frozen=True)
class Compared:
    """Pieces of a motion, and what it is called; `measured` says that its torque was recorded."""

    prepared: Prepared
    name: str
    measured: bool


def along_recording(recording: Recording, mount: Mount) -> Compared:
    """The motion of a recording, in the band that its noise leaves, at most 30 Hz."""
    cutoff = min(PROTOCOL_HZ, choose_cutoff([recording], float(mount.axis.inertia)))
    return Compared(prepare([recording], cutoff), recording.name, True)


def along_default(mount: Mount) -> Compared:
    """Two sines that reverse and reach the speed at which friction has fallen, or viscous friction equals the level."""
    t = np.arange(0, SECONDS, 1 / RATE)
    top = top_speed(mount)
    q = sum(top / 2 * period / (2 * pi) * np.sin(2 * pi * t / period) for period in PERIODS)
    v = sum(top / 2 * np.cos(2 * pi * t / period) for period in PERIODS)
    recording = Recording.of({"t": t, "q": q, "tau": float(mount.axis.inertia) * np.gradient(v, t)}, "default motion")
    unit = "rad/s" if mount.motion == "rotary" else "m/s"
    name = f"two sines of {PERIODS[0]:g} s and {PERIODS[1]:g} s, up to {top:.3g} {unit}"
    return Compared(prepare([recording], PROTOCOL_HZ), name, False)


def top_speed(mount: Mount) -> float:
    """Highest speed of the motion made from a card [rad/s; m/s].

    `TOP` Stribeck speeds where the law has one; else where viscous friction is as large as the level, from 0.01 to 1.
    """
    laws = each_way(mount.friction)
    falls = [float(speed) for law in laws if (speed := getattr(law, "Vs", None)) is not None]
    if falls:
        return TOP * max(falls)
    levels, slopes = ([float(getattr(law, name, 0.0) or 0.0) for law in laws] for name in ("Fc", "sigma2"))
    return float(np.clip(max(levels) / max(slopes), 0.01, 1.0)) if max(slopes) > 0 and max(levels) > 0 else 0.1
