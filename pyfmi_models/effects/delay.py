"""Dead time between the commanded and the applied torque."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import numpy.typing as npt

from pyfmi_models.effects.base import DriveEffect, Main
from pyfmi_models.model import Scalar, Variable, parameter

PADE_ORDER = 3
"""States of the dead time's rational approximation: phase error below 1.5e-4 rad up to omega T = 1.3."""


@dataclass(frozen=True, kw_only=True)
class Delay(DriveEffect):
    """Dead time between commanded and applied torque.

        applied(t) = command(t - T)

    In the plant the dead time is the Pade approximation [2/3] of exp(-sT): rational, so that every solver, model
    exchange and exact state restore work with it, and strictly proper, so that a step in the command is no step in
    the torque. Reference: Vajta, "Some remarks on Pade approximations", TEMPUS-INTCOM Symp. 2000, with m = 2, n = 3.
    """

    id: ClassVar[str] = "delay"
    title: ClassVar[str] = "Delay"
    equation: ClassVar[str] = "τ_applied(t) = τ(t − T)"
    main: ClassVar[Main] = Main("delay_ms", unit="ms")
    to_record: ClassVar[str] = "record a chirp up to high frequencies, with its set point"
    rivals: ClassVar[tuple[str, ...]] = ("actuator_lag", "clock_skew", "backlash")
    told_apart_by: ClassVar[str] = (
        "a delay turns phase only; a lag also takes amplitude away at high frequency; a late clock trails the set point"
    )
    action: ClassVar[str] = "No repair: shorten the bus cycle, or use the improved model for tuning."
    says: ClassVar[str] = "Actuation delay of {0.delay_ms:.2g} ms (drive or bus, not mechanical)."
    delay_ms: Scalar = parameter(
        "ms", "Dead time between commanded and applied torque", low=0.02, high=50, tunable=False
    )

    def states(self) -> tuple[Variable, ...]:
        """Three states of the rational approximation."""
        return tuple(
            Variable(name=f"x{k}", unit="N.m", description=f"State {k} of the dead time's approximation")
            for k in range(1, PADE_ORDER + 1)
        )

    def rate(self, state: Any, command: Scalar) -> Any:
        """Controllable canonical form in time units of the delay: 60 - 24 sT + 3 (sT)^2 over (sT)^3 + 9 .. + 60."""
        T = self.delay_ms * 1e-3
        last = 60 * (command - state[0]) - 36 * state[1] - 9 * state[2]
        return ca.vertcat(state[1], state[2], last) / T

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """Numerator of the approximation on its states."""
        return state[0] - 24 / 60 * state[1] + 3 / 60 * state[2]

    def response(self, omega: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
        """`exp(-j omega T)`."""
        return np.asarray(np.exp(-1j * omega * self.delay_ms * 1e-3))
