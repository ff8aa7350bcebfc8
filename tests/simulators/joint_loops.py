"""A joint under the same position loop in its FMU (FMPy) and in MuJoCo, for tests of what simulators hold."""

from pathlib import Path

import numpy as np
from nested_runs import InFmpy

from cosim.estimation.filters import lowpass
from cosim_simulators.motion import PERIODS, top_speed
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


class Loop:
    """PD with acceleration ahead; the torque is held for one period."""

    def __init__(self, mount: Mount) -> None:
        omega = 2 * np.pi * HERTZ
        self.inertia = float(mount.axis.inertia)
        self.kp, self.kd = omega**2, 2 * 0.7 * omega
        self.last = 0.0

    def torque(self, want: np.ndarray, q: float) -> float:
        v, self.last = (q - self.last) / PERIOD, q
        return self.inertia * (want[2] + self.kp * (want[0] - q) + self.kd * (want[1] - v))


def in_fmu(mount: Mount, folder: Path) -> np.ndarray:
    """Torque and position in each period: (rows, 2)."""
    path = folder / "plant.fmu"
    export_fmu(mount.model(), path, fmi=3, force=True)
    fmu, loop, rows = InFmpy(path, PERIOD), Loop(mount), []
    fmu.start()
    for k, want in enumerate(asked(mount).T):
        (q,) = fmu.get(["q"])
        rows.append((loop.torque(want, q), q))
        fmu.set({"tau": rows[-1][0]})
        fmu.fmu.doStep(k * PERIOD, PERIOD)
    return np.array(rows)


def in_mujoco(mount: Mount, text: str) -> np.ndarray:
    """The same in MuJoCo, whose steps divide the period."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    steps = round(PERIOD / model.opt.timestep)
    loop, rows = Loop(mount), []
    mujoco.mj_forward(model, data)
    for want in asked(mount).T:
        q = float(data.sensor("q").data[0])
        rows.append((loop.torque(want, q), q))
        data.ctrl[0] = rows[-1][0]
        for _ in range(steps):
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
    return np.array(rows)


def apart(one: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """RMS difference of the torque below 30 Hz, and RMS of the torque itself, after 1 s [N m]."""
    first, second = (lowpass(rows[:, 0].copy(), PERIOD, 30.0)[1000:-200] for rows in (one, other))
    return float(np.sqrt(np.mean((first - second) ** 2))), float(np.sqrt(np.mean(first**2)))
