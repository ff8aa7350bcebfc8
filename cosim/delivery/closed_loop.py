"""Closed-loop proof: the recorded set point drives plant and controller FMUs; torque and position meet the recording.

Replaying a recorded torque diverges; a loop does not, and it is how the machine was recorded. Needs a card with a
controller and a recording with a set point.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim.data.own_rate import as_analysed
from cosim.data.recording import Recording
from cosim.estimation.filters import lowpass
from cosim.estimation.neighbours import as_inputs
from cosim.estimation.prepare import PROTOCOL_HZ, Array
from cosim.estimation.set_point import set_point
from cosim.master.simulate import simulate
from cosim.support.errors import StepError
from cosim.support.scratch import Scratch
from cosim.support.statistics import rms
from cosim.system.system import System
from cosim.system.wire import Record, Wire
from pyfmi_models.card import Card
from pyfmi_models.effects import ClockEffect
from pyfmi_models.export import export_fmu
from pyfmi_models.mount import Mount

LEAD, TAIL = 3.0, 0.5
AT_ONCE = 2
"""Loops that are closed beside each other."""


@dataclass(frozen=True)
class LoopError:
    """RMS between simulated and recorded torque [N m] and position [rad], low-passed, after the start has settled."""

    torque: float
    position: float


def close_loop(
    plant: Path,
    controller: Path,
    card: Card,
    recording: Recording,
    name: str = "simulated",
    reading: str = "q",
    inputs: Sequence[str] = (),
    asked: Mapping[str, Array] | None = None,
) -> Recording:
    """Simulate plant and controller FMUs under the recorded set point; rows at the recording's own rate.

    `reading` is the plant's output that was recorded as position, `inputs` name recorded columns that the plant reads,
    `asked` is the `set_point` where it is known already.
    """
    assert card.controller is not None
    step = 1 / card.controller.loop_hz
    decimation = max(1, round(recording.sample_time / step))
    signals = dict(asked or set_point(recording, step))
    given = {
        n: np.interp(recording.t[0] + step * np.arange(len(signals["q_d"])), recording.t, recording[n]) for n in inputs
    }
    start = {"position": float(signals["q_d"][0]), "speed": float(signals["v_d"][0])}
    system = System(
        components={"plant": plant, "controller": controller},
        wires=[
            *(Wire("controller.tau", "plant.tau"), Wire("plant.q", "controller.q")),
            *(Wire(n, f"controller.{n}") for n in signals),
            *(Wire(n, f"plant.{n}") for n in given),
        ],
        records={
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
    return simulate(system).recording


def compare(simulated: Recording, recording: Recording) -> LoopError:
    """RMS of the differences at the recording's rows, both sides low-passed alike."""
    count, dt = min(len(simulated), len(recording)), recording.sample_time
    inside = slice(int(LEAD / dt), count - int(TAIL / dt))
    both = {n: lowpass(simulated[n][:count] - recording[n][:count], dt, PROTOCOL_HZ)[inside] for n in ("tau", "q")}
    return LoopError(rms(both["tau"]), rms(both["q"]))


class Loops:
    """Models in the loop of a card's controller, over all recordings together, closed beside whatever else is done.

    C steps them, in threads. Nothing is closed without a controller in the card, or without set point and position in
    the recordings; a model that the controller cannot hold is left out.
    """

    def __init__(self, card: Card, recordings: Sequence[Recording]) -> None:
        able = card.controller is not None and all({"q", "q_d"} <= set(one.columns) for one in recordings)
        self._card, self._recordings = card, tuple(map(as_analysed, recordings)) if able else ()
        self._begun: dict[str, tuple[Mount, Future[list[Recording]]]] = {}

    def __enter__(self) -> "Loops":
        self._threads = ThreadPoolExecutor(AT_ONCE, "loop")
        self._folder = Scratch()
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(cancel_futures=True)
        self._folder.cleanup()

    def close(self, key: str, mount: Mount, plant: Path | None = None) -> None:
        """Begin to close a model's loop, if that is not done; `plant` is its FMU where there is one already."""
        if not self._recordings or key in self._begun:
            return
        for other, runs in self._begun.values():
            if other == mount:
                self._begun[key] = mount, runs
                return
        plant = plant or export_fmu(replace(mount.model(), name="plant"), Path(self._folder.name) / f"{key}.fmu")
        fmus = plant.absolute(), self._controller
        self._begun[key] = mount, self._threads.submit(self._runs, *fmus, mount, self._set_points)

    def runs(self, key: str) -> list[Recording]:
        """What a model did on each recording, none if the controller cannot hold it; waits for it."""
        try:
            return self._begun[key][1].result()
        except StepError:
            return []

    def errors(self) -> dict[str, LoopError]:
        """Errors of all models whose loops were closed."""
        runs = {key: self.runs(key) for key in self._begun}
        return {key: _together([*map(compare, some, self._recordings)]) for key, some in runs.items() if some}

    @cached_property
    def _controller(self) -> Path:
        return export_fmu(self._card.controller_model(), Path(self._folder.name) / "controller.fmu").absolute()

    @cached_property
    def _set_points(self) -> list[Future[dict[str, Array]]]:
        """Set points at every tick of the controller, the same for all models."""
        assert self._card.controller is not None
        step = 1 / self._card.controller.loop_hz
        return [self._threads.submit(set_point, one, step) for one in self._recordings]

    def _runs(
        self, plant: Path, controller: Path, mount: Mount, set_points: Sequence[Future[dict[str, Array]]]
    ) -> list[Recording]:
        reading = "q_recorded" if any(mount.of_kind(ClockEffect)) else "q"
        fed = [as_inputs(one, mount, PROTOCOL_HZ) for one in self._recordings]
        return [
            close_loop(
                *(plant, controller, self._card, one),
                reading=reading,
                inputs=[variable.name for variable in mount.inputs() if variable.name in one],
                asked=asked.result(),
            )
            for one, asked in zip(fed, set_points, strict=True)
        ]


def _together(errors: Sequence[LoopError]) -> LoopError:
    return LoopError(*(rms(np.array([getattr(e, name) for e in errors])) for name in ("torque", "position")))
