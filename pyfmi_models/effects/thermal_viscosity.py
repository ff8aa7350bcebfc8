"""Friction that drifts with temperature."""

from dataclasses import dataclass
from math import expm1
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion, percent, words
from pyfmi_models.model import Recorded, Scalar, Variable, parameter

REFERENCE = 20.0
"""Temperature [degC] at which the card's friction holds."""
LEAST_WARMING = 2.0
"""Seconds in which a bearing warms or cools at the fastest."""
MOST_WARMING = 1e5
"""Seconds in which one warms or cools at the slowest, about a day: what is slower is not seen to end."""


@dataclass(frozen=True, kw_only=True)
class ThermalViscosity(FrictionEffect):
    """Viscous torque times exp(kv (T - 20 degC)), friction level times exp(kc (T - 20 degC)).

    T is the plant's input `temperature`. To first order the exponents are the relative change per degree at 20 degC.
    Reference: exponential viscosity law of Reynolds, Phil. Trans. R. Soc. 177 (1886) 157.
    """

    id: ClassVar[str] = "thermal_viscosity"
    title: ClassVar[str] = "Thermal friction"
    equation: ClassVar[str] = "F exp(k₁ (T − 20 °C)) + σ₂ v exp(k₂ (T − 20 °C))"
    main: ClassVar[Main] = Main("viscous_per_degC", 100.0, "%/K")
    to_record: ClassVar[str] = "record 20 min from cold, with the temperature"
    rivals: ClassVar[tuple[str, ...]] = ("quadratic_drag",)
    told_apart_by: ClassVar[str] = "the same fast move differs early and late, cold and warm; drag does not"
    action: ClassVar[str] = "Warm the axis up before identification, or record the temperature with it."
    reads: ClassVar[tuple[Variable, ...]] = (
        Variable(name="temperature", unit="degC", description="Temperature of the bearing", start=REFERENCE),
    )
    viscous_per_degC: Scalar = parameter("1/K", "Relative change of viscous friction per degree", low=-1, high=1)
    coulomb_per_degC: Scalar = parameter(
        "1/K", "Relative change of the friction level per degree", default=0.0, low=-1, high=1
    )

    def warmth(self, motion: Motion) -> Scalar:
        """`T - 20 degC`."""
        return motion.inputs["temperature"] - REFERENCE

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level exp(kc (T - 20))`."""
        return level * ca.exp(self.coulomb_per_degC * self.warmth(motion))

    def viscous(self, viscous: Scalar, motion: Motion) -> Scalar:
        """`viscous exp(kv (T - 20))`."""
        return viscous * ca.exp(self.viscous_per_degC * self.warmth(motion))

    def leading(self) -> Main:
        """The larger of the two changes."""
        sliding = abs(self.coulomb_per_degC) > abs(self.viscous_per_degC)
        return self.main._replace(parameter="coulomb_per_degC", unit="%/K sliding") if sliding else self.main

    def change(self, per_degree: float) -> float:
        """The relative change that a text gives, of a coefficient: here that of one degree."""
        return per_degree

    def by(self, unit: str) -> str:
        """What the change goes with, in words; `unit` is the torque or force unit."""
        return "per degree"

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        parts = {"Viscous friction": self.viscous_per_degC, "Sliding friction": self.coulomb_per_degC}
        said = [f"{name} {_changes(self.change(value))} {self.by(unit)}" for name, value in parts.items() if value]
        return " and ".join([*said[:1], *(text.lower() for text in said[1:])] or ["Friction keeps its size"]) + "."


class _HeatedViscosity(ThermalViscosity):
    """The same where use heats the bearing: its own temperature is that of its surroundings and a rise.

    No thermometer has seen the rise: texts give what friction changes by, and over what time or way, not per degree.
    """

    remembers: ClassVar[tuple[Variable, ...]] = (
        Variable(name="rise", unit="K", description="Rise of temperature in use"),
    )

    def leading(self) -> Main:
        """The larger of the two changes, as a text gives it."""
        name, *_, is_size = super().leading()
        number = float(getattr(self, name))
        return Main(name, 100 * self.change(number) / number if number else 0.0, f"% {self.by('rad')}", is_size)

    def warmth(self, motion: Motion) -> Scalar:
        """`temperature + rise - 20 degC`."""
        return super().warmth(motion) + motion.state[0]

    def fit_bounds(self, variable: Variable, recorded: Recorded) -> tuple[float, float]:
        """Faster than `LEAST_WARMING`, a warm-up is a friction that depends on speed; a card's own time is kept."""
        if variable.name not in ("warm_up_s", "cooling_s"):
            return variable.low, variable.high
        return min(LEAST_WARMING, variable.start), max(MOST_WARMING, variable.start)


@dataclass(frozen=True, kw_only=True)
class WarmingViscosity(_HeatedViscosity):
    """The same where friction heats the bearing above its surroundings: T = `temperature` + rise.

        rise' = (warm_up_degC - rise) / warm_up_s

    `rise` starts cold, at 0; set its start to begin warm. The rise follows time, not friction power: the bearing is
    taken to be in use all the while.
    """

    warm_up_degC: Scalar = parameter("K", "Rise of temperature once warm", low=0, high=200, fitted=False)
    warm_up_s: Scalar = parameter("s", "Time constant of warming up", default=600.0, low=1e-3)

    def change(self, per_degree: float) -> float:
        """`exp(k warm_up_degC) - 1`: that of an axis that is warm."""
        return expm1(per_degree * float(self.warm_up_degC))

    def by(self, unit: str) -> str:
        """Three time constants, in which 95 % of the rise are done."""
        seconds = 3 * self.warm_up_s
        return "in the first " + (f"{seconds:.2g} s" if seconds < 100 else f"{seconds / 60:.2g} min")

    def rate(self, motion: Motion) -> Any:
        """`(warm_up_degC - rise) / warm_up_s`."""
        return (self.warm_up_degC - motion.state[0]) / self.warm_up_s


@dataclass(frozen=True, kw_only=True)
class RubbedViscosity(_HeatedViscosity):
    """The same where rubbing heats the bearing, and rest lets it cool: T = `temperature` + rise.

        rise' = heat_degC_per_rad |v| - rise / cooling_s

    `rise` starts cold, at 0. The power of friction is taken to go with the speed, as that of dry friction does.
    Reference: first-order heat balance of Incropera, Fundamentals of Heat and Mass Transfer, chapter 5.1.
    """

    heat_degC_per_rad: Scalar = parameter(
        "K/rad", "Rise of temperature per angle rubbed", low=0, high=1e6, fitted=False
    )
    cooling_s: Scalar = parameter("s", "Time constant of cooling down", default=600.0, low=1e-3)

    def change(self, per_degree: float) -> float:
        """`k heat`: that of one radian or metre, while nothing has cooled."""
        return per_degree * float(self.heat_degC_per_rad)

    def by(self, unit: str) -> str:
        """The way that is rubbed."""
        return f"per {words(unit)['way']} rubbed"

    def rate(self, motion: Motion) -> Any:
        """`heat |v| - rise / cooling_s`."""
        return self.heat_degC_per_rad * ca.fabs(motion.v) - motion.state[0] / self.cooling_s


def _changes(share: float) -> str:
    return f"{'grows' if share > 0 else 'falls'} by {percent(abs(share))}"
