"""A constant torque."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.effects.base import LoadEffect, Main, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class TorqueOffset(LoadEffect):
    """A torque that is the same at every position, speed and time."""

    id: ClassVar[str] = "torque_offset"
    title: ClassVar[str] = "Torque offset"
    equation: ClassVar[str] = "τ₀"
    main: ClassVar[Main] = Main("torque")
    to_record: ClassVar[str] = "record the same speeds in both directions"
    rivals: ClassVar[tuple[str, ...]] = ("friction_asymmetry", "gravity_unbalance", "cable_wrap")
    told_apart_by: ClassVar[str] = "friction asymmetry vanishes at standstill; unbalance changes with position"
    special_case_of: ClassVar[tuple[str, ...]] = ("friction_asymmetry", "cable_wrap")
    action: ClassVar[str] = "Zero the torque sensor or the current offset of the drive; look for a constant load."
    torque: Scalar = parameter("N.m", "Constant resisting torque")

    def load(self, motion: Motion) -> Scalar:
        """The constant."""
        return self.torque

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        way = "backward" if self.torque > 0 else "forward"
        return f"A constant {abs(self.torque):.3g} {unit} pushes the axis {way}, moving or not."
