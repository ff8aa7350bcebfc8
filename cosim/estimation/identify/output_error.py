"""Output error: simulate what was recorded, and choose the parameters whose simulation fits.

In closed loop the recorded set point drives plant and controller, so noise that the controller fed back is not taken
for physics; in open loop (a presliding step) the recorded torque drives the plant from rest.
Reference: Ljung, System Identification, 2nd ed. (1999), chapters 7 and 13.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from cosim.data.held import held_columns
from cosim.data.own_rate import at_own_rate
from cosim.data.recording import Recording
from cosim.estimation.identify.estimate import Array, Estimate, Model, Outputs, explore, settle
from cosim.estimation.identify.machine import Machine
from cosim.estimation.set_point import set_point
from cosim.support.errors import InputError
from pyfmi_models.card import Card

SETTLED = 1.0
"""Seconds at the start of a closed-loop recording that are simulated but not compared: friction forgets its state."""
LOOK = 25
"""Simulations that a start is given before the best is chosen."""
FACTOR = 2.0
"""Random starts differ from the first by up to this factor."""


@dataclass(frozen=True)
class Replay:
    """One recording made ready: the reference of every tick, the start, and the measured rows to compare."""

    reference: Array
    start: dict[str, float]
    times: Array
    measured: Array
    sample_time: float

    def residual(self, machine: Machine, values: Array) -> Outputs:
        """Measured minus simulated at the rows of the recording; under a given torque there is only the position."""
        y = machine.simulate(values, self.reference, self.start)
        at = _sampled(y, machine.tick, self.times, self.sample_time)
        compared = slice(0, 1) if machine.controller is None else slice(0, 2)
        return Outputs(self.measured[:, compared] - at[:, compared, 0], at[:, compared, 1:])


def _sampled(y: Array, tick: float, times: Array, width: float) -> Array:
    """Position at the times, torque as its mean over the sample interval around them, (rows, 2, n).

    `y` is (ticks, n, 2): position and torque.
    """
    at = times / tick
    low = np.minimum(np.floor(at + 1e-6).astype(np.int64), len(y) - 2)
    share = np.clip(at - low, 0, 1)[:, None]
    q = (1 - share) * y[low, :, 0] + share * y[low + 1, :, 0]
    total = np.zeros((len(y) + 1, y.shape[1]))
    np.cumsum(y[:, :, 1], axis=0, out=total[1:])
    edges = [np.clip(at + side * width / tick / 2, 0, len(y)) for side in (-1, 1)]
    below = [np.minimum(np.floor(edge).astype(np.int64), len(y) - 1) for edge in edges]
    sums = [total[k] + (edge - k)[:, None] * y[k, :, 1] for k, edge in zip(below, edges, strict=True)]
    return np.stack([q, (sums[1] - sums[0]) / np.maximum(edges[1] - edges[0], 1e-9)[:, None]], axis=1)


def closed_loop(card: Card, free: Sequence[str]) -> Machine:
    """The card's plant under its controller."""
    if card.controller is None:
        raise InputError(f"{card.path}: without a [controller] section there is no closed loop to simulate.")
    return Machine(card.plant().model(), card.controller_model(), tuple(free), 1 / card.controller.loop_hz)


def replay_of(machine: Machine, recording: Recording) -> Replay:
    """Make a recording ready for a machine.

    What drives it is taken from all rows. What is compared are rows in which both readings are new: a reading that is
    repeated is late.
    """
    new = at_own_rate(recording)
    t = new.t - recording.t[0]
    if machine.controller is None:
        # From rest at position zero (see `presliding`): the first reading is one sample of noise.
        drives = recording if "tau" not in held_columns(recording.table) else new
        reference, start = _torque(machine, drives), dict[str, float]()
        inside = t <= (len(reference) - 1) * machine.tick
    else:
        signals = set_point(recording, machine.tick)
        reference = np.column_stack(list(signals.values()))
        start = {"position": float(recording["q"][0]), "speed": float(signals["v_d"][0])}
        inside = (t >= SETTLED) & (t <= (len(reference) - 2) * machine.tick)
    measured = np.column_stack([new["q"], new["tau"]])[inside]
    return Replay(reference, start, t[inside], measured, new.sample_time)


def _torque(machine: Machine, recording: Recording) -> Array:
    """Torque of every tick: that of the row whose interval, centred at its time, the tick lies in."""
    t = recording.t - recording.t[0]
    middles = (np.arange(round(t[-1] / machine.tick)) + 0.5) * machine.tick
    rows = np.searchsorted(t - recording.sample_time / 2, middles, side="right") - 1
    return np.asarray(recording["tau"][rows][:, None])


def output_model(machine: Machine, recordings: Sequence[Recording]) -> Model:
    """Residuals of all recordings, one after the other."""
    replays = [replay_of(machine, recording) for recording in recordings]

    def model(values: Array) -> Outputs:
        parts = [replay.residual(machine, values) for replay in replays]
        return Outputs(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("residual", "slopes")))

    return model


def fit_outputs(
    machine: Machine,
    recordings: Sequence[Recording],
    starts: int = 1,
    seed: int = 0,
    on_progress: Callable[[str], None] = lambda _: None,
) -> list[Estimate]:
    """Fit from the plant's own numbers and from `starts` - 1 random ones up to `FACTOR` off; the best estimate first.

    Every start is followed until it moves by a thousandth; only the best is then settled to the last digit.

    Raises:
        InputError: a free number is not positive.
    """
    model, own = output_model(machine, recordings), machine.numbers[machine.places]
    if np.any(own <= 0):
        name = machine.free[int(np.argmin(own))]
        raise InputError(f"{name} = {own.min():g} cannot be identified: output error searches positive numbers.")
    limits = np.array(
        [(variable.low, variable.high) for variable in (machine.plant.parameters[k] for k in machine.places)]
    )
    rng = np.random.default_rng(seed)
    factors = [np.ones_like(own), *(FACTOR ** rng.uniform(-1, 1, len(own)) for _ in range(starts - 1))]

    def one(number: int) -> Estimate:
        found = explore(machine.free, own * factors[number - 1], model, limits, LOOK)
        on_progress(f"output error, start {number} of {starts}: {_summary(found)}")
        return found

    with ThreadPoolExecutor(max_workers=2) as pool:
        looked = sorted(pool.map(one, range(1, starts + 1)), key=_size)
    best = settle(looked[0], model, limits)
    on_progress(f"output error, best start settled: {_summary(best)}")
    return [best, *looked[1:]]


def _size(found: Estimate) -> float:
    return float(np.sum(np.log(found.rms)))


def _summary(found: Estimate) -> str:
    return f"{found.evaluations} simulations, RMS {', '.join(f'{value:.3g}' for value in found.rms)}"
