"""Effects to conceal: each function writes one into a bench and returns its true parameters.

Names and parameters are those of the contract; the physics itself is in `truth.c`. `size` 1 means about a quarter of
the friction torque (root mean square over the training motions) or, for effects of timing and mechanics, a value in the
middle of what is met on mounts; 0.3 is weak. Effects outside the contract's list are in `outside.py`.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from cosim.proof.bench import Bench, log_uniform, root_mean_square
from cosim.proof.truth import Array, ticks

Parameters = dict[str, Any]
Family = Callable[[Bench, np.random.Generator, float], Parameters]


def goal(bench: Bench, rng: np.random.Generator, size: float) -> float:
    """Torque [N m rms] that an effect of this size contributes."""
    return size * float(rng.uniform(0.18, 0.28)) * bench.friction_rms


def angle(rng: np.random.Generator) -> float:
    """Any phase."""
    return float(rng.uniform(-np.pi, np.pi))


def signed(rng: np.random.Generator, low: float, high: float) -> float:
    """A magnitude between low and high, of either sign."""
    return float(rng.choice([-1, 1]) * rng.uniform(low, high))


def add_push(bench: Bench, torque: Callable[[str, Array], Array]) -> None:
    """Add a resisting torque, a function of recording and time, to every recording."""
    for name, drive in bench.drives.items():
        bench.drives[name] = replace(drive, push=drive.push + torque(name, ticks(drive.push.size)))


def friction_asymmetry(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Harder one way than the other."""
    level, viscous = size * signed(rng, 0.18, 0.3), size * signed(rng, 0.05, 0.3)
    bench.mount |= {"level_asymmetry": level, "viscous_asymmetry": viscous}
    return {"level_asymmetry": level, "viscous_asymmetry": viscous}


def stribeck(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Break-away above the Coulomb level; the card knows only the latter."""
    mount = bench.mount
    breakaway = mount["coulomb"] * (1 + size * float(rng.uniform(0.6, 1.1)))
    speed = bench.pace.speed * log_uniform(rng, 0.08, 0.25)
    mount |= {"breakaway": breakaway, "stribeck_speed": speed}
    bench.belief["friction"] |= {"Fs": mount["coulomb"], "Vs": speed}
    return {"Fs": breakaway, "Vs": speed, "delta": mount["stribeck_power"]}


def presliding(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """A soft contact that springs back; the card holds a static law."""
    mount = bench.mount
    reach = size * log_uniform(rng, 1e-3, 4e-3) * bench.pace.amplitude
    softer = mount["breakaway"] / reach / mount["stiffness"]
    mount |= {"stiffness": mount["stiffness"] * softer, "block_reach": mount["block_reach"] / softer}
    mount["damping"] *= np.sqrt(softer)
    static = ("Fc", "Fs", "Vs", "delta", "sigma2")
    old = bench.belief["friction"]
    bench.belief["friction"] = {"model": "static", **{key: old[key] for key in static}}
    return {"sigma0": mount["stiffness"]}


def cogging(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Magnets: a torque over position that does not care about speed."""
    cycles, phase = int(rng.integers(8, 73)), angle(rng)
    second, third = (0.0, 0.0) if rng.random() < 0.5 else (float(rng.uniform(0.2, 0.5)), float(rng.uniform(0, 0.25)))
    fundamental = goal(bench, rng, size) / np.sqrt((1 + second**2 + third**2) / 2)
    bench.mount |= {"cogging_cycles": cycles, "cogging_phase": phase, "cogging_1": fundamental}
    bench.mount |= {"cogging_2": second * fundamental, "cogging_3": third * fundamental}
    x = np.linspace(0, 2 * np.pi, 2000)
    wave = fundamental * (np.sin(x) + second * np.sin(2 * x) + third * np.sin(3 * x))
    shape = {"cycles_per_rev": cycles, "amplitude": float(np.ptp(wave)) / 2, "phase": phase}
    return shape | {"harmonics": [second, third], "fundamental": fundamental}


def position_friction(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """A level that waves with position, or one rough spot."""
    if rng.random() < 0.5:
        return _rough_spot(bench, rng, size)
    cycles = int(rng.integers(1, 7)) * max(1, round(0.5 / bench.pace.amplitude))
    relative, phase = size * float(rng.uniform(0.3, 0.45)), angle(rng)
    bench.mount |= {"rough_relative": relative, "rough_cycles": cycles, "rough_phase": phase}
    return {"cycles_per_rev": cycles, "relative_amplitude": relative, "phase": phase}


def _rough_spot(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    center = bench.pace.home + bench.pace.amplitude * float(rng.uniform(-0.5, 0.5))
    width, relative = bench.pace.amplitude * float(rng.uniform(0.06, 0.15)), size * float(rng.uniform(0.7, 1.2))
    bench.mount |= {"spot_relative": relative, "spot_center": center, "spot_width": width}
    where = {"axis": "position", "regions": [[center - 2 * width, center + 2 * width]]}
    return {"q_center": center, "relative_amplitude": relative, "width": width, "where": where}


def gravity_unbalance(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """A weight that was not balanced."""
    phase = angle(rng)
    mgl = 1.3 * goal(bench, rng, size) / root_mean_square(np.sin(bench.training.q + phase))
    bench.mount |= {"unbalance": mgl, "unbalance_phase": phase}
    return {"mgl": mgl, "phase": phase}


def torque_offset(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """A constant pull."""
    bench.mount["offset"] = float(rng.choice([-1, 1])) * goal(bench, rng, size)
    return {"torque": bench.mount["offset"]}


def thermal_viscosity(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Grease that thins as it warms up."""
    viscous, level = -size * float(rng.uniform(0.03, 0.06)), -size * float(rng.uniform(0.02, 0.035))
    bench.mount |= {"thermal_viscous": viscous, "thermal_level": level}
    bench.mount["viscous"] *= 1.5
    bench.belief["friction"]["sigma2"] *= 1.5
    bench.shows_temperature = bool(rng.random() < 0.75)
    return {"viscous_per_degC": viscous, "coulomb_per_degC": level}


def dwell_breakaway(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Contacts that settle while the axis rests."""
    torque = size * float(rng.uniform(0.12, 0.2)) * bench.mount["coulomb"]
    onset, memory = log_uniform(rng, 0.05, 0.2), bench.pace.amplitude * log_uniform(rng, 2e-3, 1e-2)
    bench.mount |= {"dwell_torque": torque, "dwell_time": onset, "dwell_length": memory}
    return {"torque_per_efold": torque, "onset_s": onset, "memory_rad": memory}


def compliance(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Part of the inertia hangs on a spring; encoder and friction stay on the motor side."""
    total, hertz = bench.mount["inertia"], log_uniform(rng, 8, 40)
    share = min(0.7, size * float(rng.uniform(0.3, 0.5)))
    load, spring = share * total, share * total * (2 * np.pi * hertz) ** 2
    damping = 2 * float(rng.uniform(0.01, 0.04)) * np.sqrt(spring * load)
    bench.mount |= {"inertia": total - load, "load_inertia": load, "drive_stiffness": spring, "drive_damping": damping}
    return {"antiresonance_hz": hertz, "resonance_hz": hertz / np.sqrt(1 - share), "load_share": share}


def actuator_lag(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """The drive follows its command late and softly."""
    bench.mount["lag"] = size * float(rng.uniform(4e-3, 10e-3))
    return {"time_constant_ms": 1e3 * bench.mount["lag"]}


def delay(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """The command arrives late, unchanged."""
    bench.mount["delay"] = round(size * float(rng.uniform(3e-3, 8e-3)), 5)
    return {"delay_ms": 1e3 * bench.mount["delay"]}


def backlash(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Load and motor meet only at the ends of a gap."""
    total, gap = bench.mount["inertia"], size * log_uniform(rng, 3e-4, 1.5e-3)
    felt = bench.friction_rms / total / root_mean_square(bench.training.a)
    load = float(np.clip(rng.uniform(0.6, 1.2) * felt, 0.12, 0.5)) * total
    spring = load * (2 * np.pi * float(rng.uniform(25, 50))) ** 2
    dry = float(rng.uniform(0.1, 0.25)) * bench.mount["coulomb"]
    bench.mount |= {"inertia": total - load, "load_inertia": load, "gap": gap, "drive_stiffness": spring}
    bench.mount |= {"drive_damping": 1.5 * np.sqrt(spring * load), "load_friction": dry, "load_stiffness": dry / 2e-4}
    bench.mount["load_viscous"] = 0.2 * bench.mount["viscous"]
    return {"gap_rad": gap, "load_share": load / total}


def encoder_eccentricity(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """A disc off centre: the reading errs once and twice per encoder turn, felt as torque ~ J A (n v)^2."""
    v2 = root_mean_square(bench.training.v**2)
    amplitude, wanted = log_uniform(rng, 1e-4, 1e-3), 2 * goal(bench, rng, size) / bench.mount["inertia"]
    cycles = int(np.clip(round(np.sqrt(wanted / (amplitude * v2))), 4, 64))
    amplitude = float(np.clip(wanted / (v2 * cycles**2), 5e-5 * size, 2e-3))
    phase, second = angle(rng), float(rng.uniform(0, 0.2))
    bench.mount |= {"ripple_cycles": cycles, "ripple_phase": phase}
    bench.mount |= {"ripple_1": amplitude, "ripple_2": second * amplitude}
    quantum = 2 * np.pi / bench.belief["encoder"]["counts_per_rev"] / bench.belief["encoder"]["ratio"]
    bench.belief["encoder"] |= {"ratio": cycles, "counts_per_rev": max(1, round(2 * np.pi / quantum / cycles))}
    return {"cycles_per_rev": cycles, "amplitude_rad": amplitude, "phase": phase, "second": second}


def quadratic_drag(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Wind of its own making."""
    bench.mount["quadratic"] = 1.3 * goal(bench, rng, size) / root_mean_square(bench.training.v**2)
    return {"coefficient": bench.mount["quadratic"]}


def cable_wrap(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """A cable that pulls towards home, harder when far."""
    home = bench.pace.home + bench.pace.amplitude * float(rng.uniform(-0.3, 0.3))
    hardening = 0.0 if rng.random() < 0.5 else float(rng.uniform(0.3, 1.5)) / bench.pace.amplitude**2
    x = bench.training.q - home
    stiffness = 1.2 * goal(bench, rng, size) / root_mean_square(x * (1 + hardening * x**2))
    bench.mount |= {"cable": stiffness, "cable_home": home, "cable_hardening": hardening}
    return {"stiffness": stiffness, "home": home, "hardening": hardening}


def inertia_variation(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Inertia that changes with position."""
    cycles = 2 if bench.pace.amplitude < 1 else int(rng.integers(1, 3))
    phase = angle(rng)
    shape = np.cos(cycles * bench.training.q + phase)
    felt = bench.mount["inertia"] * root_mean_square((shape - shape.mean()) * bench.training.a)
    relative = min(0.5, 1.2 * goal(bench, rng, size) / felt)
    bench.mount |= {"inertia_swing": relative, "inertia_cycles": cycles, "inertia_phase": phase}
    return {"relative_amplitude": relative, "cycles_per_rev": cycles, "phase": phase}


def load_dependent_friction(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """A known payload presses on the bearing."""
    phase = -bench.pace.home + float(rng.choice([0.0, np.pi])) + float(rng.uniform(-0.4, 0.4))
    shape = root_mean_square(np.sin(bench.training.q + phase))
    mgl, share = float(rng.uniform(1.0, 2.0)) * bench.friction_rms / shape, size * float(rng.uniform(0.25, 0.4))
    bench.mount |= {"payload": mgl, "payload_phase": phase}
    bench.belief["unbalance"] = {"mgl": mgl, "phase": phase}
    bench.mount["load_sensitivity"] = share * bench.friction_rms / (mgl * shape)
    return {"coulomb_per_Nm": bench.mount["load_sensitivity"]}


def torque_saturation(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """The drive gives less than asked for at high torque."""
    mount, motion = bench.mount, bench.training
    torque = np.abs(mount["inertia"] * motion.a + mount["coulomb"] * np.sign(motion.v) + mount["viscous"] * motion.v)
    peak, slope = float(np.quantile(torque, 0.998)), float(rng.uniform(0.2, 0.5))
    mount |= {"knee": peak * (1 - min(0.7, size * float(rng.uniform(0.3, 0.45)))), "knee_slope": slope}
    return {"knee_torque": mount["knee"], "slope": slope}


def periodic_disturbance(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """A machine next door."""
    hertz, amplitude = log_uniform(rng, 0.7, 15), np.sqrt(2) * goal(bench, rng, size)
    phases = {name: angle(rng) for name in bench.drives}
    add_push(bench, lambda name, t: amplitude * np.sin(2 * np.pi * hertz * t + phases[name]))
    return {"frequency_hz": hertz, "amplitude": float(amplitude), "phases": phases}


def clock_skew(bench: Bench, rng: np.random.Generator, size: float) -> Parameters:
    """Two clocks: the reading runs ahead of (or behind) the torque, by a constant or ever more."""
    bench.clock["offset_ms"] = size * signed(rng, 3, 8)
    if rng.random() < 0.5:
        bench.clock["drift_ppm"] = size * signed(rng, 80, 200)
    return dict(bench.clock)


_LISTED: tuple[Family, ...] = (
    *(friction_asymmetry, stribeck, presliding, cogging, position_friction, gravity_unbalance, torque_offset),
    *(thermal_viscosity, dwell_breakaway, compliance, actuator_lag, delay, backlash, encoder_eccentricity),
    *(quadratic_drag, cable_wrap, inertia_variation, load_dependent_friction, torque_saturation),
    *(periodic_disturbance, clock_skew),
)

LISTED_EFFECTS = {family.__name__: family for family in _LISTED}
