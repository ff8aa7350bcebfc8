"""Hysteresis of belts and gears over position."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import LoadEffect, Main, Motion, words
from pyfmi_models.model import Scalar, Variable, parameter

SMALL = 1e-3
"""State below which |z|^(n - 1) becomes level: its slope at zero would be infinite for n < 2."""


@dataclass(frozen=True, kw_only=True)
class BoucWen(LoadEffect):
    """What belts, strain-wave gears and seals take to be bent: a torque that goes round a loop over position.

        torque = T z,   z' = [A v - beta |v| |z|^(n - 1) z - gamma v |z|^n] / stroke

    z grows along the motion to (A/(beta + gamma))^(1/n), 1 with the numbers by default, and turns with it over about
    `stroke`; nearly at rest its stiffness is T A / stroke. However fast the motion is, the loop is the same. Gamma =
    beta turns back along a straight line, gamma = -beta would never level off. The larger n, the sharper the knee.
    Where -beta < gamma <= beta it is bounded and passive from any z: it gives back at most z^2 T stroke / (2 A).
    z starts at 0. T, stroke, A, beta and gamma are two numbers too many for a loop, so a fit keeps A and beta.
    References: Wen, Journal of the Engineering Mechanics Division ASCE 102 (1976) 249; what the numbers may be:
    Ikhouane, Rodellar, Systems with Hysteresis, 2007, chapters 2 and 3; gears: Taghirad, Belanger, "An experimental
    study on modelling and identification of harmonic drive systems", CDC 1996.
    """

    id: ClassVar[str] = "bouc_wen"
    title: ClassVar[str] = "Hysteresis over position"
    equation: ClassVar[str] = "T z, z′ = [A v − β |v| |z|ⁿ⁻¹ z − γ v |z|ⁿ] / s"
    main: ClassVar[Main] = Main("torque")
    is_determined: ClassVar[bool] = False  # its rate is not linear in z: an inverse by such rates would be wrong
    to_record: ClassVar[str] = "record slow moves to and fro of several lengths, from short to long, about one place"
    rivals: ClassVar[tuple[str, ...]] = ("presliding", "cable_wrap", "backlash", "friction_asymmetry")
    told_apart_by: ClassVar[str] = "after a turn the torque changes over a way that is far longer than a contact bends"
    action: ClassVar[str] = "Look at belt tension and the gear's preload; for fine tracking use the improved model."
    remembers: ClassVar[tuple[Variable, ...]] = (
        Variable(name="z", unit="1", description="Hysteresis, along the motion"),
    )
    torque: Scalar = parameter("N.m", "Torque per unit of z; with the defaults, half the height of a long loop", low=0)
    stroke: Scalar = parameter("rad", "Way over which the loop turns round", low=1e-9, nominal=0.1)
    A: Scalar = parameter("1", "Rise of z where it is zero", default=1.0, low=1e-3, high=1e3, fitted=False)
    beta: Scalar = parameter("1", "Fall of the rise, whichever way z points", default=0.5, low=0, fitted=False)
    gamma: Scalar = parameter("1", "Fall of the rise along z, less that against it", default=0.5)
    n: Scalar = parameter("1", "Sharpness of the knee", default=1.0, low=1, high=10, fitted=False)

    def broken_rule(self) -> str:
        """The class of Bouc-Wen models that is bounded and passive from any state."""
        if -self.beta < self.gamma <= self.beta:
            return ""
        rule = f"must be above -beta and at most beta = {self.beta:g}"
        return f"gamma = {self.gamma:g} {rule}: only then z is bounded and gives no more energy than it took"

    def rate(self, motion: Motion) -> Any:
        """The equation above."""
        z, v = motion.state[0], motion.v
        bent = ca.exp((self.n - 1) / 2 * ca.log(z * z + SMALL * SMALL))
        return (self.A * v - bent * (self.beta * ca.fabs(v) * z + self.gamma * v * ca.fabs(z))) / self.stroke

    def load(self, motion: Motion) -> Scalar:
        """`T z`."""
        return self.torque * motion.state[0]

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        height = self.torque * (self.A / (self.beta + self.gamma)) ** (1 / self.n)
        stroke = f"{self.stroke:.3g} {words(unit)['way']}"
        return f"A belt or gear goes round a loop of {height:.3g} {unit} either way, within {stroke}."
