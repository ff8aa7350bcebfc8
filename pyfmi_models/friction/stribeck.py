"""The static map: Stribeck friction without memory."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.friction.base import MemorylessLaw, stribeck_level
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class Stribeck(MemorylessLaw):
    """Steady sliding friction that falls from break-away to Coulomb level.

        F(v) = [Fc + (Fs - Fc) exp(-|v/Vs|^delta)] sign(v) + sigma2 v

    Discontinuous at v = 0: where arcseconds before break-away matter, use `LuGre`.
    Reference: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.
    """

    key: ClassVar[str] = "static"
    linear: ClassVar[tuple[str, ...]] = ("Fc", "sigma2")
    Fc: Scalar = parameter("N.m", "Coulomb level at high speed", low=0)
    Fs: Scalar = parameter("N.m", "Break-away level at rest; none: Fc, no Stribeck term", default=None, low=0)
    Vs: Scalar = parameter("rad/s", "Stribeck speed", default=None, low=1e-9)
    delta: Scalar = parameter("1", "Shape exponent of the Stribeck curve", default=2.0, low=0.1, high=5, fitted=False)
    sigma2: Scalar = parameter("N.m.s/rad", "Viscous friction coefficient", default=0.0, low=0)

    def level(self, v: Scalar) -> Scalar:
        """`Fc + (Fs - Fc) exp(-|v/Vs|^delta)`."""
        return stribeck_level(v, self.Fc, self.Fs, self.Vs, self.delta)

    def viscous(self, v: Scalar) -> Scalar:
        """`sigma2 v`."""
        return self.sigma2 * v
