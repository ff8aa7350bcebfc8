"""The display units of one report."""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from cosim.diagnosis.answer.result import Diagnosis, Part
from cosim.plots.quantities import ANGLE, FORCE, LENGTH, MOVING, TORQUE, TURNING, Scale, handy


@dataclass(frozen=True)
class Scales:
    """The display units of one report."""

    torque: Scale
    position: Scale
    speed: Scale
    turn: float = 2 * pi
    """What cycles are counted per: a turn [rad], or a metre of a linear axis."""

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> "Scales":
        """Choose units in which the recordings of a diagnosis have handy numbers."""
        rotary = diagnosis.motion == "rotary"
        torque = max((_largest(trace.tau) for trace in diagnosis.traces), default=1.0)
        position = max((float(np.ptp(trace.q)) for trace in diagnosis.traces if trace.q.size), default=1.0)
        speed = max((_largest(trace.v) for trace in diagnosis.traces), default=1.0)
        return cls(
            handy(TORQUE if rotary else FORCE, torque),
            handy(ANGLE if rotary else LENGTH, position),
            handy(TURNING if rotary else MOVING, speed),
            2 * pi if rotary else 1.0,
        )

    @property
    def noun(self) -> str:
        """What the drive gives: a torque, or the force of a linear axis."""
        return "torque" if self.torque.unit.endswith("N·m") else "force"

    def labelled(self, parts: tuple[Part, ...]) -> tuple[Part, ...]:
        """Return the parts with classes of speed called by their speeds."""
        return tuple(replace(one, label=self.speed.span(*one.speeds)) if one.speeds else one for one in parts)

    def of_unit(self, unit: str) -> Scale:
        """Return the display unit for an SI unit."""
        known = {"rad": self.position, "m": self.position, "rad/s": self.speed, "m/s": self.speed}
        known |= {"N.m": self.torque, "N·m": self.torque, "N": self.torque}
        return known.get(unit, Scale(1.0, "" if unit == "1" else unit))

    def of_axis(self, axis: str) -> Scale:
        """Return the display unit for an axis of `Where`."""
        return {"position": self.position, "speed": self.speed, "time": Scale(1.0, "s")}.get(axis, Scale(1.0, ""))


def _largest(values: np.ndarray) -> float:
    return float(np.nanmax(np.abs(values))) if values.size else 0.0
