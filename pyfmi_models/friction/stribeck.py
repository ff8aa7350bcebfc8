"""The static map: Stribeck friction without memory."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.friction.base import GreasedLaw, MemorylessLaw, stribeck_level
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class Stribeck(GreasedLaw, MemorylessLaw):
    """Steady sliding friction that falls from break-away to Coulomb level.

        F(v) = [Fc + (Fs - Fc) exp(-|v/Vs|^delta)] sign(v) + sigma2 v

    Discontinuous at v = 0: where arcseconds before break-away matter, use `LuGre`.
    Reference: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.
    """

    key: ClassVar[str] = "static"
    Fc: Scalar = parameter("N.m", "Coulomb level at high speed", low=0)
    Fs: Scalar = parameter("N.m", "Break-away level at rest; none: Fc, no Stribeck term", default=None, low=0)
    Vs: Scalar = parameter("rad/s", "Stribeck speed", default=None, low=1e-9)
    delta: Scalar = parameter("1", "Shape exponent of the Stribeck curve", default=2.0, low=0.1, high=5, fitted=False)
    sigma2: Scalar = parameter("N.m.s/rad", "Viscous friction coefficient", default=0.0, low=0)

    def level(self, v: Scalar) -> Scalar:
        """`Fc + (Fs - Fc) exp(-|v/Vs|^delta)`."""
        return stribeck_level(v, self.Fc, self.Fs, self.Vs, self.delta)


@dataclass(frozen=True, kw_only=True)
class StribeckContact(GreasedLaw):
    """A contact that bends before it slides, and slides at the level of Stribeck's curve."""

    sigma0: Scalar = parameter("N.m/rad", "Bristle stiffness", low=1e-6, nominal=1e4)
    sigma1: Scalar = parameter("N.m.s/rad", "Bristle damping", default=0.0, low=0, nominal=100)
    sigma2: Scalar = parameter("N.m.s/rad", "Viscous friction coefficient", default=0.0, low=0)
    Fc: Scalar = parameter("N.m", "Coulomb level at high speed", low=1e-9)
    Fs: Scalar = parameter("N.m", "Break-away level at rest; none: Fc, no Stribeck term", default=None, low=1e-9)
    Vs: Scalar = parameter("rad/s", "Stribeck speed", default=None, low=1e-9, nominal=0.01)
    delta: Scalar = parameter("1", "Shape exponent of the Stribeck curve", default=2.0, low=0.1, high=5, fitted=False)

    def level(self, v: Scalar) -> Scalar:
        """`Fc + (Fs - Fc) exp(-|v/Vs|^delta)`."""
        return stribeck_level(v, self.Fc, self.Fs, self.Vs, self.delta)

    def steady(self) -> Stribeck:
        """Return the law's own steady sliding map."""
        return Stribeck(Fc=self.Fc, Fs=self.Fs, Vs=self.Vs, delta=self.delta, sigma2=self.sigma2)
