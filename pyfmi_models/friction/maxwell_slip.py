"""Generalised Maxwell slip: many elements side by side, each elastic until it slips."""

from dataclasses import dataclass
from math import tanh
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.friction.base import each_way
from pyfmi_models.friction.stribeck import StribeckContact
from pyfmi_models.model import Scalar, Variable, parameter


@dataclass(frozen=True, kw_only=True)
class MaxwellSlip(StribeckContact):
    """N elements share the Stribeck level g(v); each is a spring that slips at its part of it.

        dF_i/dt = k_i v tanh(attraction (1 - F_i sign(v) / (g(v) / N)))
        tau_f   = sum F_i + sigma1 sum dF_i/dt / sigma0 + sigma2 v,      sum k_i = sigma0

    Far below its level an element sticks (tanh = 1: a spring); at its level it slips and follows it. The reference
    switches between dF_i/dt = k_i v and dF_i/dt = sign(v) C (alpha_i - F_i / s(v)); here tanh passes smoothly from one
    to the other, with C = attraction k_i |v| / alpha_i: an element reaches its level over a distance, not a time. So
    presliding does not depend on speed, elements never create energy, and derivatives are finite at rest.
    The levels are equal; the displacements at which the elements slip grow geometrically, the last being `spread` times
    the first: with the default the first loading follows Dahl's exponential within 6 % of the level.

    Hysteresis obeys Masing's rules, and inner loops close (non-local memory), both within 1.5 level / (N attraction).
    The elements are passive; their damping sigma1 is only with sigma2 >= sigma1 tanh(attraction (Fs - Fc) / Fc), see
    `LuGre`.
    Reference: Al-Bender, Lampaert, Swevers, IEEE Trans. Autom. Control 50 (2005) 1883.
    """

    key: ClassVar[str] = "maxwell_slip"
    rivals: ClassVar[tuple[str, ...]] = ("lugre",)
    in_rows: ClassVar[bool] = True
    elements: ClassVar[int] = 8
    """Number of elements; another number is another structure, so a subclass."""
    sigma0: Scalar = parameter("N.m/rad", "Stiffness of all elements together", low=1e-6, nominal=1e4)
    sigma1: Scalar = parameter("N.m.s/rad", "Damping of the elements together", default=0.0, low=0, nominal=100)
    spread: Scalar = parameter(
        "1",
        "Slip displacement of the last element over the first",
        default=18.0,
        low=1,
        high=1e6,
        tunable=False,
        fitted=False,
    )
    attraction: Scalar = parameter(
        "1", "Sharpness of the passage to slip", default=50.0, low=20, high=1000, tunable=False, fitted=False
    )

    def states(self) -> tuple[Variable, ...]:
        """One state an element: its torque, from the stiffest to the softest."""
        names = [f"element_{index}" for index in range(1, self.elements + 1)]
        return tuple(Variable(name=name, unit="N.m", description="Torque of an element", nominal=0.1) for name in names)

    def stiffness(self) -> Any:
        """Stiffness of each element [N m/rad], a column whose sum is sigma0; N > 1."""
        ratio, shares = ca.exp(-ca.log(self.spread) / (self.elements - 1)), [1.0]
        while len(shares) < self.elements:
            shares.append(shares[-1] * ratio)
        return self.sigma0 / sum(shares) * ca.vertcat(*shares)

    def _gap(self, state: Any, v: Scalar, level: Scalar) -> Any:
        """What an element lacks to its level, as a share of it."""
        return 1 - ca.sign(v) * state * self.elements / level

    def rate(self, state: Any, v: Scalar, level: Scalar) -> Any:
        """`k_i v tanh(attraction gap_i)`."""
        return self.stiffness() * v * ca.tanh(self.attraction * self._gap(state, v, level))

    def advance(self, state: Any, v: Scalar, level: Scalar, dt: Scalar) -> Any:
        """Solve the equation exactly for constant speed: `sinh(attraction gap)` decays with the distance."""
        gap = self._gap(state, v, level)
        moved = self.stiffness() * ca.fabs(v) * dt * self.elements / level
        left = _decayed(self.attraction * gap, self.attraction * moved) / self.attraction
        return state + level / self.elements * ca.sign(v) * (gap - left)

    def contact(self, state: Any, v: Scalar, level: Scalar) -> Scalar:
        """`sum F_i + sigma1 sum dF_i/dt / sigma0`."""
        return ca.sum1(state) + self.sigma1 * ca.sum1(self.rate(state, v, level)) / self.sigma0

    def broken_passivity(self) -> str:
        """Say where, in either direction, elements that fall from Fs to Fc give back by damping what sigma2 leaves."""
        for law in each_way(self):
            needed = 0.0 if law.Fs is None else law.sigma1 * tanh(law.attraction * (law.Fs - law.Fc) / law.Fc)
            if law.sigma2 < needed:
                rule = f"it would need sigma1 tanh(attraction (Fs - Fc) / Fc) = {needed:.3g} N.m.s/rad"
                return f"sigma2 = {law.sigma2:.3g}: {rule}"
        return ""


def _decayed(x: Scalar, distance: Scalar) -> Scalar:
    """`asinh(sinh(x) exp(-distance))` for distance >= 0, also where sinh(x) is too large for a number."""
    side = ca.if_else(x < 0, -1, 1)  # not sign(x): its zero at x = 0 would hide the derivative there
    size = side * x
    whole = ca.fmax(size - distance, 0)
    part = (ca.exp(size - distance - whole) - ca.exp(-size - distance - whole)) / 2
    return side * (whole + ca.log(part + ca.sqrt(part**2 + ca.exp(-2 * whole))))
