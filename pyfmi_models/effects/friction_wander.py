"""Friction level that wanders in time and jumps from one period to the next: a plant that is not stationary."""

from dataclasses import dataclass
from math import pi, sqrt, tan
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Motion, percent
from pyfmi_models.model import Scalar, parameter

WAVES = 8
"""Sines that stand for the slow random part; each carries the same share of its variance."""
QUANTILES = tuple(tan(pi / 2 * (wave + 0.5) / WAVES) for wave in range(WAVES))
"""Their angular frequencies times the correlation time, from 0.1 to 10 ..."""
JITTER = 0.35
"""... give or take this share, by the seed."""
LOWEST = 0.05
"""The level never falls below this share of itself."""
TURNOVER = 0.02
"""A jump takes this share of its period, so that solvers meet no step."""
MODULUS = 94906249.0
"""A prime whose square is below 2^53, so that products of numbers below it are exact in double precision."""
MULTIPLIER = 48271.0


@dataclass(frozen=True, kw_only=True)
class FrictionWander(FrictionEffect):
    """Friction level times 1 + r(t) + jump(t), a function of time and `seed` alone.

    r is a stationary random process with the spectrum of an Ornstein-Uhlenbeck process, std and correlation time as
    given, as a sum of sines that share its variance: smooth, and the same after a state was restored. `jump` is
    uniformly distributed with standard deviation `jump_std`, drawn anew every `jump_period` seconds. Time counts from
    the start of the simulation, so the same seed gives the same friction. Reference, for the sum of sines: Shinozuka,
    Deodatis, Applied Mechanics Reviews 44 (1991) 191.
    """

    id: ClassVar[str] = "friction_wander"
    title: ClassVar[str] = "Wandering friction"
    rivals: ClassVar[tuple[str, ...]] = ("position_friction", "thermal_viscosity")
    told_apart_by: ClassVar[str] = "the same motion twice gives another friction torque, without order"
    is_determined: ClassVar[bool] = False
    action: ClassVar[str] = (
        "Look for grease that moves, a loose seal or particles in the bearing; average over many runs."
    )
    std: Scalar = parameter("1", "Relative standard deviation of the slow random part", low=0, high=0.5)
    correlation_time: Scalar = parameter("s", "Correlation time of the slow random part", default=0.3, low=1e-3)
    jump_std: Scalar = parameter("1", "Relative standard deviation of the jumps", default=0.0, low=0, high=0.5)
    jump_period: Scalar = parameter("s", "Time from jump to jump", default=2.5, low=1e-2)
    seed: Scalar = parameter("1", "Seed of both, a whole number", default=0.0, low=0, high=1e6)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level (1 + r(t) + jump(t))`."""
        return level * ca.fmax(LOWEST, 1 + self._slow(motion.t) + self._jump(motion.t))

    def _slow(self, t: Scalar) -> Scalar:
        number, total = _scrambled(self.seed), ca.SX(0)
        for quantile in QUANTILES:
            number = _next(number)
            rate = quantile * (1 + JITTER * (2 * number / MODULUS - 1)) / self.correlation_time
            number = _next(number)
            total += ca.sin(rate * t + 2 * pi * number / MODULUS)
        return self.std * sqrt(2 / WAVES) * total

    def _jump(self, t: Scalar) -> Scalar:
        count = ca.floor(t / self.jump_period)
        x = ca.fmin((t / self.jump_period - count) / TURNOVER, 1)
        before, now = (self._drawn(count + back) for back in (-1, 0))
        return before + (now - before) * x * x * (3 - 2 * x)

    def _drawn(self, count: Scalar) -> Scalar:
        number = _scrambled(self.seed * 7919 + (count + 1) * 104729)
        return self.jump_std * sqrt(3) * (2 * number / MODULUS - 1)

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        slow = f"Friction wanders by {percent(self.std)} (RMS) within {self.correlation_time:.2g} s"
        jumps = f", and jumps by {percent(self.jump_std)} every {self.jump_period:.2g} s" if self.jump_std else ""
        return f"{slow}{jumps}: the same motion twice meets another friction."


def _scrambled(seed: Any) -> Any:
    """A number below `MODULUS` that looks random: squares keep neighbouring seeds from giving neighbouring numbers."""
    number = seed + 1
    for _ in range(3):
        number = _next(number)
        number = _rest(number * number)
    return number


def _next(number: Any) -> Any:
    return _rest(MULTIPLIER * number + 1)


def _rest(product: Any) -> Any:
    return product - MODULUS * ca.floor(product / MODULUS)
