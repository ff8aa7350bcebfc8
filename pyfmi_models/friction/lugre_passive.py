"""LuGre with bristle damping that fades with speed: it never gives back more energy than it took."""

from dataclasses import dataclass
from math import e, sqrt
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.friction.base import each_way
from pyfmi_models.friction.lugre import LuGre
from pyfmi_models.model import Scalar, parameter

FASTEST = 4 * sqrt(2 * e)
"""Largest Vd sigma1 / g: `u exp(-(u / c)^2)`, greatest at u = c / sqrt(2), stays below 4 for c up to this number."""


@dataclass(frozen=True, kw_only=True)
class PassiveLuGre(LuGre):
    """Bristle friction whose damping fades with speed.

        dz/dt = v - sigma0 |v| z / g(v),   g(v) = Fc + (Fs - Fc) exp(-|v/Vs|^delta)
        F     = sigma0 z + sigma1 exp(-(v/Vd)^2) dz/dt + sigma2 v

    The bristles hold the energy sigma0 z^2 / 2. With x = sigma0 z / g and s = sigma1 exp(-(v/Vd)^2), what is wasted is

        F v - d/dt (sigma0 z^2 / 2) = g |v| x^2 - s |v| v x + (s + sigma2) v^2,

    never negative where s |v| <= 4 g(v). Without Vd the damping fades at Vd = 4 sqrt(2 e) g(v) / sigma1, the fastest
    that keeps this whatever the other numbers are and whatever effects make of the level. In presliding and in steady
    sliding it is `LuGre`. A stiffness sigma0 that depends on direction is no spring, and outside this proof.
    Reference: Olsson, Control Systems with Friction, PhD thesis, Lund (1996).
    """

    key: ClassVar[str] = "lugre_passive"
    rivals: ClassVar[tuple[str, ...]] = ()
    Vd: Scalar = parameter(
        "rad/s", "Speed at which damping fades; none: the fastest that is passive", default=None, low=1e-9, nominal=0.01
    )

    def contact(self, state: Any, v: Scalar, level: Scalar) -> Scalar:
        """`sigma0 z + sigma1 exp(-(v/Vd)^2) dz/dt`."""
        ratio = self.sigma1 * v / (FASTEST * level) if self.Vd is None else v / self.Vd
        return state + self.sigma1 * ca.exp(-(ratio**2)) * self._deflection_rate(state, v, level)

    def broken_passivity(self) -> str:
        """Say where Vd lets the bristles give energy back; sufficient, so a law that is passive may be told."""
        for law in each_way(self) if self.Vd is not None else ():
            fastest = FASTEST * law.Fc / law.sigma1 if law.sigma1 else law.Vd
            if law.Vd > fastest:
                rule = f"up to 4 sqrt(2 e) Fc / sigma1 = {fastest:.3g} rad/s the bristles cannot give energy back"
                return f"Vd = {law.Vd:.3g}: only {rule}"
        return ""
