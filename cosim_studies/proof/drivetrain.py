"""Effects to conceal between command, mass and reading: drive, second mass, encoder, clocks.

Contract between these functions and a bench, and the meaning of `size`: see `families.py`.
"""

import numpy as np

from cosim.support.statistics import rms
from cosim_studies.proof.families import Family, angle, goal, signed
from cosim_studies.proof.motion import Motion
from cosim_studies.proof.simulated_axis import Parameters, SimulatedAxis, log_uniform
from cosim_studies.proof.truth import Array


def compliance(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Part of the inertia hangs on a spring; encoder and friction stay on the motor side."""
    total, hertz = bench.mount["inertia"], log_uniform(rng, 8, 40)
    share = min(0.7, size * float(rng.uniform(0.3, 0.5)))
    load, spring = share * total, share * total * (2 * np.pi * hertz) ** 2
    damping = 2 * float(rng.uniform(0.01, 0.04)) * np.sqrt(spring * load)
    bench.mount |= {"inertia": total - load, "load_inertia": load, "drive_stiffness": spring, "drive_damping": damping}
    return {"antiresonance_hz": hertz, "resonance_hz": hertz / np.sqrt(1 - share), "load_share": share}


def actuator_lag(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """The drive follows its command late and softly."""
    bench.mount["lag"] = size * float(rng.uniform(4e-3, 10e-3))
    return {"time_constant_ms": 1e3 * bench.mount["lag"]}


def delay(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """The command arrives late, unchanged."""
    bench.mount["delay"] = round(size * float(rng.uniform(3e-3, 8e-3)), 5)
    return {"delay_ms": 1e3 * bench.mount["delay"]}


def backlash(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Load and motor meet only at the ends of a gap."""
    total, gap = bench.mount["inertia"], size * log_uniform(rng, 3e-4, 1.5e-3)
    if bench.setup:
        gap *= bench.pace.amplitude
    felt = bench.friction_rms / total / rms(bench.training.a)
    load = float(np.clip(rng.uniform(0.6, 1.2) * felt, 0.12, 0.5)) * total
    spring = load * (2 * np.pi * (log_uniform(rng, 10, 60) if bench.setup else float(rng.uniform(25, 50)))) ** 2
    dry = float(rng.uniform(0.1, 0.25)) * bench.mount["coulomb"]
    bench.mount |= {"inertia": total - load, "load_inertia": load, "gap": gap, "drive_stiffness": spring}
    bench.mount |= {
        "drive_damping": 1.5 * np.sqrt(spring * load),
        "load_friction": dry,
        "load_stiffness": dry / (0.4 * gap if bench.setup else 2e-4),
    }
    bench.mount["load_viscous"] = 0.2 * bench.mount["viscous"]
    return {"gap_rad": gap, "load_share": load / total}


def encoder_eccentricity(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A disc off centre: the reading errs once and twice per encoder turn, felt as torque ~ J A (n v)^2."""
    v2 = rms(bench.training.v**2)
    v2 *= bench.turn**2
    amplitude, wanted = log_uniform(rng, 1e-4, 1e-3), 2 * goal(bench, rng, size) / bench.mount["inertia"]
    cycles = int(np.clip(round(np.sqrt(wanted / (amplitude * v2))), 4, 64))
    amplitude = float(np.clip(wanted / (v2 * cycles**2), 5e-5 * size, 2e-3))
    phase, second = angle(rng), float(rng.uniform(0, 0.2))
    bench.mount |= {"ripple_cycles": bench.turn * cycles, "ripple_phase": phase}
    bench.mount |= {"ripple_1": amplitude, "ripple_2": second * amplitude}
    quantum = 2 * np.pi / bench.belief["encoder"]["counts_per_rev"] / bench.belief["encoder"]["ratio"]
    bench.belief["encoder"] |= {"ratio": cycles, "counts_per_rev": max(1, round(2 * np.pi / quantum / cycles))}
    return {"cycles_per_rev": cycles, "amplitude_rad": amplitude, "phase": phase, "second": second}


def _expected_torque(bench: SimulatedAxis, motion: Motion) -> Array:
    """Size of the torque that inertia and friction need once the soft start is over."""
    mount, (_, v, a) = bench.mount, (part[25_000:] for part in motion)
    return np.asarray(np.abs(mount["inertia"] * a + mount["coulomb"] * np.sign(v) + mount["viscous"] * v))


def torque_saturation(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """The drive gives less than asked for at high torque."""
    mount, slope = bench.mount, float(rng.uniform(0.3, 0.6))
    *train, heldout = (float(np.quantile(_expected_torque(bench, motion), 0.98)) for motion in bench.motions.values())
    peak = min(max(train), heldout)
    mount |= {"knee": peak * (1 - min(0.7, size * float(rng.uniform(0.15, 0.3)))), "knee_slope": slope}
    return {"knee_torque": mount["knee"], "slope": slope}


def clock_skew(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Two clocks: the reading runs ahead of (or behind) the torque, by a constant or ever more."""
    bench.clock["offset_ms"] = size * signed(rng, 3, 8)
    if rng.random() < 0.5:
        bench.clock["drift_ppm"] = size * signed(rng, 80, 200)
    return dict(bench.clock)


_ALL: tuple[Family, ...] = (
    *(compliance, actuator_lag, delay, backlash, encoder_eccentricity, torque_saturation, clock_skew),
)

BETWEEN_COMMAND_AND_READING = {family.__name__: family for family in _ALL}
