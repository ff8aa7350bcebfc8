"""A rough spot that rubs otherwise forward than backward."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion, higher
from pyfmi_models.effects.position_friction import around, bump
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class RoughSpot(FrictionEffect):
    """A burr, a lifted seal or a step of the track: friction level times 1 + r exp(-((q - q_center)/width)^2 / 2).

    r is `forward` for positive speeds and `backward` for negative ones; at rest the level is the mean of both. With
    both alike it is the local form of position-dependent friction.
    References: of friction over position: Popovic, Goldenberg, IEEE Transactions on Robotics and Automation 14 (1998)
    114; of levels by direction: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.
    """

    id: ClassVar[str] = "rough_spot"
    title: ClassVar[str] = "Rough spot by direction"
    equation: ClassVar[str] = "F (1 + r exp(−((q − q₀)/w)²/2)), r by direction"
    main: ClassVar[Main] = Main("forward", 100.0, "%")
    to_record: ClassVar[str] = "record slow passes over the spot, several in each direction"
    rivals: ClassVar[tuple[str, ...]] = ("position_friction", "cogging", "friction_asymmetry")
    told_apart_by: ClassVar[str] = "passes one way rub there otherwise than passes back; elsewhere both ways are alike"
    action: ClassVar[str] = "Look at the track there for what stands up one way: a burr, a seam, a seal's lip, a cable."
    q_center: Scalar = parameter("rad", "Position of the rough spot")
    width: Scalar = parameter("rad", "Width (standard deviation) of the rough spot", low=1e-6)
    forward: Scalar = parameter("1", "Relative rise of the level at positive speeds", low=-0.95, high=20)
    backward: Scalar = parameter("1", "Relative rise of the level at negative speeds", low=-0.95, high=20)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """The equation above."""
        mean, half = (self.forward + self.backward) / 2, (self.forward - self.backward) / 2
        return level * (1 + (mean + half * ca.sign(motion.v)) * bump(motion.q, self.q_center, self.width))

    def leading(self) -> Main:
        """The larger of the two."""
        return self.main._replace(parameter="backward") if abs(self.backward) > abs(self.forward) else self.main

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        sizes = f"{higher(self.forward)} moving forward and {higher(self.backward)} backward"
        return around(self.q_center, self.width, sizes, unit)
