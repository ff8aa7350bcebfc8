"""A cable that pulls towards home."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.effects.base import LoadEffect, Main, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class CableWrap(LoadEffect):
    """Spring towards a home position that may harden: torque = k x (1 + h x^2), x = q - home.

    The position counts on over whole turns: a cable remembers them. The cubic spring is Duffing's: Kovacic and
    Brennan, The Duffing Equation, 2011, chapter 1.
    """

    id: ClassVar[str] = "cable_wrap"
    title: ClassVar[str] = "Cable wrap"
    equation: ClassVar[str] = "k x (1 + h x²), x = q − q₀"
    main: ClassVar[Main] = Main("stiffness", unit="N.m/rad")
    to_record: ClassVar[str] = "record from end to end of the travel"
    rivals: ClassVar[tuple[str, ...]] = ("gravity_unbalance", "torque_offset")
    told_apart_by: ClassVar[str] = "a cable pulls harder turn after turn; an unbalance repeats once per turn"
    action: ClassVar[str] = "Give the cable more slack, or bring home to the middle of its travel."
    action_linear: ClassVar[str] = "Give the cable chain more slack, or turn it round; look at bellows and hoses."
    says: ClassVar[str] = "A cable or spring pulls towards {0.home:.3g} {way} with {0.stiffness:.3g} {unit} per {way}."
    stiffness: Scalar = parameter("N.m/rad", "Stiffness at home", low=0)
    home: Scalar = parameter("rad", "Position without torque", default=0.0)
    hardening: Scalar = parameter(
        "1/rad2", "Relative rise of the stiffness with distance squared", default=0.0, low=0, fitted=False
    )

    def load(self, motion: Motion) -> Scalar:
        """`k x (1 + h x^2)`."""
        x = motion.q - self.home
        return self.stiffness * x * (1 + self.hardening * x * x)
