"""Machines that are not quite what equations say of them: each concealed torque is warped, nulls are rough as well.

    torque = equation (1 + w),    w over position, speed, time or direction;     level (1 + bend(v) + mottle(q))

How rough: of the measured machines whose friction or load was published with its error, equations miss 5 to 20 % of
their own torque (Armstrong-Helouvry, Control of Machines with Friction, 1991: friction repeats to 10 to 20 %; load
friction of harmonic drives has a round edge, Bittencourt and Gunnarsson, J. Dyn. Sys. Meas. Control 134 (2012) 051013).
Nothing here depends on what the diagnosis allows for.
"""

from collections.abc import Callable

import numpy as np

from cosim_studies.proof.simulated_axis import Parameters, SimulatedAxis, log_uniform, stream

WARP = (0.06, 0.2)
"""How far a concealed torque is from its equation, at most, relative to itself."""
BEND = (0.01, 0.06)
"""How far the friction level is from the law, over speed, relative to it."""
MOTTLE = (0.004, 0.02)
"""The same over position."""
TWO = 0.4
"""Share of the machines that are rough in two ways."""


def _over_position(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    cycles = float(rng.uniform(0.5, 2.0)) * np.pi / bench.pace.amplitude
    return {"warp_place": size, "warp_place_cycles": cycles, "warp_place_phase": _any(rng)}


def _over_speed(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    return {"warp_speed": size * _sign(rng), "warp_speed_scale": bench.pace.speed * float(rng.uniform(0.1, 0.6))}


def _over_time(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    rate = 2 * np.pi * float(rng.uniform(0.5, 3.0)) / bench.pace.duration
    return {"warp_time": size, "warp_time_rate": rate, "warp_time_phase": _any(rng)}


def _one_way(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    return {"warp_way": size * _sign(rng)}


WAYS: dict[str, Callable[[SimulatedAxis, np.random.Generator, float], Parameters]] = {
    "position": _over_position,
    "speed": _over_speed,
    "time": _over_time,
    "direction": _one_way,
}


def roughen(bench: SimulatedAxis, seed: int) -> None:
    """Write roughness into a bench, whatever is concealed in it."""
    rng = stream(seed, "rough")
    many = 1 + int(rng.random() < TWO)
    ways = [str(name) for name in rng.permutation(list(WAYS))[:many]]
    for name in ways:
        bench.mount |= WAYS[name](bench, rng, log_uniform(rng, *WARP) / np.sqrt(many))
    bench.mount |= {
        "bend": log_uniform(rng, *BEND),
        "bend_rate": float(rng.uniform(1.0, 4.0)) * np.pi / (2 * bench.pace.speed),
        "bend_phase": _any(rng),
        "mottle": log_uniform(rng, *MOTTLE),
        "mottle_cycles": float(rng.uniform(1.0, 6.0)) * np.pi / bench.pace.amplitude,
        "mottle_phase": _any(rng),
    }
    if "load_sensitivity" in bench.mount:
        bench.mount["edge"] = float(rng.uniform(0.1, 0.5)) * abs(bench.mount["payload"])
    bench.setup = bench.setup | {"rough": ways}


def _any(rng: np.random.Generator) -> float:
    return float(rng.uniform(-np.pi, np.pi))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1, 1]))
