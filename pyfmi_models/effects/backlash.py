"""Play in the drive."""

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import Coupling, Main
from pyfmi_models.model import Scalar, parameter

BUILD_UP = 1e-3
"""Depth over which the contact's damping builds up, as a share of the gap: without it the torque would jump."""
SMOOTHING = 1e-5
"""Speed [rad/s] below which the sign of the far side's speed is smoothed."""


@dataclass(frozen=True, kw_only=True)
class Backlash(Coupling):
    """Part of the inertia is driven through play; at its ends is a stiff, damped contact that pushes and cannot pull.

        depth = max(|twist| - gap/2, 0),   k = J_far (2 pi fc)^2,   d = 2 zeta J_far 2 pi fc (1 - exp(-depth/depth0))
        torque = sign(twist) max(k depth + d depth', 0)

    With the defaults it rebounds at a seventh of the speed. Drive, friction, loads and encoder act on the near (motor)
    mass; the far mass, output `q_load`, rubs by itself: load_friction sign(v) + load_viscous v. That is what stops it
    in the gap, so it says how much the play is felt. It starts in the middle of the gap.
    Reference: Nordin and Gutman, Automatica 38 (2002) 1633, dead-zone model with a damped shaft.
    """

    id: ClassVar[str] = "backlash"
    title: ClassVar[str] = "Backlash"
    equation: ClassVar[str] = "no torque inside the gap"
    main: ClassVar[Main] = Main("gap_rad", unit="rad", is_size=False)
    to_record: ClassVar[str] = "record slow reversals under light load"
    rivals: ClassVar[tuple[str, ...]] = ("compliance", "presliding", "friction_asymmetry", "actuator_lag", "delay")
    told_apart_by: ClassVar[str] = "after each reversal the motor runs free over the same distance, at any speed"
    action: ClassVar[str] = "Preload the gear or the nut; check the key and the coupling."
    gap_rad: Scalar = parameter("rad", "Width of the play", low=0, nominal=1e-3, tunable=False)
    load_share: Scalar = parameter(
        "1", "Share of the inertia behind the play", default=0.5, low=0.01, high=0.99, tunable=False
    )
    contact_hz: Scalar = parameter(
        "Hz", "Frequency of the far mass on the contact", default=50.0, low=1, high=1e4, tunable=False, fitted=False
    )
    damping_ratio: Scalar = parameter("1", "Damping of the contact", default=0.75, low=0, high=5, fitted=False)
    load_friction: Scalar = parameter("N.m", "Friction level of the far mass itself", default=0.0, low=0)
    load_viscous: Scalar = parameter("N.m.s/rad", "Viscous friction of the far mass itself", default=0.0, low=0)

    def share(self) -> Scalar:
        """`load_share`."""
        return self.load_share

    def torque(self, twist: Scalar, rate: Scalar, far: Scalar) -> Scalar:
        """The equation above."""
        side, depth = ca.sign(twist), ca.fmax(ca.fabs(twist) - self.gap_rad / 2, 0)
        omega, full = 2 * pi * self.contact_hz, 1 - ca.exp(-depth / (BUILD_UP * self.gap_rad + 1e-12))
        return side * far * ca.fmax(omega * (omega * depth + 2 * self.damping_ratio * full * side * rate), 0)

    def drag(self, speed: Scalar) -> Scalar:
        """`load_friction sign(speed) + load_viscous speed`, the sign smoothed."""
        return self.load_friction * ca.tanh(speed / SMOOTHING) + self.load_viscous * speed

    def advance(self, twist: Scalar, far_speed: Scalar, speed: Scalar, dt: Scalar, far: Scalar) -> tuple[Scalar, ...]:
        """Twist, speed of the far side and torque passed on [N m] after dt, the near side moving at `speed`.

        One implicit step of the equations above, for any dt: contact and dry friction each answer the speed at its
        end, so none of them rings, and a contact that is met within the step is damped by what it gave way. All is
        continuous in the parameters. Reference: Moreau, Unilateral contact and dry friction (1988), time stepping.
        """
        free = twist + dt * (speed - far_speed)
        side, omega = ca.sign(free), 2 * pi * self.contact_hz
        before = ca.fmax(side * twist - self.gap_rad / 2, 0)
        stiff, damped = omega**2, 2 * self.damping_ratio * omega / dt
        met = (stiff + damped) * (side * free - self.gap_rad / 2) - damped * before
        push = side * ca.fmax(met / (1 + (stiff + damped) * dt**2), 0)
        pushed = (far_speed + dt * push) / (1 + dt * self.load_viscous / far)
        rubbed = dt * self.load_friction / far
        after = pushed - ca.fmax(-rubbed, ca.fmin(rubbed, pushed))
        return twist + dt * (speed - after), after, far * push

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"There is play of {self.gap_rad:.3g} {'m' if unit == 'N' else 'rad'} in the drive."
