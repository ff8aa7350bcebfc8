"""Play in the drive."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import Coupling, Main
from pyfmi_models.model import Scalar, Variable, parameter

BUILD_UP = 1e-3
"""Depth over which the contact's damping builds up, as a share of the gap: without it the torque would jump."""


@dataclass(frozen=True, kw_only=True)
class Backlash(Coupling):
    """Part of the inertia is driven through play; at its ends is a stiff, damped contact that pushes and cannot pull.

        depth = max(|twist| - gap/2, 0),   k = J_far (2 pi fc)^2,   d = 2 zeta J_far 2 pi fc (1 - exp(-depth/depth0))
        torque = sign(twist) max(k depth + d depth', 0)

        drag = load_friction z / load_deflection + load_viscous v,   dz/dt = v - |v| z / load_deflection

    With the defaults it rebounds at a seventh of the speed. Drive, friction, loads and encoder act on the near (motor)
    mass; the far mass, output `q_load`, rubs by itself (v is its speed), and its friction bends before it slides, as
    that of the near side does. That is what stops it in the gap, so it says how much the play is felt. It starts in
    the middle of the gap.
    References: Nordin and Gutman, Automatica 38 (2002) 1633, dead-zone model with a damped shaft; Dahl, AIAA Journal
    14 (1976) 1675, for the far side's friction.
    """

    id: ClassVar[str] = "backlash"
    title: ClassVar[str] = "Backlash"
    equation: ClassVar[str] = "no torque inside the gap"
    main: ClassVar[Main] = Main("gap_rad", unit="rad", is_size=False)
    to_record: ClassVar[str] = "record slow reversals under light load"
    rivals: ClassVar[tuple[str, ...]] = ("compliance", "presliding", "friction_asymmetry", "actuator_lag", "delay")
    told_apart_by: ClassVar[str] = "after each reversal the motor runs free over the same distance, at any speed"
    action: ClassVar[str] = "Preload the gear or the nut; check the key and the coupling."
    says: ClassVar[str] = "There is play of {0.gap_rad:.3g} {way} in the drive."
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
    load_deflection: Scalar = parameter(
        "rad", "Deflection of the far mass's friction before it slides", default=1e-5, low=1e-9, high=0.1
    )

    def states(self) -> tuple[Variable, ...]:
        """Twist, its rate, and how far the far side's friction is bent."""
        bent = Variable(name="bristle", unit="rad", description="Deflection of the far side's friction", nominal=1e-5)
        return (*super().states(), bent)

    def share(self) -> Scalar:
        """`load_share`."""
        return self.load_share

    def torque(self, twist: Scalar, rate: Scalar, far: Scalar) -> Scalar:
        """The equation above."""
        side, depth = ca.sign(twist), ca.fmax(ca.fabs(twist) - self.gap_rad / 2, 0)
        omega, full = 2 * pi * self.contact_hz, 1 - ca.exp(-depth / (BUILD_UP * self.gap_rad + 1e-12))
        return side * far * ca.fmax(omega * (omega * depth + 2 * self.damping_ratio * full * side * rate), 0)

    def drag(self, speed: Scalar, state: Any) -> Scalar:
        """The far side's friction, bristle and viscous."""
        return self.load_friction * state[2] / self.load_deflection + self.load_viscous * speed

    def further_rates(self, speed: Scalar, state: Any) -> tuple[Scalar, ...]:
        """Of the bristle."""
        return (speed - ca.fabs(speed) * state[2] / self.load_deflection,)

    def advance(
        self, twist: Scalar, far_speed: Scalar, further: Sequence[Scalar], speed: Scalar, dt: Scalar, far: Scalar
    ) -> tuple[Scalar, ...]:
        """Twist, speed and bristle of the far side, torque passed on [N m] after dt, the near side moving at `speed`.

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
        (bristle,) = further
        after = self._rubbed(pushed, bristle, dt, far)
        bent = (bristle + dt * after) / (1 + dt * ca.fabs(after) / self.load_deflection)
        return twist + dt * (speed - after), after, bent, far * push

    def _rubbed(self, pushed: Scalar, bristle: Scalar, dt: Scalar, far: Scalar) -> Scalar:
        """The far side's speed after dt, which its bristle brings down from `pushed`.

            after = pushed - c (z + dt after) / (1 + dt |after| / load_deflection),   c = dt load_friction / (...) / far

        It has the sign of what the bristle leaves as it is; the positive root of the quadratic equation of its size,
        in the form of which no digits are lost.
        """
        per_bend = dt * self.load_friction / (self.load_deflection * far)
        side = ca.sign(pushed - per_bend * bristle)
        free, slides = side * (pushed - per_bend * bristle), dt / self.load_deflection
        linear = 1 + per_bend * dt - side * pushed * slides
        root = ca.sqrt(linear**2 + 4 * slides * free)
        return side * ca.if_else(linear > 0, 2 * free / (linear + root), (root - linear) / (2 * slides))
