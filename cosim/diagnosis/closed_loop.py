"""Closed-loop proof: the recorded set point drives plant and controller FMUs; torque and position meet the recording.

Replaying a recorded torque diverges; a loop does not, and it is how the machine was recorded. Needs a card with a
controller and a recording with a set point.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.interpolate import make_interp_spline

from cosim.diagnosis.prepare import Array, lowpass
from cosim.diagnosis.protocol import CUTOFF
from cosim.master import simulate
from cosim.recording import Recording
from cosim.wiring import Record
from pyfmi_models.card import Card
from pyfmi_models.export import export_fmu

LEAD, TAIL = 3.0, 0.5


@dataclass(frozen=True)
class LoopError:
    """RMS between simulated and recorded torque [N m] and position [rad], low-passed, after the start has settled."""

    torque: float
    position: float


def can_close(card: Card, recording: Recording) -> bool:
    """Whether the loop can be closed: controller known, set point recorded without gaps."""
    return card.controller is not None and {"q", "q_d"} <= set(recording.columns) and not recording.gaps


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


def loop_errors(
    cards: dict[str, Card], recording: Recording, say: Callable[[str], None] = lambda _: None
) -> dict[str, LoopError]:
    """Close the loop with the plant of each card (FMUs are built as needed), the controller always the first card's."""
    first = next(iter(cards.values()))
    with TemporaryDirectory() as folder:
        controller = export_fmu(first.controller_model(), Path(folder) / "controller.fmu", fmi=3)
        found = {}
        for name, card in cards.items():
            say(f"closing the loop: {name}")
            plant = export_fmu(card.plant().model(), Path(folder) / f"{name}.fmu", fmi=3)
            found[name] = compare(close_loop(plant, controller, first, recording), recording)
    return found
