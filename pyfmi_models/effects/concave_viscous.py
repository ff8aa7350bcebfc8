"""Viscous friction that rises less than linearly, or falls above a speed."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion, words
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class ConcaveViscous(FrictionEffect):
    """Grease that thins when it is sheared: the viscous torque times [1 + (v/v_thin)^2]^((n - 1)/2).

    Far below `thinning_speed` it is the law's own line, far above a power n of the speed: below 1 it rises less
    and less, at 0 it is level, below 0 it falls, as where a film is warmed by its own shear.
    Reference: Carreau, Transactions of the Society of Rheology 16 (1972) 99; of a film that falls: Archard and Cowking,
    Proc. Instn. Mech. Engrs. 180 (1965) 47.
    """

    id: ClassVar[str] = "concave_viscous"
    title: ClassVar[str] = "Concave viscous friction"
    equation: ClassVar[str] = "σ₂ v [1 + (v/vₜ)²]^((n − 1)/2)"
    main: ClassVar[Main] = Main("exponent", unit="as power of speed", is_size=False)
    to_record: ClassVar[str] = "record steady speeds up to the highest that is allowed, three a decade"
    rivals: ClassVar[tuple[str, ...]] = ("stribeck", "thermal_viscosity", "quadratic_drag")
    told_apart_by: ClassVar[str] = "the curve over the speed is the same early and late, and bends at high speed"
    action: ClassVar[str] = "Ask for the flow curve of the grease; at high speed use the improved model."
    thinning_speed: Scalar = parameter("rad/s", "Speed from which on the grease thins", low=1e-9, nominal=0.1)
    exponent: Scalar = parameter("1", "Power of the speed far above it", default=0.0, low=-1, high=1)

    def viscous(self, viscous: Scalar, motion: Motion) -> Scalar:
        """The equation above."""
        ratio = motion.v / self.thinning_speed
        return viscous * ca.exp((self.exponent - 1) / 2 * ca.log1p(ratio * ratio))

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        how = "falls" if self.exponent < 0 else "rises less than the speed"
        return f"Above {self.thinning_speed:.3g} {words(unit)['speed']} viscous friction {how}: the grease thins."
