"""Friction that depends on where the axis is."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, Main, Motion, higher, percent, times, words
from pyfmi_models.model import Recorded, Scalar, Variable, parameter


@dataclass(frozen=True, kw_only=True)
class _PositionFriction(FrictionEffect):
    id: ClassVar[str] = "position_friction"
    title: ClassVar[str] = "Position-dependent friction"
    equation: ClassVar[str] = "F (1 + r cos(N q + φ)), or F (1 + r) near one place"
    main: ClassVar[Main] = Main("relative_amplitude", 100.0, "%")
    to_record: ClassVar[str] = "record several speeds over the same places, both ways"
    rivals: ClassVar[tuple[str, ...]] = ("cogging", "gravity_unbalance", "load_dependent_friction")
    told_apart_by: ClassVar[str] = "cogging pushes the same way in both directions; friction always resists"


@dataclass(frozen=True, kw_only=True)
class PeriodicFriction(_PositionFriction):
    """Friction level times 1 + r cos(cycles angle + phase)."""

    action: ClassVar[str] = "Check the bearing ring and the gear for run-out."
    action_linear: ClassVar[str] = "Check screw or belt pulley for run-out, and the rail for its joints."
    cycles_per_rev: Scalar = parameter("1", "Cycles per turn (per metre of a linear axis)", low=0, fitted=False)
    relative_amplitude: Scalar = parameter("1", "Relative amplitude of the level", low=0, high=0.95)
    phase: Scalar = parameter("rad", "Phase at position zero", default=0.0)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level (1 + r cos(cycles angle + phase))`."""
        return level * (1 + self.relative_amplitude * ca.cos(self.cycles_per_rev * motion.angle + self.phase))

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        often = f"{times(self.cycles_per_rev)} per {words(unit)['turn']}"
        return f"Friction rises and falls by {percent(self.relative_amplitude)}, {often}."


@dataclass(frozen=True, kw_only=True)
class LocalFriction(_PositionFriction):
    """A rough spot: friction level times 1 + r exp(-((q - q_center)/width)^2 / 2)."""

    action: ClassVar[str] = "Look at the track there: dirt, a dent, a damaged seal or a stiff cable."
    action_linear: ClassVar[str] = "Look at the rail and the screw there: dirt, a dent, a joint or a stiff cable."
    q_center: Scalar = parameter("rad", "Position of the rough spot")
    width: Scalar = parameter("rad", "Width (standard deviation) of the rough spot", low=1e-6)
    relative_amplitude: Scalar = parameter("1", "Relative rise of the level", low=-0.95, high=20)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level (1 + r exp(-((q - q_center)/width)^2 / 2))`."""
        return level * (1 + self.relative_amplitude * bump(motion.q, self.q_center, self.width))

    def fit_bounds(self, variable: Variable, recorded: Recorded) -> tuple[float, float]:
        """A place that was visited, and no wider than all of them: beyond, it is another friction everywhere.

        One that a card has elsewhere stays there: recordings say nothing of it.
        """
        if variable.name == "q_center":
            return min(recorded.low, self.q_center), max(recorded.high, self.q_center)
        if variable.name == "width":
            return variable.low, max(recorded.high - recorded.low, self.width)
        return variable.low, variable.high

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return around(self.q_center, self.width, higher(self.relative_amplitude), unit)


def around(center: float, width: float, changed: str, unit: str) -> str:
    """Say what friction is at a rough spot."""
    way = words(unit)["way"]
    return f"Around {center:.4g} {way} friction is {changed}, over about {4 * width:.2g} {way}."


def bump(q: Scalar, center: Scalar, width: Scalar) -> Scalar:
    """`exp(-((q - center)/width)^2 / 2)`, without underflow far away."""
    distance = (q - center) / width
    return ca.exp(-ca.fmin(distance * distance, 1e3) / 2)
