"""Effects outside the list for which the diagnosis has no shape either: what they depend on it never regresses on.

run_in         friction that falls with the way travelled, whatever the time it took
sluggish_oil   viscous friction that waves with position: speed times position
dead_band      a drive that passes nothing below a threshold of its command
motor_ripple   a torque constant that waves with position: command times position
drive_fade     a drive that gives less when warm: command times temperature
payload_comes  a weight that is there from some moment on: position, but only then
ground         a floor that trembles now and then: noise between 2 and 10 Hz
vibration      a floor that always trembles, in a band of an octave or so between 2 and 10 Hz
wind           gusts: noise that is the weaker the faster, correlated over .2 to 1 s
"""

from collections.abc import Callable
from typing import Literal

import numpy as np

from cosim.support.statistics import rms
from cosim_studies.proof.families import Family, add_push, angle, goal
from cosim_studies.proof.simulated_axis import Parameters, SimulatedAxis, log_uniform
from cosim_studies.proof.truth import TICK, Array

Gate = Callable[[Array], Array]
"""How strong something is at each time, 0 to 1."""
Band = tuple[float | tuple[float, float], Literal["bandpass", "lowpass"]]
"""Edges of a filter [Hz], and what it passes."""


def run_in(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Dry contacts that polish themselves, and forget it over night."""
    way = float(np.abs(bench.training.v).mean()) * bench.pace.duration * float(rng.uniform(0.1, 0.3))
    bench.mount |= {"run_in": size * float(rng.uniform(0.6, 1.2)), "run_in_length": way}
    return {"relative": bench.mount["run_in"], "length": way}


def sluggish_oil(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A bearing that is tight at one side, in viscous friction only."""
    cycles = max(1, round(1 / (2 * bench.pace.amplitude * bench.turn / (2 * np.pi))))
    viscous = bench.mount["viscous"] = max(bench.mount["viscous"], 0.5 * bench.mount["coulomb"] / bench.pace.speed)
    bench.belief["friction"]["sigma2"] = viscous
    swing = min(0.95, 2.5 * goal(bench, rng, size) / (viscous * rms(bench.training.v)))
    bench.mount |= {"viscous_swing": swing, "viscous_cycles": bench.turn * cycles, "viscous_phase": angle(rng)}
    return {"relative": swing, "cycles_per_rev": cycles}


def dead_band(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A bridge that does not switch for small commands."""
    bench.mount["dead_band"] = 1.5 * goal(bench, rng, size)
    return {"torque": bench.mount["dead_band"]}


def motor_ripple(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Magnets of unequal strength."""
    felt = rms(bench.mount["inertia"] * bench.training.a) + bench.friction_rms
    swing = min(0.5, 2 * goal(bench, rng, size) / felt)
    cycles = round(log_uniform(rng, 2, 12) * max(1.0, np.pi / (bench.turn * bench.pace.amplitude)))
    bench.mount |= {"gain_swing": swing, "gain_cycles": bench.turn * cycles, "gain_phase": angle(rng)}
    return {"relative": swing, "cycles_per_rev": cycles}


def drive_fade(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Copper and magnets lose with temperature; here the whole drive follows the bearing's."""
    bench.mount["gain_fade"] = -size * float(rng.uniform(0.02, 0.04))
    bench.shows_temperature = bool(rng.random() < 0.7)
    return {"per_degC": bench.mount["gain_fade"]}


def payload_comes(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Somebody hangs a weight onto it while it is recorded."""
    phase, when = angle(rng), bench.pace.duration * float(rng.uniform(0.3, 0.7))
    shape = rms(np.sin(bench.training.q + phase))
    bench.mount |= {"shift": 2.5 * goal(bench, rng, size) / shape, "shift_phase": phase, "shift_time": when}
    return {"mgl": bench.mount["shift"], "phase": phase, "after_s": when}


def ground(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Bursts of a trembling floor: a torque through the unbalance of whatever the axis carries."""
    low = float(rng.uniform(2, 4))
    high = low * float(rng.uniform(1.5, 2.5))
    strength = 2.5 * goal(bench, rng, size)
    _shake(bench, rng, strength, ((low, high), "bandpass"), lambda t: _gates(rng, t))
    return {"torque_rms": strength, "from_hz": low}


def vibration(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A floor that always trembles: a torque of random phase in a band."""
    low = float(rng.uniform(2, 4))
    high = low * float(rng.uniform(1.5, 2.5))
    strength = 1.5 * goal(bench, rng, size)
    _shake(bench, rng, strength, ((low, high), "bandpass"))
    return {"torque_rms": strength, "from_hz": low, "to_hz": high}


def wind(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Gusts on whatever the axis carries: noise behind a lag of second order."""
    correlation = float(rng.uniform(0.2, 1.0))
    strength = 1.5 * goal(bench, rng, size)
    _shake(bench, rng, strength, (1 / (2 * np.pi * correlation), "lowpass"))
    return {"torque_rms": strength, "correlation_s": correlation}


def _always(t: Array) -> Array:
    return np.ones_like(t)


def _shake(bench: SimulatedAxis, rng: np.random.Generator, strength: float, band: Band, gate: Gate = _always) -> None:
    """Add filtered noise to each recording, of the strength where the gate is 1."""
    from scipy.signal import butter, sosfilt  # nearly a second that machines on a quiet floor do not need

    edges, kind = band
    shape = butter(2, edges, kind, fs=1 / TICK, output="sos")

    def push(_: str, t: Array) -> Array:
        noise = np.asarray(sosfilt(shape, rng.standard_normal(t.size)))
        return np.asarray(strength * (noise / (noise.std() + 1e-300)) * gate(t))

    add_push(bench, push)


def _gates(rng: np.random.Generator, t: Array) -> Array:
    return np.asarray(np.sum([np.exp(-(((t - c) / w) ** 2)) for c, w in _bursts(rng, t[-1])], axis=0))


def _bursts(rng: np.random.Generator, end: float) -> list[tuple[float, float]]:
    return [(float(rng.uniform(0.1, 0.9)) * end, end * float(rng.uniform(0.03, 0.08))) for _ in range(3)]


_ALL: tuple[Family, ...] = (
    run_in,
    sluggish_oil,
    dead_band,
    motor_ripple,
    drive_fade,
    payload_comes,
    ground,
    vibration,
    wind,
)

SHAPELESS = {family.__name__: family for family in _ALL}
