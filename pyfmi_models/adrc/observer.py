"""The extended state observer: position, speed, residual acceleration and, if wanted, its derivative."""

from dataclasses import dataclass
from math import factorial
from typing import Any, Literal

import casadi as ca

from pyfmi_models.model import Scalar, Variable

STATES = (
    Variable(name="observer.q", unit="rad", description="zeta1, observed position"),
    Variable(name="observer.v", unit="rad/s", description="zeta2, observed speed"),
    Variable(name="observer.a", unit="rad/s2", description="zeta3, observed residual acceleration"),
    Variable(name="observer.j", unit="rad/s3", description="zeta4, derivative of the residual acceleration"),
)


@dataclass(frozen=True, kw_only=True)
class Observer:
    """Extended state observer: exact prediction under a known push, then correction by what the encoder reads.

        zeta1 += h zeta2 + h^2/2 (zeta3 + push),  zeta2 += h (zeta3 + push)                        prediction, order 3
        zeta1 += (1 - b^3) r,   zeta2 += 3/2 (1 - b)^2 (1 + b)/h r,   zeta3 += (1 - b)^3/h^2 r     correction

    h is the period, r = q - zeta1 the surprise, b = exp(-bandwidth h) the place of all poles; `push` [rad/s2] is the
    torque that acted less the expected torque, over the inertia. At the first tick zeta1 starts at q. Order 3 takes the
    residual torque for constant between two ticks and lags behind a growing one; order 4 adds its derivative zeta4,
    follows a torque that grows at a constant rate without lag, and costs phase margin.
    References: Miklosovic, Radke, Gao, American Control Conference 2006, 3665; the gains are those of a fading-memory
    polynomial filter: Morrison, Introduction to Sequential Smoothing and Prediction, 1969, chapter 13.
    """

    order: Literal[3, 4] = 3

    def states(self) -> tuple[Variable, ...]:
        """zeta1 .. zeta3 or zeta4."""
        return STATES[: self.order]

    def update(self, zeta: list[Any], push: Scalar, q: Scalar, bandwidth: Scalar, period: float) -> list[Any]:
        """Return the states after a tick over which the known torques gave `push` [rad/s2]."""
        known = [zeta[0], zeta[1], zeta[2] + push, *zeta[3:]]
        predicted = [_taylor(known[k:], period) for k in range(self.order)]
        predicted[2] = predicted[2] - push
        surprise = q - predicted[0]
        gains = self.gains(ca.exp(-bandwidth * period), period)
        return [value + gain * surprise for value, gain in zip(predicted, gains, strict=True)]

    def gains(self, pole: Scalar, period: float) -> list[Scalar]:
        """Correction gains that put every pole of the observer at `pole`."""
        a, h = 1 - pole, period
        if self.order == 3:
            return [1 - pole**3, 1.5 * a**2 * (1 + pole) / h, a**3 / h**2]
        return [
            1 - pole**4,
            a**2 * (11 + 14 * pole + 11 * pole**2) / (6 * h),
            2 * a**3 * (1 + pole) / h**2,
            a**4 / h**3,
        ]


def _taylor(derivatives: list[Any], h: float) -> Any:
    return sum(value * h**n / factorial(n) for n, value in enumerate(derivatives))
