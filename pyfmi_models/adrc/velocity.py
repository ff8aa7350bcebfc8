"""Where the speed in the error's derivative comes from."""

from dataclasses import dataclass
from typing import Any, ClassVar

from pyfmi_models.model import Scalar, Variable


@dataclass(frozen=True, kw_only=True)
class Velocity:
    """A source of the speed [rad/s] that the speed gain acts on: zeta2, quiet and late as the observer makes it."""

    key: ClassVar[str] = "observer"

    def states(self) -> tuple[Variable, ...]:
        """List what is remembered from tick to tick."""
        return ()

    def measure(self, state: list[Any], q: Scalar, observed: Scalar, period: float) -> tuple[list[Any], Scalar]:
        """Return the states after this tick and the speed now."""
        return [], observed


@dataclass(frozen=True, kw_only=True)
class DifferencedVelocity(Velocity):
    """(q - last q) / period: half a period late and no more, with all noise of the encoder.

    At 0.1 ms and a speed gain of J kd = 900 N m s/rad, 1 urad of white noise is 13 N m of torque. At the first tick
    there is no last position; the controller takes the observer's speed then.
    """

    key: ClassVar[str] = "difference"

    def states(self) -> tuple[Variable, ...]:
        """The last position."""
        return (Variable(name="velocity.q_last", unit="rad", description="Measured position at the last tick"),)

    def measure(self, state: list[Any], q: Scalar, observed: Scalar, period: float) -> tuple[list[Any], Scalar]:
        """`(q - last q) / period`."""
        return [q], (q - state[0]) / period


VELOCITIES: dict[str, Velocity] = {one.key: one for one in (Velocity(), DifferencedVelocity())}
