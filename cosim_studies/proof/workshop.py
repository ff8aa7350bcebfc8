"""One machine of any class on the bench, with its loop, friction, noise, set points and the card its owner wrote.

Nothing here depends on what will be concealed, but for two things that would have no meaning: no weight turns with a
linear axis, and no known payload stands beside a concealed weight, whose sum is one payload.
"""

import numpy as np

from cosim.support.plain import Parsed
from cosim_studies.proof.machines import MACHINES, Machine, suited
from cosim_studies.proof.motion import MOTIONS, Motion, Pace, with_tremble
from cosim_studies.proof.simulated_axis import (
    RECORDINGS,
    Parameters,
    SimulatedAxis,
    believe,
    draw_drive,
    log_uniform,
    stream,
)
from cosim_studies.proof.strokes import STROKES
from cosim_studies.proof.truth import BLOCKS, TICK

WAVES = {**MOTIONS, **STROKES}
CARDS = {"lugre": 0.55, "static": 0.27, "coulomb": 0.18}
"""What the owner took for friction."""
CONTACTS = {"bristle": 0.35, "mixed": 0.35, "blocks": 0.05, "lagged": 0.1, "lorentz": 0.15}
"""What rubs where the card has bristles: a bristle, with slip blocks beside it (10 to 60 %), slip blocks alone, a level
that follows the speed late, a Stribeck curve of another form."""
HARD = {"regular": 0.5, "stiff": 0.5}
"""What rubs where the card has none: a smoothed sign of the speed, or bristles that nothing resolves."""
PAYLOAD = 0.3
"""Share of the rotary machines with a payload that the card knows."""
NO_SET_POINT = 0.2
SHORTEST = 12.0
"""Seconds that a recording lasts at least, where that much was asked for."""
LOUDEST = 0.2
"""Torque, as a share of the Coulomb level, that a loop may make of its encoder's noise; louder ones get filtered."""
ALONE = ("gravity_unbalance", "load_dependent_friction", "payload_comes")
"""Concealed weights: beside them a known payload would be one with them, or they bring their own."""


def draw_workshop(seed: int, effects: tuple[str, ...], duration: float, machine: str = "") -> SimulatedAxis:
    """Draw a machine (of a class, or of any that suits the effects) with nothing concealed."""
    rng = stream(seed, "workshop")
    name = machine or str(rng.choice(suited(effects)))
    kind = MACHINES[name]
    pace = _pace(rng, kind, max(min(duration, SHORTEST), duration * float(rng.uniform(0.5, 1.0))))
    waves = _waves(rng, kind)
    motions = _motions(seed, pace, waves, 0.0 if rng.random() < 0.25 else float(rng.uniform(0.05, 0.6)))
    card = _chosen(rng, CARDS)
    contact = _chosen(rng, CONTACTS if card == "lugre" else HARD)
    mount = _masses(rng, kind, motions, pace) | _loop(rng, kind, pace)
    mount |= _friction(rng, card, contact, mount, pace)
    levels = _noise(rng, kind, mount)
    mount["quantum"] = levels["quantum"]
    drives = {each: draw_drive(stream(seed, each), motion, levels) for each, motion in motions.items()}
    warm = {each: float(drive.ambient[0] + rng.uniform(0, 3)) for each, drive in drives.items()}
    rate = int(rng.choice(kind.rates))
    belief = _belief(card, mount, levels, int(rng.choice(kind.ratios)), rate, kind)
    bench = SimulatedAxis(mount, belief, pace, motions, drives, warm, levels, shows_temperature=rng.random() < 0.4)
    bench.rate_hz, bench.turn = rate, 1.0 if kind.motion == "rotary" else 2 * np.pi
    bench.shows_set_point = rng.random() > NO_SET_POINT
    known = kind.motion == "rotary" and rng.random() < PAYLOAD and not set(effects) & set(ALONE)
    if known:
        _weigh(rng, bench)
    bench.setup = {"machine": name, "card": card, "contact": contact, "waves": list(waves.values()), "payload": known}
    bench.setup |= {"loop": ("adrc", "pid", "cascade")[int(mount["controller"])], "rate_hz": rate}
    return bench


def _chosen(rng: np.random.Generator, shares: dict[str, float]) -> str:
    return str(rng.choice(list(shares), p=list(shares.values())))


def _pace(rng: np.random.Generator, kind: Machine, duration: float) -> Pace:
    amplitude, speed = log_uniform(rng, *kind.travel), log_uniform(rng, *kind.speed)
    hertz = float(np.clip(speed / (2 * np.pi * amplitude), 0.04, 0.8))
    return Pace(float(rng.uniform(-1, 1)) * min(1.0, amplitude), amplitude, hertz, duration)


def _waves(rng: np.random.Generator, kind: Machine) -> dict[str, str]:
    """The held-out motion is of another kind than those of training; these may be alike."""
    held, *others = (str(name) for name in rng.permutation(kind.waves))
    first = others[0]
    second = first if rng.random() < 0.2 else others[1]
    return dict(zip(RECORDINGS, (first, second, held), strict=True))


def _motions(seed: int, pace: Pace, waves: dict[str, str], tremble: float) -> dict[str, Motion]:
    rng = stream(seed, "motion")
    return {name: with_tremble(WAVES[wave](pace, rng), rng, tremble) for name, wave in waves.items()}


def _masses(rng: np.random.Generator, kind: Machine, motions: dict[str, Motion], pace: Pace) -> Parameters:
    inertia = log_uniform(rng, *kind.inertia)
    peak = float(np.quantile(np.abs([motions[name].a for name in RECORDINGS[:2]]), 0.98))
    coulomb = log_uniform(rng, *kind.friction) * inertia * peak
    heating = float(rng.uniform(10, 20)) / (1.2 * coulomb * 0.6 * pace.speed)
    return {
        **{"inertia": inertia, "coulomb": coulomb, "home": pace.home},
        **{"warm_up_time": float(rng.uniform(12, 30)), "heating": heating},
    }


def _loop(rng: np.random.Generator, kind: Machine, pace: Pace) -> Parameters:
    """Bandwidth eight times the pace at least; a slow loop is not asked to be fast."""
    which = str(rng.choice(kind.loops))
    every = int(rng.choice(kind.ticks))
    bandwidth = max(8.0, 2 * np.pi * pace.hertz * float(rng.uniform(8, 16)))
    bandwidth = min(bandwidth, 0.06 / (every * TICK))
    own = {"kp": bandwidth**2, "kd": 2 * bandwidth, "ki": 0.0, "speed_filter": bandwidth * float(rng.uniform(8, 20))}
    if which == "pid":
        own |= {"controller": 1.0, "ki": 0.2 * bandwidth * float(rng.uniform(0.3, 1))}
    elif which == "cascade":
        own |= {"controller": 2.0, "ki": bandwidth * float(rng.uniform(0.1, 0.5))}
    observer = bandwidth * float(rng.uniform(6, 12))
    return {"controller": 0.0, **own, "observer": observer, "loop_every": float(every)}


def _friction(rng: np.random.Generator, card: str, contact: str, mount: Parameters, pace: Pace) -> Parameters:
    """Level, fall, stiffness and the form of the contact."""
    coulomb, inertia = mount["coulomb"], mount["inertia"]
    fall = 1.0 if card == "coulomb" or rng.random() < 0.3 else float(rng.uniform(1.05, 1.6))
    stiff = card != "lugre"
    reach = pace.amplitude * log_uniform(rng, *((1e-6, 1e-5) if stiff else (3e-5, 1e-3)))
    stiffness = fall * coulomb / reach
    blend = {"mixed": float(rng.uniform(0.1, 0.6)), "blocks": 1.0}.get(contact, 0.0)
    found = {
        **{"breakaway": fall * coulomb, "blend": blend, "stiffness": stiffness},
        "stribeck_speed": pace.speed * log_uniform(rng, 0.01, 0.15),
        "stribeck_power": float(rng.uniform(0.8, 2.2)),
        "damping": float(rng.uniform(0.05, 0.5)) * 2 * np.sqrt(stiffness * inertia),
        "viscous": log_uniform(rng, 0.05, 1.5) * coulomb / pace.speed,
        "block_weight": rng.dirichlet(np.full(BLOCKS, 2.0)),
        "block_reach": reach * np.geomspace(0.15, 4.0, BLOCKS) * rng.uniform(0.8, 1.25, BLOCKS),
    }
    if contact == "regular":  # steeper than this the explicit steps of truth.c would not follow
        found["regular"] = max(pace.speed * log_uniform(rng, 1e-4, 3e-3), 5e-5 * coulomb * fall / inertia)
    if contact == "lagged":
        found["friction_lag"] = log_uniform(rng, 2e-3, 2e-2)
    if contact == "lorentz":
        found["lorentz"] = 1.0
    return found


def _noise(rng: np.random.Generator, kind: Machine, mount: Parameters) -> dict[str, float]:
    """As on a telescope, with the encoder's noise for the band of this class, and no more than its loop can take."""
    coulomb, band = mount["coulomb"], log_uniform(rng, *kind.band)
    encoder = coulomb / (3900 * (band / 30) ** 2.5 * mount["inertia"]) * log_uniform(rng, 0.01, 0.08)
    fed_back = mount["kd"] * mount["speed_filter"] if mount["controller"] else 3 * mount["observer"] ** 2
    encoder = min(encoder, LOUDEST * coulomb / (mount["inertia"] * fed_back))
    return {
        "encoder_rms": encoder,
        "quantum": encoder * log_uniform(rng, 0.3, 4),
        "torque_white_rms": coulomb * log_uniform(rng, 0.03, 0.5),
        "torque_coloured_rms": coulomb * log_uniform(rng, 0.005, 0.03),
        "torque_coloured_s": log_uniform(rng, 0.02, 0.5),
        "wander_rms": log_uniform(rng, 0.004, 0.04),
        "wander_s": log_uniform(rng, 2, 30),
    }


def _belief(
    card: str, mount: Parameters, levels: dict[str, float], ratio: int, rate_hz: int, kind: Machine
) -> dict[str, Parsed]:
    """The card of perfect knowledge of the base: friction by its law, a controller only where a card can name it."""
    belief = believe(mount, levels, ratio, rate_hz)
    belief["mount"] |= {"name": "concealed machine", "motion": kind.motion}
    belief["encoder"]["counts_per_rev"] /= 1.0 if kind.motion == "rotary" else 2 * np.pi
    keys = {"lugre": (), "static": ("sigma2", "Fc", "Fs", "Vs", "delta"), "coulomb": ("sigma2", "Fc")}[card]
    if keys:
        belief["friction"] = {"model": card, **{key: belief["friction"][key] for key in keys}}
    belief["controller"]["loop_hz"] = round(1 / TICK / mount["loop_every"])
    if mount["controller"] > 0:
        del belief["controller"]
    return belief


def _weigh(rng: np.random.Generator, bench: SimulatedAxis) -> None:
    """A payload that the card knows to some per cent."""
    size = log_uniform(rng, 0.3, 2.0) * bench.friction_rms
    phase = float(rng.uniform(-np.pi, np.pi))
    bench.mount |= {"payload": size, "payload_phase": phase}
    off, turned = float(rng.uniform(0.85, 1.15)), phase + float(rng.uniform(-0.05, 0.05))
    bench.belief["unbalance"] = {"mgl": size * off, "phase": turned}
