"""Closed-loop proof: the recorded set point drives plant and controller FMUs; torque and position meet the recording.

Replaying a recorded torque diverges; a loop does not, and it is how the machine was recorded. Needs a card with a
controller and a recording with a set point.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline

from cosim.diagnosis.prepare import Array, lowpass
from cosim.diagnosis.protocol import CUTOFF
from cosim.master import simulate
from cosim.recording import Recording
from cosim.wiring import Record
from pyfmi_models.card import Card

LEAD, TAIL = 3.0, 0.5


@dataclass(frozen=True)
class LoopError:
    """RMS between simulated and recorded torque [N m] and position [rad], low-passed, after the start has settled."""

    torque: float
    position: float


def set_point(recording: Recording, step: float) -> dict[str, Array]:
    """Set point at every tick from a recorded one: a quintic spline, so that its acceleration is smooth."""
    spline = make_interp_spline(recording.t, recording["q_d"], k=5)
    t = recording.t[0] + step * np.arange(int(np.floor(recording.duration / step)))
    return {"q_d": spline(t), "v_d": spline(t, 1), "a_d": spline(t, 2)}


def close_loop(plant: Path, controller: Path, card: Card, recording: Recording, name: str = "simulated") -> Recording:
    """Simulate plant and controller FMUs under the recorded set point; rows at the recording's own rate."""
    assert card.controller is not None
    step = 1 / card.controller.loop_hz
    decimation = max(1, round(recording.sample_time / step))
    signals = set_point(recording, step)
    start = {"position": float(signals["q_d"][0]), "speed": float(signals["v_d"][0])}
    run = simulate(
        {"plant": plant, "controller": controller},
        [("controller.tau", "plant.tau"), ("plant.q", "controller.q"), *((n, f"controller.{n}") for n in signals)],
        record={
            "tau": Record("plant.tau", "mean"),
            "q": Record("plant.q"),
            "q_d": Record("q_d"),
            "v": Record("plant.v"),
        },
        step=step,
        ticks=len(signals["q_d"]),
        signals=signals,
        parameters={"plant": start},
        decimation=decimation,
        name=name,
    )
    assert run.recording is not None
    return run.recording


def compare(simulated: Recording, recording: Recording) -> LoopError:
    """RMS of the differences at the recording's rows, both sides low-passed alike."""
    count, dt = min(len(simulated), len(recording)), recording.sample_time
    inside = slice(int(LEAD / dt), count - int(TAIL / dt))
    both = {n: lowpass(simulated[n][:count] - recording[n][:count], dt, CUTOFF)[inside] for n in ("tau", "q")}
    return LoopError(*(float(np.sqrt(np.mean(both[name] ** 2))) for name in ("tau", "q")))
