"""First-order lag between the commanded and the applied torque."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from pyfmi_models.effects.base import DriveEffect, Main
from pyfmi_models.model import Scalar, Variable, parameter


@dataclass(frozen=True, kw_only=True)
class ActuatorLag(DriveEffect):
    """First-order lag between commanded and applied torque: T x' = command - x, applied = x."""

    id: ClassVar[str] = "actuator_lag"
    title: ClassVar[str] = "Actuator lag"
    equation: ClassVar[str] = "τ_applied = τ / (1 + s T)"
    main: ClassVar[Main] = Main("time_constant_ms", unit="ms")
    to_record: ClassVar[str] = "record a chirp up to high frequencies, with its set point"
    rivals: ClassVar[tuple[str, ...]] = ("delay", "clock_skew", "backlash")
    told_apart_by: ClassVar[str] = "a lag takes amplitude away at high frequency; a delay turns phase only"
    action: ClassVar[str] = "Check the bandwidth of the current loop and any torque filter in the drive."
    says: ClassVar[str] = "The drive builds up its torque slowly, with a time constant of {0.time_constant_ms:.2g} ms."
    remembers: ClassVar[tuple[Variable, ...]] = (
        Variable(name="x", unit="N.m", description="Torque applied by the lagging actuator"),
    )
    time_constant_ms: Scalar = parameter("ms", "Time constant of the torque build-up", low=0.02, high=200)

    def rate(self, state: Any, command: Scalar) -> Any:
        """`(command - x) / T`."""
        return (command - state) / (self.time_constant_ms * 1e-3)

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """`x`."""
        return state[0]

    def response(self, omega: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
        """`1 / (1 + j omega T)`."""
        return np.asarray(1 / (1 + 1j * omega * self.time_constant_ms * 1e-3))
