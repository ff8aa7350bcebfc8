"""Dahl: a contact that yields with displacement."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.friction.base import GreasedLaw
from pyfmi_models.friction.coulomb import Coulomb
from pyfmi_models.model import Scalar, Variable, parameter

FLOOR = 1e-9
"""Distance from the level, as a share of it, below which the power of a shape exponent under 1 is smoothed."""


@dataclass(frozen=True, kw_only=True)
class Dahl(GreasedLaw):
    """Elastic at first, softer towards the level, where it slides.

        dF/dt = sigma0 v sign(u) |u|^n,   u = 1 - F sign(v) / Fc        tau_f = F + sigma2 v

    With n = 1 this is LuGre with sigma1 = 0 and Fs = Fc. The hysteresis depends on the path only, never on the speed;
    there is no break-away peak, and small inner loops drift instead of closing: `MaxwellSlip` closes them.
    Reference: Dahl, AIAA Journal 14 (1976) 1675.
    """

    key: ClassVar[str] = "dahl"
    rivals: ClassVar[tuple[str, ...]] = ("lugre", "maxwell_slip")
    sigma0: Scalar = parameter("N.m/rad", "Stiffness of the contact at zero torque", low=1e-6, nominal=1e4)
    Fc: Scalar = parameter("N.m", "Friction level in sliding", low=1e-9)
    n: Scalar = parameter(
        "1", "Shape exponent: how early the contact softens", default=1.0, low=0.5, high=5, fitted=False
    )
    sigma2: Scalar = parameter("N.m.s/rad", "Viscous friction coefficient", default=0.0, low=0)

    def states(self) -> tuple[Variable, ...]:
        """One state: the torque of the contact."""
        return (Variable(name="bristle", unit="N.m", description="Torque of the contact", nominal=1.0),)

    def level(self, v: Scalar) -> Scalar:
        """`Fc`."""
        return self.Fc

    def _power(self, u: Scalar) -> Scalar:
        """`|u|^(n - 1)`; below `FLOOR` it stays finite, and so do its derivatives."""
        return ca.exp((self.n - 1) / 2 * ca.log(u**2 + FLOOR**2))

    def rate(self, state: Any, v: Scalar, level: Scalar) -> Any:
        """`sigma0 v sign(u) |u|^n`."""
        u = 1 - ca.sign(v) * state / level
        return self.sigma0 * v * u * self._power(u)

    def advance(self, state: Any, v: Scalar, level: Scalar, dt: Scalar) -> Any:
        """Solve the equation exactly for constant speed: `u = u0 (1 + (n - 1) d |u0|^(n - 1))^(-1 / (n - 1))`.

        d is the distance moved in units of level / sigma0; for n = 1 the limit is `u0 exp(-d)`.
        """
        u = 1 - ca.sign(v) * state / level
        moved = self.sigma0 * ca.fabs(v) * dt / level * self._power(u)
        decay = ca.exp(-moved * _log1p_ratio((self.n - 1) * moved))
        return level * ca.sign(v) * (1 - decay) + decay * state

    def contact(self, state: Any, v: Scalar, level: Scalar) -> Scalar:
        """The state."""
        return state

    def steady(self) -> Coulomb:
        """Return the law's own steady sliding map."""
        return Coulomb(Fc=self.Fc, sigma2=self.sigma2)


def _log1p_ratio(x: Scalar) -> Scalar:
    """`log(1 + x) / x`, its series near 0; an x below -1, where a brittle contact slides fully, counts as -1."""
    small = ca.fabs(x) < 1e-4
    safe = ca.if_else(small, 1, ca.fmax(x, -1 + 1e-15))
    return ca.if_else(small, 1 - x / 2 + x**2 / 3 - x**3 / 4, ca.log1p(safe) / safe)
