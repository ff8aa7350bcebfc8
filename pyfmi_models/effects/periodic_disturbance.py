"""A torque that comes and goes with time."""

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import Main, Motion, TonalEffect, times
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class PeriodicDisturbance(TonalEffect):
    """External torque periodic in time: torque = amplitude sin(2 pi f t + phase), t the time of the simulation."""

    id: ClassVar[str] = "periodic_disturbance"
    title: ClassVar[str] = "Periodic disturbance"
    equation: ClassVar[str] = "a sin(2π f t + φ)"
    main: ClassVar[Main] = Main("amplitude")
    own_phase: ClassVar[str] = "phase"
    to_record: ClassVar[str] = "record a minute of motion that does not repeat"
    rivals: ClassVar[tuple[str, ...]] = ("cogging", "position_friction", "compliance")
    told_apart_by: ClassVar[str] = "its frequency stays when the speed changes; that of cogging follows the speed"
    action: ClassVar[str] = "Look for fans, pumps or a machine next door that runs at this frequency."
    frequency_hz: Scalar = parameter("Hz", "Frequency", low=1e-4, high=1e4)
    amplitude: Scalar = parameter("N.m", "Half the peak-to-peak torque", low=0)
    phase: Scalar = parameter("rad", "Phase at time zero", default=0.0)

    def load(self, motion: Motion) -> Scalar:
        """`amplitude sin(2 pi f t + phase)`."""
        return self.amplitude * ca.sin(2 * pi * self.frequency_hz * motion.t + self.phase)

    def wave(self) -> tuple[Scalar, Scalar]:
        """As the parameters give it."""
        return self.frequency_hz, self.amplitude

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"Something shakes the axis {times(self.frequency_hz)} a second with {self.amplitude:.3g} {unit}."
