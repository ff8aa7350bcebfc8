"""Recordings as an identification needs them: in closed loop under a set point, in open loop under a torque."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.set_point import set_point
from cosim.master.simulate import simulate
from cosim.system.system import System
from cosim.system.wire import Record, Wire
from cosim_studies.paper.experiment import Floats
from pyfmi_models.card import Card
from pyfmi_models.export import export_fmu

STEP = 1e-4
"""Period of the controller and of the torque [s]."""


def moved(card: Card, q_d: Floats, noise: float = 0.0, seed: int = 0) -> Recording:
    """Plant and controller FMUs under a set point given at 1 kHz; white encoder noise [rad rms] in the loop.

    Recorded at 1 kHz: the mean torque of each row, what the encoder read, the set point.
    """
    t = np.arange(len(q_d)) / 1000
    signals: dict[str, Any] = set_point(Recording("set point", {"t": t, "q": q_d, "q_d": q_d}), STEP)
    ticks = len(signals["q_d"])
    signals["noise"] = noise * np.random.default_rng(seed).standard_normal(ticks)
    with TemporaryDirectory() as folder:
        system = System(
            components={
                "plant": export_fmu(card.plant().model(), Path(folder) / "plant.fmu"),
                "controller": export_fmu(card.controller_model(), Path(folder) / "controller.fmu"),
            },
            wires=[
                Wire("controller.tau", "plant.tau"),
                Wire("plant.q", "controller.q", noise="noise"),
                *(Wire(name, f"controller.{name}") for name in ("q_d", "v_d", "a_d")),
            ],
            records={"tau": Record("plant.tau", "mean"), "q": Record("controller.q"), "q_d": Record("q_d")},
            step=STEP,
            ticks=ticks,
            signals=signals,
            decimation=10,
        )
        return simulate(system).recording


def pushed(card: Card, tau: Floats, name: str = "pushed", decimation: int = 1) -> Recording:
    """The plant FMU from rest under a torque given at 10 kHz: torque, position and speed."""
    with TemporaryDirectory() as folder:
        system = System(
            components={"plant": export_fmu(card.plant().model(), Path(folder) / "plant.fmu")},
            wires=[Wire("torque", "plant.tau")],
            records={"tau": Record("plant.tau", "mean"), "q": Record("plant.q"), "v": Record("plant.v")},
            step=STEP,
            ticks=len(tau),
            signals={"torque": tau},
            decimation=decimation,
            name=name,
        )
        return simulate(system).recording


def step_response(card: Card, torque: float, noise: float, seed: int) -> Recording:
    """One second at 10 kHz from rest, the torque from 0.05 s on; white noise [rad rms] in the readings."""
    t = np.arange(10_001) * STEP
    run = pushed(card, np.where(t >= 0.05, torque, 0.0), "step")
    table = {name: run[name] for name in ("t", "tau", "q")}
    table["q"] = table["q"] + noise * np.random.default_rng(seed).standard_normal(len(table["q"]))
    return Recording("step", table, {name: run.units[name] for name in table if name in run.units})
