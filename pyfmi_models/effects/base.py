"""The contract of an effect: one kind of physics that a model may lack.

An effect is written once and used twice: the mount adds its equations to the plant, and the diagnosis asks how the
torque a recording needs would change with it. It acts in one of three places:

    DriveEffect     between commanded and applied torque
    FrictionEffect  on the level or the viscous part of friction
    LoadEffect      a torque that resists, beside friction

Signs: an effect torque resists, J q'' = tau - tau_f - loads - effects.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt

from pyfmi_models.model import Scalar, Variable


class Motion(NamedTuple):
    """Where the axis is: time [s], position [rad or m], speed, and position as an angle that repeats once per turn."""

    t: Scalar
    q: Scalar
    v: Scalar
    angle: Scalar


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One kind of missing physics: what a mechanic would call it, and what tells it from its rivals."""

    id: ClassVar[str]
    title: ClassVar[str]
    rivals: ClassVar[tuple[str, ...]] = ()
    told_apart_by: ClassVar[str] = ""
    action: ClassVar[str] = ""

    def statement(self, unit: str = "N·m") -> str:
        """Say what the effect with these numbers is, in one plain sentence; `unit` is the torque or force unit."""
        raise TypeError(f"{type(self).__name__} has no statement")


@dataclass(frozen=True, kw_only=True)
class LoadEffect(Effect):
    """A torque beside friction that resists."""

    def load(self, motion: Motion) -> Scalar:
        """Resisting torque [N m]."""
        raise TypeError(f"{type(self).__name__} has no load")


@dataclass(frozen=True, kw_only=True)
class FrictionEffect(Effect):
    """A change of the friction level or of the viscous torque."""

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """Return the friction level [N m] that replaces `level`."""
        return level

    def viscous(self, viscous: Scalar, motion: Motion) -> Scalar:
        """Return the viscous torque [N m] that replaces `viscous`."""
        return viscous


@dataclass(frozen=True, kw_only=True)
class DriveEffect(Effect):
    """Dynamics between the commanded and the applied torque."""

    def states(self) -> tuple[Variable, ...]:
        """Name the states of the drive dynamics."""
        return ()

    def rate(self, state: Any, command: Scalar) -> Any:
        """Time derivative of the states under a command [N m], a column."""
        return ca.SX(0, 1)

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """Torque applied to the axis [N m]."""
        return command

    def response(self, omega: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
        """Frequency response from command to applied torque at angular frequencies omega [rad/s]."""
        return np.ones_like(omega, dtype=np.complex128)
