"""The two axes of a mount with altitude over azimuth act on each other.

The tube and what turns with it in altitude h has the moment of inertia I more about the vertical when it lies level
than when it points to the zenith. With J the azimuth inertia at the zenith, the kinetic energy is

    T = (J + I cos^2 h) A'^2 / 2 + J_h h'^2 / 2

and Lagrange's equations give

    azimuth     (J + I cos^2 h) A'' = tau_A + I sin(2h) h' A'
    altitude    J_h h''             = tau_h - I sin(2h) A'^2 / 2

beside friction and all else. The tube's products of inertia about the axes are taken as zero: it is balanced and the
axes are square, so no acceleration of one axis pushes the other. Reference: Goldstein, Classical Mechanics, chapter 1.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import InertiaEffect, LoadEffect, Motion
from pyfmi_models.model import Scalar, Variable, parameter

TUBE = "Inertia about the vertical of the tube when level, less that at the zenith"


@dataclass(frozen=True, kw_only=True)
class AltitudeInertia(InertiaEffect):
    """For the azimuth axis: its inertia grows by I cos^2 h as the tube comes down.

    Altitude h and its rate are inputs of the plant.
    """

    id: ClassVar[str] = "altitude_inertia"
    title: ClassVar[str] = "Azimuth inertia that follows the altitude"
    rivals: ClassVar[tuple[str, ...]] = ("inertia_variation",)
    told_apart_by: ClassVar[str] = "it follows the altitude, not the position of the azimuth axis itself"
    action: ClassVar[str] = "Nothing needs repair: tell the controller the inertia for the altitude."
    says: ClassVar[str] = "The azimuth carries {0.tube_inertia:.3g} kg·m² more with the tube level than at the zenith."
    reads: ClassVar[tuple[Variable, ...]] = (
        Variable(name="altitude", unit="rad", description="Altitude of the tube", nominal=0.7),
        Variable(name="altitude_rate", unit="rad/s", description="Rate of the altitude", nominal=0.01),
    )
    tube_inertia: Scalar = parameter("kg.m2", TUBE, low=0)

    def inertia(self, inertia: Scalar, motion: Motion) -> Scalar:
        """`J + I cos^2 h`."""
        return inertia + self.tube_inertia * ca.cos(motion.inputs["altitude"]) ** 2

    def followed(self) -> Mapping[str, str]:
        """The altitude: its rate makes the torque I sin(2h) h' A'."""
        return {"altitude": "altitude_rate"}


@dataclass(frozen=True, kw_only=True)
class AzimuthCentrifugal(LoadEffect):
    """For the altitude axis: turning in azimuth swings the tube towards level, with I sin(2h) A'^2 / 2.

    The azimuth rate A' is an input of the plant.
    """

    id: ClassVar[str] = "azimuth_centrifugal"
    title: ClassVar[str] = "Centrifugal torque of the azimuth"
    rivals: ClassVar[tuple[str, ...]] = ("gravity_unbalance",)
    told_apart_by: ClassVar[str] = "it grows with the square of the azimuth rate and is nothing at rest"
    action: ClassVar[str] = "Nothing needs repair: slew one axis after the other where it matters."
    says: ClassVar[str] = "Turning in azimuth swings the tube down; it weighs {0.tube_inertia:.3g} kg·m² against it."
    reads: ClassVar[tuple[Variable, ...]] = (
        Variable(name="azimuth_rate", unit="rad/s", description="Rate of the azimuth", nominal=0.1),
    )
    tube_inertia: Scalar = parameter("kg.m2", TUBE, low=0)

    def load(self, motion: Motion) -> Scalar:
        """`I sin(2h) A'^2 / 2`."""
        return self.tube_inertia * ca.sin(2 * motion.q) * motion.inputs["azimuth_rate"] ** 2 / 2
