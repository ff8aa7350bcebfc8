"""Friction that falls with speed."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.effects.base import FrictionEffect, Main, Motion
from pyfmi_models.friction.base import stribeck_bounds, stribeck_decay
from pyfmi_models.model import Recorded, Scalar, Variable, parameter


@dataclass(frozen=True, kw_only=True)
class StribeckEffect(FrictionEffect):
    """Friction level that rises towards break-away at low speed: g + (Fs - g) exp(-|v/Vs|^delta).

    Reference: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.
    """

    id: ClassVar[str] = "stribeck"
    title: ClassVar[str] = "Stribeck friction"
    equation: ClassVar[str] = "[Fc + (Fs − Fc) exp(−|v/Vs|^δ)] sign v"
    main: ClassVar[Main] = Main("Fs", is_size=False)
    to_record: ClassVar[str] = "record slow motion, down to a creep"
    rivals: ClassVar[tuple[str, ...]] = ("presliding", "dwell_breakaway")
    told_apart_by: ClassVar[str] = "Stribeck friction is the same leaving and reaching standstill"
    action: ClassVar[str] = "Look at lubrication if slow motion is jerky; otherwise use the improved model."
    says: ClassVar[str] = (
        "Below about {0.Vs:.2g} {speed} friction changes with speed, to {0.Fs:.3g} {unit} near standstill."
    )
    Fs: Scalar = parameter("N.m", "Break-away level at rest", low=1e-9)
    Vs: Scalar = parameter("rad/s", "Speed over which friction falls", low=1e-7, nominal=0.01)
    delta: Scalar = parameter("1", "Shape exponent of the curve", default=2.0, low=0.1, high=5, fitted=False)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level + (Fs - level) exp(-|v/Vs|^delta)`."""
        return level + (self.Fs - level) * stribeck_decay(motion.v, self.Vs, self.delta)

    def fit_bounds(self, variable: Variable, recorded: Recorded) -> tuple[float, float]:
        """Those of every Stribeck curve."""
        return stribeck_bounds(variable, recorded)
