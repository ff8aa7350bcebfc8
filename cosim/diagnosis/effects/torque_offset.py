"""A constant torque."""

from collections.abc import Iterator
from typing import ClassVar

from cosim.diagnosis.effects.base import RESTLESS, Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, has
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models.effects import Effect, FrictionAsymmetry, TorqueOffset
from pyfmi_models.effects.constant_force import ConstantForce
from pyfmi_models.mount import Mount


class Offset(Hypothesis[TorqueOffset]):
    """A constant."""

    forms = (TorqueOffset,)
    tables = ("position",)
    rank: ClassVar[float] = 11
    needs_position: ClassVar[bool] = False

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """One column of ones; beside friction that differs between the directions only where rest tells them apart."""
        if _is_alike(mount):
            return

        def start(c: Array) -> Effect:
            return TorqueOffset(torque=float(c[0]))

        yield Candidate("torque_offset", (TorqueOffset(torque=0.0),), ("torque",), start)

    def is_settled(self, mount: Mount) -> bool:
        """Whether the model holds a constant already, by either name."""
        return super().is_settled(mount) or has(mount, ConstantForce)

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """A law that says nothing of rest cannot tell it from friction that differs between the directions."""
        if _is_alike(mount) and not has(mount, TorqueOffset):
            return f"{RESTLESS} the friction asymmetry that was found"
        return super().why_not(mount, prepared)


def _is_alike(mount: Mount) -> bool:
    """Whether friction of two directions is there already, and a constant torque no more than that."""
    return not mount.friction.states() and has(mount, FrictionAsymmetry)
