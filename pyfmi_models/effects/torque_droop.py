"""A torque constant that droops with the torque, and with the temperature of the magnets."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import casadi as ca

from pyfmi_models.effects.base import DriveEffect, Main, Motion, percent
from pyfmi_models.effects.thermal_viscosity import REFERENCE
from pyfmi_models.model import Scalar, Variable, parameter

ROUND = 0.05
"""Share of the rated torque below which the droop sets in as a square: no kink at zero."""


@dataclass(frozen=True, kw_only=True)
class TorqueDroop(DriveEffect):
    """The more current, the less torque each ampere gives: the iron around the magnets saturates bit by bit.

        applied = command / (1 + c s(command/rated)),   s(x) = sqrt(x^2 + w^2) - w,   w = 0.05

    with c such that `droop` is missing at the rated torque: 1 + c s(1) = 1/(1 - droop). To first order in the droop
    that is command (1 - droop |command|/rated). More command always gives more torque, as droop is at most 0.9: the
    slope is above (1 - c w)/(1 + c s)^2, and c w below 1. No command gives more than rated/c.
    Reference: saturation curve x/(1 + c x) of Froelich, in Trutt, Erdelyi, Hopkins, "Representation of the
    magnetization characteristic of DC machines for computer use", IEEE Trans. PAS-87 (1968) 665.
    """

    id: ClassVar[str] = "torque_droop"
    at_once: ClassVar[bool] = True
    title: ClassVar[str] = "Droop of the torque constant"
    equation: ClassVar[str] = "u / (1 + c |u|/u₀), times 1 + k (T − 20 °C) where the motor's temperature is known"
    main: ClassVar[Main] = Main("droop", 100.0, "% at the rated torque")
    to_record: ClassVar[str] = "record several loads or accelerations, from small to the hardest that is allowed"
    rivals: ClassVar[tuple[str, ...]] = ("torque_saturation", "inertia_variation", "dead_band")
    told_apart_by: ClassVar[str] = "the missing share grows from the smallest torque on; a saturation has a knee"
    action: ClassVar[str] = "Take the torque constant at the working point, from the motor's curve over the current."
    droop: Scalar = parameter("1", "Share of the torque that is missing at the rated torque", low=0, high=0.9)
    rated_torque: Scalar = parameter("N.m", "Command at which the droop is told", low=1e-6, fitted=False)

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """The equation above."""
        c = self.droop / (1 - self.droop) / _rounded(1.0)
        return command / (1 + c * _rounded(command / self.rated_torque))

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return (
            f"Of a command of {self.rated_torque:.3g} {unit} the drive loses {percent(self.droop)}, of small ones less."
        )


@dataclass(frozen=True, kw_only=True)
class WarmTorqueDroop(TorqueDroop):
    """The same, and warm magnets are weaker: all times 1 + k (T - 20 degC), at least a tenth.

    T is the plant's input `temperature`, here of the motor; effects that name it share it.
    Reference: Gieras, Permanent Magnet Motor Technology, 3rd edition (2010), chapter 2: about -0.1 % per degree for
    neodymium, -0.2 % for ferrite.
    """

    per_degC: Scalar = parameter("1/K", "Relative change of the torque constant per degree", low=-0.05, high=0.05)
    warmth: Scalar = 0.0
    """T - 20 degC of the moment, see `given`; no key of a card."""
    reads: ClassVar[tuple[Variable, ...]] = (
        Variable(name="temperature", unit="degC", description="Temperature of the motor", start=REFERENCE),
    )

    def given(self, motion: Motion) -> Self:
        """At this temperature."""
        return replace(self, warmth=motion.inputs["temperature"] - REFERENCE)

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """The equation above."""
        return super().applied(state, command) * ca.fmax(LEAST_SHARE, 1 + self.per_degC * self.warmth)

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        how = "more" if self.per_degC > 0 else "less"
        return f"{super().statement(unit)[:-1]}, and gives {percent(abs(self.per_degC))} {how} per degree."


LEAST_SHARE = 0.1
"""Share of its torque constant that a drive keeps at any temperature: more command always gives more torque."""


def _rounded(x: Scalar) -> Scalar:
    """|x|, round near zero and less by `ROUND` far away."""
    return ca.sqrt(x * x + ROUND * ROUND) - ROUND
