"""Effects to conceal: each function writes one into a bench and returns its true parameters.

Names and parameters are those of the contract; the physics itself is in `truth.c`. `size` 1 means about a quarter of
the friction torque (root mean square over the training motions) or, for effects of timing and mechanics, a value in the
middle of what is met on mounts; 0.3 is weak. Waves over position have `bench.turn` times their cycles in `truth.c`.
Effects of drive, sensor and clock are in `drivetrain.py`, those outside the contract's list in `outside.py`.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cosim.support.statistics import rms
from cosim_studies.proof.simulated_axis import Parameters, SimulatedAxis, log_uniform
from cosim_studies.proof.truth import Array, ticks

Family = Callable[[SimulatedAxis, np.random.Generator, float], Parameters]


def goal(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> float:
    """Torque [N m rms] that an effect of this size contributes."""
    return size * float(rng.uniform(0.18, 0.28)) * bench.friction_rms


def angle(rng: np.random.Generator) -> float:
    """Any phase."""
    return float(rng.uniform(-np.pi, np.pi))


def signed(rng: np.random.Generator, low: float, high: float) -> float:
    """A magnitude between low and high, of either sign."""
    return float(rng.choice([-1, 1]) * rng.uniform(low, high))


def add_push(bench: SimulatedAxis, torque: Callable[[str, Array], Array]) -> None:
    """Add a resisting torque, a function of recording and time, to every recording."""
    for name, drive in bench.drives.items():
        bench.drives[name] = replace(drive, push=drive.push + torque(name, ticks(drive.push.size)))


def friction_asymmetry(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Harder one way than the other."""
    level, viscous = size * signed(rng, 0.18, 0.3), size * signed(rng, 0.05, 0.3)
    bench.mount |= {"level_asymmetry": level, "viscous_asymmetry": viscous}
    return {"level_asymmetry": level, "viscous_asymmetry": viscous}


def stribeck(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Break-away above the Coulomb level; the card knows only the latter."""
    mount = bench.mount
    breakaway = mount["coulomb"] * (1 + size * float(rng.uniform(0.6, 1.1)))
    speed = bench.pace.speed * log_uniform(rng, 0.08, 0.25)
    mount |= {"breakaway": breakaway, "stribeck_speed": speed}
    if bench.belief["friction"]["model"] != "coulomb":
        bench.belief["friction"] |= {"Fs": mount["coulomb"], "Vs": speed}
    edge = min(2 * speed, float(np.max(np.abs(bench.training.v))))
    where = {"axis": "speed", "regions": [[-edge, edge]]}
    return {"Fs": breakaway, "Vs": speed, "delta": mount["stribeck_power"], "where": where}


def presliding(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A soft contact that springs back; the card holds a static law."""
    mount = bench.mount
    reach = size * log_uniform(rng, 1e-3, 4e-3) * bench.pace.amplitude
    softer = mount["breakaway"] / reach / mount["stiffness"]
    mount |= {"stiffness": mount["stiffness"] * softer, "block_reach": mount["block_reach"] / softer}
    mount |= {"damping": mount["damping"] * np.sqrt(softer), "regular": 0.0}
    old = bench.belief["friction"]
    static = [key for key in ("Fc", "Fs", "Vs", "delta", "sigma2") if key in old]
    bench.belief["friction"] = {
        "model": "coulomb" if "Fs" not in old else "static",
        **{key: old[key] for key in static},
    }
    return {"sigma0": mount["stiffness"]}


def cogging(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Magnets: a torque over position that does not care about speed."""
    cycles, phase = _pitch(bench, rng), angle(rng)
    second, third = (0.0, 0.0) if rng.random() < 0.5 else (float(rng.uniform(0.2, 0.5)), float(rng.uniform(0, 0.25)))
    fundamental = goal(bench, rng, size) / np.sqrt((1 + second**2 + third**2) / 2)
    bench.mount |= {"cogging_cycles": bench.turn * cycles, "cogging_phase": phase, "cogging_1": fundamental}
    bench.mount |= {"cogging_2": second * fundamental, "cogging_3": third * fundamental}
    x = np.linspace(0, 2 * np.pi, 2000)
    wave = fundamental * (np.sin(x) + second * np.sin(2 * x) + third * np.sin(3 * x))
    shape = {"cycles_per_rev": cycles, "amplitude": float(np.ptp(wave)) / 2, "phase": phase}
    return shape | {"harmonics": [second, third], "fundamental": fundamental}


def _pitch(bench: SimulatedAxis, rng: np.random.Generator) -> int:
    """Cycles of a cogging: those of a direct drive, or from 1.5 to 60 within the travel and below 40 Hz."""
    if not bench.setup:
        return int(rng.integers(8, 73))
    travelled = bench.turn * bench.pace.amplitude / np.pi
    fastest = 2 * np.pi * 40 / (bench.turn * bench.pace.speed)
    return max(1, round(log_uniform(rng, 1.5 / travelled, max(2.0 / travelled, min(60 / travelled, fastest)))))


def position_friction(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A level that waves with position, or one rough spot."""
    if rng.random() < 0.5:
        return _rough_spot(bench, rng, size)
    cycles = int(rng.integers(1, 7)) * max(1, round(0.5 / bench.pace.amplitude))
    relative, phase = size * float(rng.uniform(0.3, 0.45)), angle(rng)
    bench.mount |= {"rough_relative": relative, "rough_cycles": bench.turn * cycles, "rough_phase": phase}
    return {"cycles_per_rev": cycles, "relative_amplitude": relative, "phase": phase}


def _rough_spot(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    center = bench.pace.home + bench.pace.amplitude * float(rng.uniform(-0.5, 0.5))
    width, relative = bench.pace.amplitude * float(rng.uniform(0.06, 0.15)), size * float(rng.uniform(0.7, 1.2))
    bench.mount |= {"spot_relative": relative, "spot_center": center, "spot_width": width}
    where = {"axis": "position", "regions": [[center - 2 * width, center + 2 * width]]}
    return {"q_center": center, "relative_amplitude": relative, "width": width, "where": where}


def gravity_unbalance(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A weight that was not balanced."""
    phase = angle(rng)
    mgl = 1.3 * goal(bench, rng, size) / rms(np.sin(bench.training.q + phase))
    bench.mount |= {"unbalance": mgl, "unbalance_phase": phase}
    return {"mgl": mgl, "phase": phase}


def torque_offset(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A constant pull."""
    bench.mount["offset"] = float(rng.choice([-1, 1])) * goal(bench, rng, size)
    return {"torque": bench.mount["offset"]}


def thermal_viscosity(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Grease that thins as it warms up."""
    viscous, level = -size * float(rng.uniform(0.03, 0.06)), -size * float(rng.uniform(0.02, 0.035))
    bench.mount |= {"thermal_viscous": viscous, "thermal_level": level}
    bench.mount["viscous"] *= 1.5
    bench.belief["friction"]["sigma2"] *= 1.5
    bench.shows_temperature = bool(rng.random() < 0.75)
    return {"viscous_per_degC": viscous, "coulomb_per_degC": level}


def dwell_breakaway(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Contacts that settle while the axis rests."""
    torque = size * float(rng.uniform(0.12, 0.2)) * bench.mount["coulomb"]
    onset, memory = log_uniform(rng, 0.05, 0.2), bench.pace.amplitude * log_uniform(rng, 2e-3, 1e-2)
    bench.mount |= {"dwell_torque": torque, "dwell_time": onset, "dwell_length": memory}
    return {"torque_per_efold": torque, "onset_s": onset, "memory_rad": memory}


def quadratic_drag(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Wind of its own making."""
    bench.mount["quadratic"] = 2.5 * goal(bench, rng, size) / rms(bench.training.v**2)
    return {"coefficient": bench.mount["quadratic"]}


def cable_wrap(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A cable that pulls towards home, harder when far."""
    home = bench.pace.home + bench.pace.amplitude * float(rng.uniform(-0.3, 0.3))
    hardening = 0.0 if rng.random() < 0.5 else float(rng.uniform(0.3, 1.5)) / bench.pace.amplitude**2
    x = bench.training.q - home
    stiffness = 1.2 * goal(bench, rng, size) / rms(x * (1 + hardening * x**2))
    bench.mount |= {"cable": stiffness, "cable_home": home, "cable_hardening": hardening}
    return {"stiffness": stiffness, "home": home, "hardening": hardening}


def inertia_variation(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Inertia that changes with position."""
    cycles = 2 if bench.pace.amplitude < 1 else int(rng.integers(1, 3))
    phase = angle(rng)
    shape = np.cos(bench.turn * cycles * bench.training.q + phase)
    felt = bench.mount["inertia"] * rms((shape - shape.mean()) * bench.training.a)
    relative = min(0.5, 1.2 * goal(bench, rng, size) / felt)
    bench.mount |= {"inertia_swing": relative, "inertia_cycles": bench.turn * cycles, "inertia_phase": phase}
    return {"relative_amplitude": relative, "cycles_per_rev": cycles, "phase": phase}


def load_dependent_friction(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A known payload presses on the bearing."""
    phase = -bench.pace.home + float(rng.choice([0.0, np.pi])) + float(rng.uniform(-0.4, 0.4))
    shape = rms(np.sin(bench.training.q + phase))
    mgl, share = float(rng.uniform(1.0, 2.0)) * bench.friction_rms / shape, size * float(rng.uniform(0.25, 0.4))
    bench.mount |= {"payload": mgl, "payload_phase": phase}
    bench.belief["unbalance"] = {"mgl": mgl, "phase": phase}
    bench.mount["load_sensitivity"] = share * bench.friction_rms / (mgl * shape)
    return {"coulomb_per_Nm": bench.mount["load_sensitivity"]}


def periodic_disturbance(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A machine next door."""
    hertz, amplitude = log_uniform(rng, 0.7, 15), np.sqrt(2) * goal(bench, rng, size)
    phases = {name: angle(rng) for name in bench.drives}
    add_push(bench, lambda name, t: amplitude * np.sin(2 * np.pi * hertz * t + phases[name]))
    return {"frequency_hz": hertz, "amplitude": float(amplitude), "phases": phases}


_ALL: tuple[Family, ...] = (
    *(friction_asymmetry, stribeck, presliding, cogging, position_friction, gravity_unbalance, torque_offset),
    *(thermal_viscosity, dwell_breakaway, quadratic_drag, cable_wrap, inertia_variation, load_dependent_friction),
    periodic_disturbance,
)

AT_THE_AXIS = {family.__name__: family for family in _ALL}
