"""A mount on the test bench before anything is concealed: masses, friction, noise, motions, what its owner believes.

All draws come from named streams of one seed, so that a case with an effect and its null share everything else.
"""

import zlib
from dataclasses import dataclass, field
from itertools import accumulate

import numpy as np

from cosim.support.plain import Parsed
from cosim.support.statistics import rms
from cosim_studies.proof.motion import MOTIONS, Motion, Pace, with_tremble
from cosim_studies.proof.truth import BLOCKS, TICK, Array, Drive

Parameters = Parsed
RECORDINGS = ("train_1", "train_2", "heldout")
FRICTIONS = ("lugre", "maxwell_slip", "mixed")


def stream(seed: int, name: str) -> np.random.Generator:
    """The random numbers of one purpose; another purpose never shifts them."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose order of magnitude is evenly spread."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


@dataclass
class SimulatedAxis:
    """Everything that `truth.simulate` needs, and the owner's belief; effects write into it."""

    mount: Parsed
    belief: dict[str, Parsed]
    pace: Pace
    motions: dict[str, Motion]
    drives: dict[str, Drive]
    temperature: dict[str, float]
    noise: dict[str, float]
    clock: dict[str, float] = field(default_factory=lambda: {"offset_ms": 0.0, "drift_ppm": 0.0})
    shows_temperature: bool = False
    shows_set_point: bool = True
    rate_hz: int = 1000
    turn: float = 1.0
    """Radians by which waves over position turn in a unit of it: 1, or 2 pi where that is a metre."""
    setup: Parameters = field(default_factory=dict)
    """What was drawn besides numbers: class of machine, card, contact, loop, set points; empty for the telescope mount
    that `draw_axis` draws."""

    @property
    def training(self) -> Motion:
        """The set points of both training recordings, one row in a hundred."""
        parts = [self.motions[name] for name in RECORDINGS[:2]]
        return Motion(*(np.concatenate([part[i][::100] for part in parts]) for i in range(3)))

    @property
    def friction_rms(self) -> float:
        """Expected friction torque while it moves [N m], root mean square over the training set points."""
        v = np.abs(self.training.v)
        return rms((self.mount["coulomb"] + self.mount["viscous"] * v)[v > 0.02 * self.pace.speed])


def draw_pace(rng: np.random.Generator, duration: float) -> Pace:
    """0.3 to 2.5 rad at speeds up to 0.8 rad/s."""
    amplitude, hertz = log_uniform(rng, 0.3, 2.5), log_uniform(rng, 0.05, 0.25)
    hertz = min(hertz, 0.7 / (2 * np.pi * amplitude))
    return Pace(float(rng.uniform(-1, 1)), amplitude, hertz, duration)


def draw_motions(rng: np.random.Generator, pace: Pace, tremble: float = 0.35) -> dict[str, Motion]:
    """Two kinds for training, a third held out; each with short bursts of tremble that excite the drive."""
    kinds = zip(RECORDINGS, ["wander", "slews", str(rng.choice(["swell", "chirp"]))], strict=True)
    return {name: with_tremble(MOTIONS[kind](pace, rng), rng, tremble) for name, kind in kinds}


def draw_mount(rng: np.random.Generator, friction: str, motions: dict[str, Motion], pace: Pace) -> Parsed:
    """Masses, friction, controller; the Coulomb level is 4 to 35 % of the peak inertia torque."""
    inertia = log_uniform(rng, 1, 60)
    peak = float(np.quantile(np.abs([motions[name].a for name in RECORDINGS[:2]]), 0.98))
    coulomb = log_uniform(rng, 0.04, 0.35) * inertia * peak
    return {
        "inertia": inertia,
        **_draw_friction(rng, friction, inertia, coulomb, pace.speed),
        **_draw_loop(rng),
        "warm_up_time": float(rng.uniform(12, 30)),
        "heating": float(rng.uniform(10, 20)) / (1.2 * coulomb * 0.6 * pace.speed),
        "home": pace.home,
    }


def _draw_friction(rng: np.random.Generator, friction: str, inertia: float, coulomb: float, speed: float) -> Parsed:
    """Level, Stribeck fall, presliding stiffness, and the row of slip blocks with their share."""
    fall = 1.0 if rng.random() < 0.3 else float(rng.uniform(1.1, 1.5))
    reach, mixed = log_uniform(rng, 2e-5, 3e-4), rng.random() < 0.5
    blend = {"lugre": 0.0, "maxwell_slip": 1.0, "mixed": float(rng.uniform(0.3, 0.6)) if mixed else 0.0}[friction]
    stiffness = fall * coulomb / reach
    return {
        "coulomb": coulomb,
        "breakaway": fall * coulomb,
        "stribeck_speed": speed * log_uniform(rng, 0.02, 0.1),
        "stribeck_power": float(rng.choice([1.0, 2.0])),
        "stiffness": stiffness,
        "damping": float(rng.uniform(0.1, 0.4)) * 2 * np.sqrt(stiffness * inertia),
        "viscous": float(rng.uniform(0.1, 0.8)) * coulomb / speed,
        "blend": blend,
        "block_weight": rng.dirichlet(np.full(BLOCKS, 2.0)),
        "block_reach": reach * np.geomspace(0.15, 4.0, BLOCKS) * rng.uniform(0.8, 1.25, BLOCKS),
    }


def _draw_loop(rng: np.random.Generator) -> dict[str, float]:
    bandwidth = float(rng.uniform(8, 15))
    return {"kp": bandwidth**2, "kd": 2 * bandwidth, "observer": float(rng.uniform(60, 150))}


def draw_noise(rng: np.random.Generator, mount: Parsed, noise: float) -> dict[str, float]:
    """Encoder noise such that 30 Hz accelerations cost 1 to 8 % of friction; torque noise; wander of the level."""
    coulomb = mount["coulomb"]
    encoder = coulomb / (3900 * mount["inertia"]) * log_uniform(rng, 0.01, 0.08) * noise
    return {
        "encoder_rms": encoder,
        "quantum": encoder * log_uniform(rng, 0.3, 3),
        "torque_white_rms": coulomb * log_uniform(rng, 0.05, 0.4) * noise,
        "torque_coloured_rms": coulomb * log_uniform(rng, 0.005, 0.03) * noise,
        "torque_coloured_s": log_uniform(rng, 0.02, 0.3),
        "wander_rms": log_uniform(rng, 0.005, 0.04) * noise,
        "wander_s": log_uniform(rng, 2, 20),
    }


def drift(rng: np.random.Generator, n: int, rms: float, correlation_s: float) -> Array:
    """Ornstein-Uhlenbeck noise at the ticks of the loop: the bits of SciPy's `lfilter`, which loads in a second."""
    keep = float(np.exp(-TICK / correlation_s))
    kicks = rng.standard_normal(n) * rms * np.sqrt(1 - keep**2)
    kicks[:1] = rng.standard_normal() * rms
    return np.fromiter(accumulate(kicks.tolist(), lambda before, kick: kick + keep * before), float, n)


def draw_drive(rng: np.random.Generator, motion: Motion, noise: dict[str, float]) -> Drive:
    """The set point with all that disturbs it in one recording."""
    n = motion.q.size
    push = noise["torque_white_rms"] * rng.standard_normal(n)
    push += drift(rng, n, noise["torque_coloured_rms"], noise["torque_coloured_s"])
    level = np.maximum(0.2, 1 + drift(rng, n, noise["wander_rms"], noise["wander_s"]))
    ambient = float(rng.uniform(8, 22)) + drift(rng, n, 0.5, 30.0)
    return Drive(*motion, push=push, level=level, noise=noise["encoder_rms"] * rng.standard_normal(n), ambient=ambient)


def believe(mount: Parsed, noise: dict[str, float], ratio: int, rate_hz: int) -> dict[str, Parsed]:
    """The card as it would be written with perfect knowledge of the base."""
    friction = {
        "model": "lugre",
        **{"sigma0": mount["stiffness"], "sigma1": mount["damping"], "sigma2": mount["viscous"]},
        **{"Fc": mount["coulomb"], "Fs": mount["breakaway"]},
        **{"Vs": mount["stribeck_speed"], "delta": mount["stribeck_power"]},
    }
    counts = max(1, round(2 * np.pi / (noise["quantum"] * ratio)))
    loop = {"type": "adrc", "kp": mount["kp"], "kd": mount["kd"], "loop_hz": round(1 / TICK), "record_hz": rate_hz}
    return {
        "mount": {"name": "concealed mount", "motion": "rotary", "inertia": mount["inertia"]},
        "friction": friction,
        "encoder": {"counts_per_rev": counts, "noise_rms": noise["encoder_rms"], "ratio": ratio},
        "controller": {**loop, "observer_bandwidth": mount["observer"], "compensation": "C1"},
    }


def draw_axis(seed: int, friction: str, noise: float, rate_hz: int, duration: float) -> SimulatedAxis:
    """A mount with nothing concealed."""
    rng = stream(seed, "bench")
    pace = draw_pace(rng, duration)
    motions = draw_motions(stream(seed, "motion"), pace)
    mount = draw_mount(rng, friction, motions, pace)
    levels = draw_noise(rng, mount, noise)
    mount["quantum"] = levels["quantum"]
    drives = {name: draw_drive(stream(seed, name), motion, levels) for name, motion in motions.items()}
    warm = {name: float(drive.ambient[0] + rng.uniform(0, 3)) for name, drive in drives.items()}
    belief = believe(mount, levels, int(rng.choice([1, 4, 8, 16, 32])), rate_hz)
    return SimulatedAxis(
        mount, belief, pace, motions, drives, warm, levels, shows_temperature=rng.random() < 0.5, rate_hz=rate_hz
    )
