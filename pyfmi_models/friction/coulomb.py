"""Coulomb and viscous friction."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.friction.base import GreasedLaw, MemorylessLaw
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class Coulomb(GreasedLaw, MemorylessLaw):
    """Constant level against the direction of motion, and a torque proportional to speed.

        F(v) = Fc sign(v) + sigma2 v

    Discontinuous at v = 0, where the sign is smoothed over `smoothing`: no stiction, the axis creeps under load.
    """

    key: ClassVar[str] = "coulomb"
    Fc: Scalar = parameter("N.m", "Coulomb friction level", low=0)
    sigma2: Scalar = parameter("N.m.s/rad", "Viscous friction coefficient", default=0.0, low=0)

    def level(self, v: Scalar) -> Scalar:
        """`Fc`."""
        return self.Fc


@dataclass(frozen=True, kw_only=True)
class Frictionless(MemorylessLaw):
    """No friction at all."""

    key: ClassVar[str] = "none"

    def level(self, v: Scalar) -> Scalar:
        """Zero."""
        return 0 * v

    def viscous(self, v: Scalar) -> Scalar:
        """Zero."""
        return 0 * v
