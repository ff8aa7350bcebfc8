"""One experiment of the paper: the sine at five times the speed of the stars, plant and controller as FMUs."""

from contextlib import closing
from dataclasses import dataclass
from math import pi

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording
from cosim.data.signals import Noise, Sine
from cosim.fmi.fmu import FmuComponent
from cosim.master.simulate import simulate
from cosim.support.statistics import rms
from cosim.system.system import System
from cosim.system.wire import Record, Wire
from cosim_studies.paper.workshop import Built

Floats = npt.NDArray[np.float64]
HORIZON = 15.0
"""Time after the smooth start over which errors count [s]."""
STARS = 7.268e-5
"""Speed of the stars [rad/s]."""
ARCSEC = pi / 180 / 3600
QUANTUM = 2 * pi / 2**32
"""Step of the 32-bit encoder [rad]."""
KEPT = 0.01
"""Time from one kept sample of a trace to the next [s], as fine as a figure shows."""
_MOTION = {"position": "q_d", "velocity": "v_d", "acceleration": "a_d"}
_TRACED = {
    "friction": "controller.friction_estimate",
    "zeta3": "controller.zeta3",
    "v_d": "reference.velocity",
    "v": "plant.v",
    "true_friction": "plant.friction",
}


@dataclass(frozen=True, kw_only=True)
class Job:
    """One run: plant, controller and its period [s], seconds of the reference's smooth start, noise and its seed.

    `run_in` [s] follows the smooth start and does not count either: time for a controller that learns. `position` is
    the plant's output whose error counts. `encoder_noise` [rad] and `torque_noise` [N m] are RMS values of white noise,
    a fresh sample each period.
    """

    plant: Built
    controller: Built
    period: float = 1e-4
    smooth_start: float = 2.5
    run_in: float = 0.0
    position: str = "q"
    encoder_noise: float = 0.0
    torque_noise: float = 0.0
    seed: int = 0
    tolerance: float | None = None
    traced: bool = False


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """ISE [arcsec^2 s], RMS of the command [N m], and where wanted curves every 10 ms.

    Curves: e [arcsec], torques [N m], zeta3 [rad/s2], speeds [rad/s].
    """

    ise: float
    torque: float
    trace: dict[str, Floats]


def run(job: Job) -> Outcome:
    """Run one experiment; its error is that of the true position, not of what the encoder reads."""
    record = {"q": f"plant.{job.position}", "q_d": "reference.position", "tau": "controller.tau"}
    reference = Sine(kind="sine", frequency=0.2, max_velocity=5 * STARS, smooth_start=job.smooth_start)
    before = job.smooth_start + job.run_in
    with closing(FmuComponent(job.plant.path, "plant", tolerance=job.tolerance)) as plant:
        system = System(
            components={"plant": plant, "controller": job.controller.path},
            wires=_wires(),
            records={name: Record(source) for name, source in (record | (_TRACED if job.traced else {})).items()},
            step=job.period,
            ticks=round((before + HORIZON) / job.period),
            signals={"reference": reference, **_noise(job)},
            parameters={"plant": job.plant.parameters, "controller": job.controller.parameters},
        )
        done = simulate(system).recording
    error = (np.asarray(done["q_d"]) - np.asarray(done["q"])) / ARCSEC
    first = round(before / job.period)
    ise = float(np.sum(error[first:] ** 2) * job.period)
    torque = rms(np.asarray(done["tau"])[first:])
    return Outcome(ise=ise, torque=torque, trace=_trace(job, done, error, first) if job.traced else {})


def _wires() -> list[Wire]:
    return [
        Wire("controller.tau", "plant.tau"),
        Wire("plant.q", "controller.q", quantum=QUANTUM, noise="reading"),
        Wire("torque", "plant.disturbance"),
        *(Wire(f"reference.{source}", f"controller.{target}") for source, target in _MOTION.items()),
    ]


def _noise(job: Job) -> dict[str, Noise]:
    """Noise from two streams of its own for each seed."""
    return {
        "reading": Noise(kind="noise", rms=job.encoder_noise, seed=2 * job.seed, unit="rad"),
        "torque": Noise(kind="noise", rms=job.torque_noise, seed=2 * job.seed + 1, unit="N.m"),
    }


def _trace(job: Job, done: Recording, error: Floats, first: int) -> dict[str, Floats]:
    curves = {name: np.asarray(done[name]) for name in (*_TRACED, "tau")}
    kept = slice(first, None, round(KEPT / job.period))
    return {name: curve[kept] for name, curve in {**curves, "e": error, "t": done.t - done.t[first]}.items()}
