"""The mount of `cosim demo`: the paper's numbers, a telescope's night, and two effects its card does not know."""

import numpy as np

from cosim.support.plain import Parsed
from cosim_studies.proof.generator import Case, assemble
from cosim_studies.proof.motion import Pace
from cosim_studies.proof.simulated_axis import (
    RECORDINGS,
    Parameters,
    SimulatedAxis,
    believe,
    draw_drive,
    draw_motions,
    stream,
)
from cosim_studies.proof.truth import BLOCKS

_NOISE = {
    "encoder_rms": 3e-7,
    "quantum": 2e-7,
    "torque_white_rms": 0.4,
    "torque_coloured_rms": 0.04,
    "torque_coloured_s": 0.15,
    "wander_rms": 0.015,
    "wander_s": 8.0,
}


def demo_case(seed: int = 7, duration: float = 50.0) -> Case:
    """Slews of several degrees and star tracking at up to 0.1 rad/s; friction asymmetry and cogging concealed."""
    pace = Pace(home=0.4, amplitude=0.3, hertz=0.045, duration=duration)
    motions = draw_motions(stream(seed, "motion"), pace)
    mount = _paper_mount(pace)
    drives = {name: draw_drive(stream(seed, name), motion, _NOISE) for name, motion in motions.items()}
    belief = believe(mount, _NOISE, ratio=1, rate_hz=1000)
    belief["mount"] |= {"name": "telescope mount of the paper", "torque_limit": 60.0}
    bench = SimulatedAxis(mount, belief, pace, motions, drives, dict.fromkeys(RECORDINGS, 20.0), dict(_NOISE))
    return assemble(bench, _conceal(bench, stream(seed, "demo")), seed, 1000, {})


def _paper_mount(pace: Pace) -> Parsed:
    """Inertia 30 kg m2 and the friction of the paper's tables 2 and 3; loop: kp 225, kd 30, observer 220 rad/s."""
    return {
        **{"inertia": 30.0, "stiffness": 9e4, "damping": 500.0, "viscous": 28.0, "coulomb": 3.1, "breakaway": 4.3},
        **{"stribeck_speed": 0.011, "stribeck_power": 1.292, "kp": 225.0, "kd": 30.0, "observer": 220.0},
        **{"blend": 0.0, "block_weight": np.full(BLOCKS, 1 / BLOCKS), "block_reach": np.full(BLOCKS, 5e-5)},
        **{"quantum": _NOISE["quantum"], "home": pace.home},
    }


def _conceal(bench: SimulatedAxis, rng: np.random.Generator) -> list[Parsed]:
    cycles, amplitude = int(rng.integers(12, 37)), float(rng.uniform(0.4, 0.6))
    phase, level = float(rng.uniform(-np.pi, np.pi)), float(rng.choice([-1, 1]) * rng.uniform(0.12, 0.2))
    bench.mount |= {"level_asymmetry": level, "viscous_asymmetry": 0.5 * level}
    bench.mount |= {"cogging_cycles": cycles, "cogging_1": amplitude, "cogging_phase": phase}
    asymmetry: Parameters = {"level_asymmetry": level, "viscous_asymmetry": 0.5 * level}
    ripple: Parameters = {"cycles_per_rev": cycles, "amplitude": amplitude, "phase": phase, "harmonics": [0.0, 0.0]}
    return [
        {"effect": "friction_asymmetry", "size": 1.0, "listed": True, "parameters": asymmetry},
        {"effect": "cogging", "size": 1.0, "listed": True, "parameters": ripple},
    ]
