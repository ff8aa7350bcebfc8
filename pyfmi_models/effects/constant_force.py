"""A weight on an axis that moves along: a constant force."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.effects.base import LoadEffect, Main, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class ConstantForce(LoadEffect):
    """A force that is the same at every position, speed and time: F = m g sin(slope) of what moves, or a spring of gas.

    The equation is that of `TorqueOffset`, so no recording of motion and drive force tells one from the other.
    """

    id: ClassVar[str] = "constant_force"
    title: ClassVar[str] = "Constant force"
    equation: ClassVar[str] = "F₀"
    main: ClassVar[Main] = Main("force")
    to_record: ClassVar[str] = "record the same speeds in both directions"
    rivals: ClassVar[tuple[str, ...]] = ("torque_offset", "friction_asymmetry", "cable_wrap")
    told_apart_by: ClassVar[str] = (
        "release the carriage: a weight moves it, an offset of the reading does not; or weigh what hangs on it; or "
        "read the drive's current with the axis blocked both ways"
    )
    special_case_of: ClassVar[tuple[str, ...]] = ("friction_asymmetry", "cable_wrap")
    action: ClassVar[str] = "Counterbalance the carriage, or hold its weight in the model; zero the drive's reading."
    force: Scalar = parameter("N.m", "Constant resisting force")

    def load(self, motion: Motion) -> Scalar:
        """The constant."""
        return self.force

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        way = "backward" if self.force > 0 else "forward"
        name, pushed = ("force", "carriage") if unit == "N" else ("load", "axis")
        size = f"{abs(self.force):.3g} {unit}"
        return f"A constant {name} of {size} pushes the {pushed} {way}: a weight, or an offset of the drive's reading."
