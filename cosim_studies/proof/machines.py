"""Classes of machines from which a benchmark draws, wider than any of them is built: ranges, loops, rates, set points.

A range is drawn evenly in its logarithm. Inertia is in kg m2 or kg, travel (half of it) in rad or m, speed (a typical
peak) in rad/s or m/s; friction is the Coulomb level over the peak inertia torque.
"""

from dataclasses import dataclass
from typing import Literal

Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Machine:
    """One class.

    `ratios` are encoder turns per turn (or metre) of the axis, `rates` rows a second, `ticks` loop periods in 0.1 ms,
    `band` where 1 to 8 % of the friction are reached by the encoder's noise in the acceleration [Hz]: coarse encoders
    have a low one.
    """

    motion: Literal["rotary", "linear"] = "rotary"
    inertia: Range
    travel: Range
    speed: Range
    friction: Range
    ratios: tuple[int, ...]
    rates: tuple[int, ...]
    ticks: tuple[int, ...]
    band: Range
    loops: tuple[str, ...] = ("adrc", "pid", "cascade")
    waves: tuple[str, ...]


MACHINES = {
    "telescope mount": Machine(
        inertia=(1, 200),
        travel=(0.3, 2.5),
        speed=(0.05, 0.8),
        friction=(0.04, 0.6),
        ratios=(1, 4, 16, 32),
        rates=(200, 500, 1000, 2000),
        ticks=(1, 2, 10),
        band=(15, 40),
        waves=("wander", "slews", "swell", "chirp", "stairs"),
    ),
    "robot joint": Machine(
        inertia=(0.05, 8),
        travel=(0.3, 1.5),
        speed=(0.3, 3),
        friction=(0.1, 1.0),
        ratios=(1, 50, 100, 160),
        rates=(250, 500, 1000, 2000),
        ticks=(1, 5, 10, 20),
        band=(10, 60),
        waves=("wander", "chirp", "tones", "jogs", "sines", "swell"),
    ),
    "ball screw": Machine(
        motion="linear",
        inertia=(20, 400),
        travel=(0.05, 0.4),
        speed=(0.05, 0.5),
        friction=(0.1, 0.8),
        ratios=(50, 100, 200),
        rates=(500, 1000, 2000, 5000),
        ticks=(1, 2, 10),
        band=(10, 60),
        loops=("pid", "cascade"),
        waves=("shuttle", "jogs", "stairs", "sines", "tones", "wander"),
    ),
    "belt": Machine(
        motion="linear",
        inertia=(1, 30),
        travel=(0.1, 0.6),
        speed=(0.2, 1.5),
        friction=(0.05, 0.5),
        ratios=(4, 8, 20),
        rates=(200, 500, 1000),
        ticks=(5, 10, 20),
        band=(8, 30),
        loops=("pid", "cascade"),
        waves=("shuttle", "jogs", "tones", "chirp", "swell"),
    ),
    "turntable": Machine(
        inertia=(0.5, 200),
        travel=(1, 6),
        speed=(0.3, 3),
        friction=(0.03, 0.4),
        ratios=(1, 8, 72),
        rates=(250, 500, 1000),
        ticks=(1, 10),
        band=(10, 40),
        waves=("turning", "shuttle", "wander", "slews", "sines"),
    ),
    "hobby servo": Machine(
        inertia=(0.001, 0.02),
        travel=(0.3, 1.2),
        speed=(0.5, 4),
        friction=(0.2, 1.2),
        ratios=(1,),
        rates=(200, 250, 500),
        ticks=(10, 20, 50),
        band=(4, 15),
        loops=("pid", "cascade"),
        waves=("sines", "jogs", "chirp", "tones", "stairs", "shuttle"),
    ),
    "rotary table": Machine(
        inertia=(2, 100),
        travel=(0.5, 3),
        speed=(0.1, 1),
        friction=(0.1, 0.8),
        ratios=(1, 72, 180),
        rates=(500, 1000, 2000, 5000),
        ticks=(1, 2, 5),
        band=(10, 60),
        loops=("adrc", "cascade"),
        waves=("shuttle", "jogs", "stairs", "wander", "swell"),
    ),
}
TURNING = ("gravity_unbalance", "load_dependent_friction", "payload_comes")
"""Effects of a weight that turns with the axis: no linear machine has them."""


def suited(effects: tuple[str, ...]) -> tuple[str, ...]:
    """Classes that can have all these effects."""
    weight = any(name in TURNING for name in effects)
    return tuple(name for name, one in MACHINES.items() if one.motion == "rotary" or not weight)
