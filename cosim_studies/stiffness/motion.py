"""Prescribed motions under which the bristle equation is solved."""

from dataclasses import dataclass
from math import pi, radians
from typing import Any

import casadi as ca
import numpy as np

from pyfmi_models.model import Variable

STEP = 1e-4
"""The paper's sampling time [s]."""

MOTION = (
    Variable(name="peak", unit="rad/s", description="Largest speed of the sine"),
    Variable(name="frequency", unit="Hz", description="Frequency of the sine"),
    Variable(name="phase", unit="rad", description="Phase of the sine at the start"),
    Variable(name="offset", unit="rad/s", description="Constant part of the speed"),
)


@dataclass(frozen=True, kw_only=True)
class Regime:
    """A prescribed speed v(t) = offset + peak sin(2 pi frequency t + phase) over some seconds."""

    name: str
    seconds: float
    peak: float = 0.0
    frequency: float = 0.2
    phase: float = 0.0
    offset: float = 0.0

    def speed(self, t: Any) -> Any:
        """Speed [rad/s] at time t [s]: a number, an array or a symbol."""
        return speed(t, *self.motion().values())

    def motion(self) -> dict[str, float]:
        """Return the numbers of the motion, by the name of the FMU's parameter."""
        return {variable.name: getattr(self, variable.name) for variable in MOTION}

    def ticks(self, step: float) -> int:
        """Number of steps."""
        return round(self.seconds / step)


def speed(t: Any, peak: Any, frequency: Any, phase: Any, offset: Any) -> Any:
    """Speed [rad/s] at time t, of numbers, arrays or symbols."""
    sine = ca.sin if isinstance(t, ca.SX) else np.sin
    return offset + peak * sine(2 * pi * frequency * t + phase)


# A step of 20 urad, less than the bristles bend before they break away; its speed is one full raised cosine.
_STEP_SPEED = 20e-6 / 0.05
REGIMES = (
    Regime(name="reference", seconds=5, peak=5 * 7.268e-5),
    Regime(name="5 deg/s", seconds=5, peak=radians(5)),
    Regime(name="40 deg/s", seconds=5, peak=radians(40)),
    Regime(name="reversals at 2 Hz", seconds=1, peak=radians(5), frequency=2),
    Regime(name="presliding step", seconds=0.1, offset=_STEP_SPEED, peak=-_STEP_SPEED, frequency=20, phase=pi / 2),
)
FASTEST = Regime(name="3 rad/s", seconds=5, peak=3.0)
"""Faster than any mount slews: what a co-simulation at 1 ms must survive."""


def sine(peak: float) -> Regime:
    """Return one period of the paper's sine of 0.2 Hz, with another largest speed [rad/s]."""
    return Regime(name=f"{peak:g} rad/s", seconds=5, peak=peak)
