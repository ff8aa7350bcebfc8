"""What may be wrong with a recording, or with the card beside it: each with its factors and how common it is.

A slip multiplies what was recorded: torque by T, position by P, time by C ticks a second. A true machine with inertia J
and Coulomb friction F then looks like one with J T / P and F T (time put right first). Priors are weights beside 1 for
"nothing is wrong"; where a factor is free they are spread over its logarithm.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from math import exp, log, pi
from typing import Any

import numpy as np

from cosim.diagnosis.answer.doubt_entry import Kind

CARD_INERTIA, CARD_FRICTION = 0.2, 0.7
"""Spread of ln(truth / card) where nothing is wrong: owners know inertias to a fifth, friction to a factor of two."""
ANY_INERTIA, ANY_FRICTION = 1.5, 1.2
"""The same where the card is of another machine or payload: factors of 4.5 and 3.3."""
GRID = 0.2
"""Step of the logarithm of a free factor; no more than the spread of what a card says of inertia."""


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """One explanation; `what` may hold {factor}."""

    kind: Kind | None
    what: str
    prior: float
    factor: float = 1.0
    """The factor that `what` names."""
    torque: float = 1.0
    position: float = 1.0
    is_counted: bool = False
    """Whether `position` is too uncertain to say where gravity comes back."""
    time: float = 1.0
    speed: float = 1.0
    """How many times too large the measured speed is; where there is a position nothing else reads it."""
    inertia: float = CARD_INERTIA
    friction: float = CARD_FRICTION
    option: str = ""
    """What puts it right on the command line."""
    is_slip: bool = True
    """Whether the recording is wrong, and not the card."""


def _of_card(what: str, prior: float, inertia: float = CARD_INERTIA, friction: float = CARD_FRICTION) -> Explanation:
    """A card that is wrong, by such spreads."""
    far: Kind = "base_far_from_card"
    return Explanation(kind=far, what=what, prior=prior, inertia=inertia, friction=friction, is_slip=False)


RIGHT = Explanation(kind=None, what="recording and card are right", prior=1.0, is_slip=False)
CARDS = (
    _of_card("the machine's inertia is another than the card's (payload, counterweight, gear)", 0.06, ANY_INERTIA),
    _of_card("the machine's friction is another than the card's", 0.06, friction=ANY_FRICTION),
    _of_card("the card is of another machine", 0.01, ANY_INERTIA, ANY_FRICTION),
)
SIGN = Explanation(
    kind="torque_sign", what="the torque (or the position) has the wrong sign", prior=0.01, torque=-1.0, is_slip=True
)
ANGLES = {"deg": (180 / pi, 0.02), "arcmin": (10800 / pi, 0.002), "arcsec": (648000 / pi, 0.004), "mrad": (1e3, 0.004)}
ANGLES |= {"rev": (1 / (2 * pi), 0.004)}
LENGTHS = {"mm": (1e3, 0.02), "um": (1e6, 0.006), "cm": (1e2, 0.002)}
SPEEDS = {"deg/s": (180 / pi, 0.02), "rpm": (30 / pi, 0.01), "rev/s": (1 / (2 * pi), 0.004)}
LINEAR_SPEEDS = {"mm/s": (1e3, 0.02), "m/min": (60.0, 0.004)}
TORQUES = {"mN.m": (1e3, 0.01), "N.cm": (1e2, 0.004), "kN.m": (1e-3, 0.002)}
FORCES = {"mN": (1e3, 0.004), "kN": (1e-3, 0.006)}
GEARS = (3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 24, 30, 36, 40, 50, 60, 72, 80, 100, 120, 160, 200, 250, 300)
TIMES = {"ms": (1e3, 0.01), "us": (1e6, 0.006), "ns": (1e9, 0.002)}


def explanations(
    linear: bool, reading: str, stated: Collection[str] = (), speed_off: float = 1.0, is_counted: bool = False
) -> Iterator[Explanation]:
    """All explanations for an axis.

    Args:
        linear: whether it is one that moves straight.
        reading: "q", or "v" where a speed was measured.
        stated: columns whose unit was stated; theirs is not doubted.
        speed_off: how many times the slope of the position a measured speed is, 1 where they agree.
        is_counted: whether rows were given their times by a period that a user stated.
    """
    yield RIGHT
    yield from CARDS
    yield SIGN
    yield from (one for one in _positions(linear, reading) if not (one.option and reading in stated))
    yield from _gears(linear)
    yield from (one for one in _torques(linear) if not (one.option and "tau" in stated))
    for unit, (factor, prior) in TIMES.items():
        yield _off("time_unit", f"t counts {unit}", prior, factor, "time", option=f"--units t={unit}")
    if speed_off != 1.0:
        yield from _contradiction(speed_off, linear, is_counted)
        return
    # A radius for a diameter, a quadrature that is not counted.
    for factor, how, prior in ((2.0, "twice too large", 0.01), (0.5, "half as large as it should be", 0.005)):
        yield _off("position_scale", f'"{reading}" is {how}', prior, factor, "position")


def _off(kind: Kind, what: str, prior: float, factor: float, column: str, **more: Any) -> Explanation:
    """A column of which all numbers are so many times too large."""
    return Explanation(kind=kind, what=what, prior=prior, factor=factor, **{column: factor, **more})


def _contradiction(k: float, linear: bool, is_counted: bool) -> Iterator[Explanation]:
    """Speed, position and time of which one must be wrong, as a speed is k times the slope of the position.

    A speed is wrong more often (an estimate of a drive, another shaft); a time or a position is in published records.
    Where rows were given their times by a period, speed and time change places: both readings are the machine's, and
    the period is what somebody said of it.
    """
    rare, often = 0.007, 0.02
    of_time, of_speed = (often, rare) if is_counted else (rare, often)
    length = "m" if linear else "rad"
    slip = Explanation(
        kind="time_unit", what=f'time is stretched by {k:.3g} (--units "t={1 / k:.4g} s")', prior=of_time
    )
    speed = f'"v" is {k:.3g} times the speed, and position and time are right'
    place = f'"q" is {1 / k:.3g} times the position (--units "q={k:.4g} {length}")'
    yield replace(slip, kind="speed_scale", what=speed, prior=of_speed, speed=k, factor=k, is_slip=False)
    yield replace(slip, time=k, factor=k)
    yield replace(slip, kind="position_scale", what=place, prior=0.005, position=1 / k, factor=1 / k)


def _positions(linear: bool, reading: str) -> Iterator[Explanation]:
    tables = (ANGLES, LENGTHS) if reading == "q" else (SPEEDS, LINEAR_SPEEDS)
    for unit, (factor, prior) in tables[linear].items():
        option = f"--units {reading}={unit}"
        yield _off("position_scale", f'"{reading}" is in {unit}', prior, factor, "position", option=option)
    counts = f'"{reading}" counts {{factor}} to a {"metre" if linear else "radian"} (encoder counts)'
    for factor in np.exp(np.arange(log(200.0), log(1e7), GRID)).tolist():
        prior = 0.004 * GRID / log(5e4)
        yield _off("position_scale", counts, prior, factor, "position", is_counted=True)


def _gears(linear: bool) -> Iterator[Explanation]:
    """Common ratios; the prior is log-normal about 8, a factor of 2.7 wide. A linear axis has a spindle, not a gear."""
    weights = [0.0 if linear else exp(-0.5 * log(ratio / 8.0) ** 2) for ratio in GEARS]
    ways = (
        ("the position is counted before a gear of {factor}, the torque after it (gear forgotten)", 0.004, 0, 1),
        ("position and torque are those of the motor before a gear of {factor} (gear forgotten)", 0.008, -1, 1),
        ("the torque is that of the motor before a gear of {factor} (gear forgotten)", 0.004, -1, 0),
    )
    for what, prior, torque, position in ways if not linear else ():
        for ratio, weight in zip(GEARS, weights, strict=True):
            yield Explanation(
                kind="gear_ratio",
                what=what,
                prior=prior * weight / sum(weights),
                torque=float(ratio) ** torque,
                position=float(ratio) ** position,
                factor=float(ratio),
            )


def _torques(linear: bool) -> Iterator[Explanation]:
    unit_of = FORCES if linear else TORQUES
    for unit, (factor, prior) in unit_of.items():
        yield _off("torque_scale", f'"tau" is in {unit}', prior, factor, "torque", option=f"--units tau={unit}")
    times = '"tau" is {factor} times the torque (a current, a per cent of the rated torque, a torque constant)'
    for factor in np.exp(np.arange(log(1e-3), log(1e4), GRID)).tolist():
        yield _off("torque_scale", times, 0.006 * GRID / log(1e7), factor, "torque")
