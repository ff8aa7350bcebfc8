"""The contract of a friction law.

A law splits the friction torque into a contact part, bounded by a *level* g(v) >= 0, and a viscous part:

    tau_f = contact(state, v, level) + viscous(v).

Effects change the level and the viscous torque from outside (by position, temperature, direction) and never touch the
law. Signs: tau_f resists, so it has the sign of v in steady sliding.
"""

from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, TypeVar

import casadi as ca

from pyfmi_models.model import Pair, Part, Recorded, Scalar, Variable, parameter

LEAST_VS, MOST_FS = 0.005, 5.0
"""Stribeck curves narrower than this share of the top speed, or higher than this times their start, are not fitted."""


@dataclass(frozen=True, kw_only=True)
class FrictionLaw(Part):
    """A friction law; subclasses state their equation, their limits and their reference."""

    place: ClassVar[str] = "Friction"
    key: ClassVar[str]
    linear: ClassVar[tuple[str, ...]] = ()
    """Parameters in which the torque is linear: a tangent holds however far they move."""
    rivals: ClassVar[tuple[str, ...]] = ()
    """Keys of the laws that recordings should be compared with, beside this one."""
    in_rows: ClassVar[bool] = False
    """Whether it is a row of elements: another such law with free shares tells whether recordings follow it."""

    def states(self) -> tuple[Variable, ...]:
        """Name the internal states of the contact, in N m (N for a linear axis)."""
        return ()

    def level(self, v: Scalar) -> Scalar:
        """Steady sliding level g(v) >= 0 of the contact part [N m] at speed v [rad/s]."""
        raise TypeError(f"{type(self).__name__} has no level")

    def viscous(self, v: Scalar) -> Scalar:
        """Viscous torque [N m] at speed v [rad/s], odd in v."""
        raise TypeError(f"{type(self).__name__} has no viscous part")

    def rate(self, state: Any, v: Scalar, level: Scalar) -> Any:
        """Time derivative of the states at speed v and level g(v), a column; each depends on its own state only."""
        return ca.SX(0, 1)

    def advance(self, state: Any, v: Scalar, level: Scalar, dt: Scalar) -> Any:
        """States after dt seconds at constant speed v, in closed form; each depends on its own state only."""
        return state

    def contact(self, state: Any, v: Scalar, level: Scalar) -> Scalar:
        """Contact torque [N m]."""
        raise TypeError(f"{type(self).__name__} has no contact torque")

    def steady(self) -> "MemorylessLaw":
        """Return the law's own static map: its torque in steady sliding."""
        raise TypeError(f"{type(self).__name__} has no static map")

    def fit_bounds(self, variable: Variable, recorded: Recorded) -> tuple[float, float]:
        """Those of a Stribeck curve, if it has one."""
        return stribeck_bounds(variable, recorded)

    def broken_passivity(self) -> str:
        """Say which rule lets some motion take more energy from the contact than it gave; "" where none does."""
        return ""


class GreasedLaw(FrictionLaw):
    """A law with a viscous torque that is proportional to speed: its `Fc` and `sigma2` enter linearly."""

    linear: ClassVar[tuple[str, ...]] = ("Fc", "sigma2")
    sigma2: Scalar

    def viscous(self, v: Scalar) -> Scalar:
        """`sigma2 v`."""
        return self.sigma2 * v


@dataclass(frozen=True, kw_only=True)
class MemorylessLaw(FrictionLaw):
    """A law whose contact torque follows the speed at once: level times a steep, smooth sign of v."""

    smoothing: Scalar = parameter(
        "rad/s",
        "Speed below which the sign of the speed is smoothed",
        default=1e-5,
        low=1e-9,
        nominal=1e-5,
        tunable=False,
        fitted=False,
    )

    def contact(self, state: Any, v: Scalar, level: Scalar) -> Scalar:
        """`level tanh(v / smoothing)`."""
        return level * ca.tanh(v / self.smoothing)

    def steady(self) -> "MemorylessLaw":
        """Return the law itself."""
        return self


Law = TypeVar("Law", bound=FrictionLaw)


def each_way(law: Law) -> tuple[Law, Law]:
    """Return the law of either direction, the positive one first: each `Pair` becomes the number of that side."""
    pairs = {one.name: value for one in fields(law) if isinstance(value := getattr(law, one.name), Pair)}
    positive, negative = ({name: getattr(pair, side) for name, pair in pairs.items()} for side in Pair._fields)
    return replace(law, **positive), replace(law, **negative)


def stribeck_decay(v: Scalar, Vs: Scalar, delta: Scalar) -> Scalar:
    """`exp(-|v/Vs|^delta)`, with finite derivatives in all arguments at v = 0 and far above Vs."""
    # The power has no finite derivatives at 0; 1e-12 Vs beside it they are, and far above Vs, up to |v| = 1e60 Vs.
    return ca.exp(-ca.power(ca.fabs(v) / Vs + 1e-12, delta))


def stribeck_level(v: Scalar, Fc: Scalar, Fs: Scalar, Vs: Scalar, delta: Scalar) -> Scalar:
    """`Fc + (Fs - Fc) exp(-|v/Vs|^delta)`, or Fc where there is no Stribeck term (Fs or Vs is None)."""
    if Fs is None or Vs is None:
        return Fc
    return Fc + (Fs - Fc) * stribeck_decay(v, Vs, delta)


def stribeck_bounds(variable: Variable, recorded: Recorded) -> tuple[float, float]:
    """Bounds in a fit: a Stribeck curve needs recorded speeds beside its own; other parameters have their own."""
    if variable.name == "Vs":
        return min(LEAST_VS * recorded.speed, variable.start), recorded.speed
    if variable.name == "Fs":
        return variable.low, max(MOST_FS * variable.start, variable.low)
    return variable.low, variable.high
