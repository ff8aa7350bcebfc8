"""Closed-loop proof: the recorded set point drives plant and controller FMUs; torque and position meet the recording.

Replaying a recorded torque diverges; a loop does not, and it is how the machine was recorded. Needs a card with a
controller and a recording with a set point.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.interpolate import make_interp_spline

from cosim.diagnosis.prepare import Array, lowpass
from cosim.diagnosis.protocol import CUTOFF, rms
from cosim.errors import StepError
from cosim.master import simulate
from cosim.recording import Recording
from cosim.wiring import Record
from pyfmi_models.card import Card
from pyfmi_models.effects import ClockEffect
from pyfmi_models.export import export_fmu
from pyfmi_models.mount import Mount

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


def close_loop(
    plant: Path,
    controller: Path,
    card: Card,
    recording: Recording,
    name: str = "simulated",
    reading: str = "q",
    inputs: Sequence[str] = (),
) -> Recording:
    """Simulate plant and controller FMUs under the recorded set point; rows at the recording's own rate.

    `reading` is the plant's output that was recorded as position, `inputs` name recorded columns that the plant reads.
    """
    assert card.controller is not None
    step = 1 / card.controller.loop_hz
    decimation = max(1, round(recording.sample_time / step))
    signals = set_point(recording, step)
    given = {
        n: np.interp(recording.t[0] + step * np.arange(len(signals["q_d"])), recording.t, recording[n]) for n in inputs
    }
    start = {"position": float(signals["q_d"][0]), "speed": float(signals["v_d"][0])}
    run = simulate(
        {"plant": plant, "controller": controller},
        [
            *(("controller.tau", "plant.tau"), ("plant.q", "controller.q")),
            *((n, f"controller.{n}") for n in signals),
            *((n, f"plant.{n}") for n in given),
        ],
        record={
            "tau": Record("plant.tau", "mean"),
            "q": Record(f"plant.{reading}"),
            "q_d": Record("q_d"),
            "v": Record("plant.v"),
        },
        step=step,
        ticks=len(signals["q_d"]),
        signals=signals | given,
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
    return LoopError(rms(both["tau"]), rms(both["q"]))


def loop_errors(mounts: Mapping[str, Mount], card: Card, recordings: Sequence[Recording]) -> dict[str, LoopError]:
    """Errors of several models in the loop of a card's controller, over all recordings together.

    Empty without a controller in the card or without set point and position in the recordings; a model that the
    controller cannot hold is left out.
    """
    if card.controller is None or any(not {"q", "q_d"} <= set(recording.columns) for recording in recordings):
        return {}
    found = {}
    with TemporaryDirectory(prefix="cosim-loop-") as folder:
        controller = export_fmu(card.controller_model(), Path(folder) / "controller.fmu", fmi=3)
        for key, mount in mounts.items():
            plant = export_fmu(replace(mount.model(), name="plant"), Path(folder) / f"{key}.fmu", fmi=3)
            try:
                found[key] = _together([_error(plant, controller, card, mount, one) for one in recordings])
            except StepError:
                continue
    return found


def _error(plant: Path, controller: Path, card: Card, mount: Mount, recording: Recording) -> LoopError:
    inputs = [one.name for one in mount.inputs() if one.name in recording]
    reading = "q_recorded" if any(mount.of_kind(ClockEffect)) else "q"
    return compare(close_loop(plant, controller, card, recording, reading=reading, inputs=inputs), recording)


def _together(errors: Sequence[LoopError]) -> LoopError:
    return LoopError(*(rms(np.array([getattr(e, name) for e in errors])) for name in ("torque", "position")))
