"""Bristles below break-away."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main
from pyfmi_models.friction.base import FrictionLaw, each_way
from pyfmi_models.friction.lugre import LuGre
from pyfmi_models.model import Scalar, Variable, parameter

LEAST_LEVEL = 1e-9
"""Friction level [N m] below which a bristle is as good as none."""
FAST = 1e9
"""Speed [rad/s] at which no Stribeck term is left."""


@dataclass(frozen=True, kw_only=True)
class Presliding(FrictionEffect):
    """A contact that bends before it slides, under the level and the viscous torque of the card's law.

        dz/dt = v - sigma0 |v| z / level,   contact = sigma0 z + sigma1 dz/dt

    It replaces the contact of the law: for a law without memory its sign of v, for a law with bristles these, whose
    own numbers then say nothing. Reference: LuGre, see `pyfmi_models.friction.lugre`.
    """

    id: ClassVar[str] = "presliding"
    title: ClassVar[str] = "Presliding"
    equation: ClassVar[str] = "dz/dt = v − σ₀ |v| z / g(v)"
    main: ClassVar[Main] = Main("sigma0", unit="N.m/rad", is_size=False)
    to_record: ClassVar[str] = "record small, slow reversals"
    rivals: ClassVar[tuple[str, ...]] = ("stribeck", "dwell_breakaway", "backlash", "compliance")
    told_apart_by: ClassVar[str] = "below break-away the axis springs back when released; with play it does not"
    action: ClassVar[str] = "Nothing needs repair: contacts bend. For fine tracking use the improved model."
    says: ClassVar[str] = "Before it slides the axis bends like a spring of {0.sigma0:.3g} {unit} per {way}."
    sigma0: Scalar = parameter("N.m/rad", "Stiffness of the contact below break-away", low=1e-6, nominal=1e4)
    sigma1: Scalar = parameter("N.m.s/rad", "Damping of the contact", default=0.0, low=0, nominal=100)

    def law(self, law: FrictionLaw) -> FrictionLaw:
        """The law behind bristles of this stiffness."""
        return _Bristled(law=law, bristles=LuGre(sigma0=self.sigma0, sigma1=self.sigma1, Fc=LEAST_LEVEL))


@dataclass(frozen=True, kw_only=True)
class _Bristled(FrictionLaw):
    """Level and viscous torque of one law, contact of another."""

    law: FrictionLaw
    bristles: LuGre

    def states(self) -> tuple[Variable, ...]:
        return self.bristles.states()

    def level(self, v: Scalar) -> Scalar:
        return self.law.level(v)

    def viscous(self, v: Scalar) -> Scalar:
        return self.law.viscous(v)

    def rate(self, state: Any, v: Scalar, level: Scalar) -> Any:
        return self.bristles.rate(state, v, ca.fmax(level, LEAST_LEVEL))

    def advance(self, state: Any, v: Scalar, level: Scalar, dt: Scalar) -> Any:
        return self.bristles.advance(state, v, ca.fmax(level, LEAST_LEVEL), dt)

    def contact(self, state: Any, v: Scalar, level: Scalar) -> Scalar:
        return self.bristles.contact(state, v, ca.fmax(level, LEAST_LEVEL))

    def broken_passivity(self) -> str:
        """Say where a level that falls with speed lets the damping of the bristles give energy back, see `LuGre`."""
        for law in each_way(self.law):
            peak, low, viscous = (float(value) for value in (law.level(0.0), law.level(FAST), law.viscous(1.0)))
            needed = self.bristles.sigma1 * (peak / max(low, LEAST_LEVEL) - 1)
            if viscous < needed:
                rule = f"the viscous coefficient, {viscous:.3g}, would need to be {needed:.3g} N.m.s/rad"
                return f"sigma1 = {self.bristles.sigma1:.3g} of presliding: {rule}"
        return ""
