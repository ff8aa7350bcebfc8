"""Does a fitted effect mean what its name says, or is it something else in disguise?"""

import math

import numpy as np

from cosim.diagnosis.families.friction import contact_level
from cosim.diagnosis.fit import LEAST_VS
from cosim.diagnosis.lateness import blamed
from cosim.diagnosis.prepare import Array, Prepared
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.shaken import heard
from pyfmi_models.effects import (
    ActuatorLag,
    ClockEffect,
    Cogging,
    Delay,
    DriveEffect,
    Effect,
    PeriodicFriction,
    StribeckEffect,
)
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.model import parameters_of
from pyfmi_models.mount import Mount

LEAST_DELAY_SAMPLES, LEAST_DELAY = 0.3, 1.5e-4
"""A delay shorter than this many samples, or seconds, is what time stamps cannot be trusted for."""
LEAST_DRIFT_MS, LEAST_DRIFT = 1.0, 0.3
"""A clock that drifts by less than this, or than this share of its offset, over a recording is late like a delay."""
LEAST_CYCLES = 1.5
"""A ripple with fewer cycles a turn is an unbalance."""
BESIDE = 1.0
"""A cable whose home lies further beside the visited positions than this share of their range is an offset: of its
energy its change over the range has less than about 1 - `TIE`."""


def is_another(problem: Problem, effect: Effect) -> bool:
    """Whether an effect is really something else: a time-stamp convention, a level, an unbalance, a drift.

    So is what lies at a bound, and what no card may hold.
    """
    if effect.broken_rule() or at_bound(effect):
        return True
    if isinstance(effect, DriveEffect | ClockEffect):
        return _is_other_timing(problem, effect)
    if isinstance(effect, PeriodicDisturbance):
        slowest, fastest = heard(problem.prepared)
        return not bool(slowest <= effect.frequency_hz <= fastest)
    if isinstance(effect, CableWrap):
        return _is_far(problem.prepared, effect)
    if isinstance(effect, Cogging) and problem.mount.motion == "rotary":
        return bool(effect.cycles_per_rev < LEAST_CYCLES)
    return isinstance(effect, StribeckEffect) and bool(effect.Vs < LEAST_VS * problem.top_speed)


def needs_turns(effect: Effect, mount: Mount, prepared: Prepared) -> bool:
    """Whether a fitted effect of friction needs motion to turn back further than it ever did.

    Friction resists, so only motion that turns tells its level; where it goes one way a level is free to be anything: a
    contact that bends is then a lagged torque over speed, and friction over position a torque over position, cogging.
    """
    return _way_back_needed(effect, mount) > max(_way_back(piece.q[piece.inside]) for piece in prepared.pieces)


def _way_back_needed(effect: Effect, mount: Mount) -> float:
    """How far motion must turn back to show an effect [rad, m]: what a contact bends, half a wave over position."""
    if isinstance(effect, Presliding):
        return contact_level(mount) / float(effect.sigma0)
    if isinstance(effect, PeriodicFriction) and effect.cycles_per_rev > 0:
        turn = 1.0 if mount.motion == "linear" else 2 * math.pi
        return turn / (2 * float(effect.cycles_per_rev))
    return 0.0


def _way_back(q: Array) -> float:
    """Longest way back of a motion, whichever way it goes first."""
    return float(min((np.maximum.accumulate(q) - q).max(), (q - np.minimum.accumulate(q)).max()))


def _is_far(prepared: Prepared, cable: CableWrap) -> bool:
    low, high = prepared.ranges["q"]
    room = BESIDE * (high - low)
    return not low - room <= float(cable.home) <= high + room


def _is_other_timing(problem: Problem, effect: Effect) -> bool:
    """Whether a lateness is too short to be told from the time stamps', or lies in the clocks and not in the drive."""
    if isinstance(effect, Delay) and effect.delay_ms < 1e3 * max(
        LEAST_DELAY_SAMPLES * problem.sample_time, LEAST_DELAY
    ):
        return True
    late = _late(problem, effect)
    if late is None:
        return False
    return blamed(problem.prepared, late, problem.sample_time) == (
        "drive" if isinstance(effect, ClockSkew) else "clock"
    )


def _late(problem: Problem, effect: Effect) -> float | None:
    """Seconds by which an effect makes the torque late against the reading; None if it is not late.

    Of a clock that drifts it is the middle of a recording that counts, if late by a sample at least.
    """
    if isinstance(effect, Delay):
        return 1e-3 * float(effect.delay_ms)
    if isinstance(effect, ActuatorLag):
        return 1e-3 * float(effect.time_constant_ms)
    if not isinstance(effect, ClockSkew):
        return None
    offset, drift = float(effect.offset_ms), 1e-3 * float(effect.drift_ppm) * problem.seconds
    steady = abs(drift) < max(LEAST_DRIFT_MS, LEAST_DRIFT * abs(offset))
    late = -1e-3 * (offset + drift / 2)
    return late if late > (0 if steady else problem.sample_time) else None


def at_bound(effect: Effect) -> bool:
    """Whether a parameter of an effect is at the upper end of its range."""
    return any(variable.start >= variable.high for variable in parameters_of(effect))
