"""A load that is known at each moment, from a recording or from another model."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.effects.base import Motion, PayloadEffect
from pyfmi_models.model import Scalar, Variable, parameter


@dataclass(frozen=True, kw_only=True)
class KnownLoad(PayloadEffect):
    """Weight that changes from run to run, or is measured: torque = gain load, resisting; the load is an input.

    The plant input and the column of a recording are called `load_torque` [N m]. A gain beside 1 says that load and
    drive torque are not on one scale, as where the drive's torque constant is known roughly.
    """

    id: ClassVar[str] = "known_load"
    title: ClassVar[str] = "Known load"
    rivals: ClassVar[tuple[str, ...]] = ("gravity_unbalance", "torque_offset")
    told_apart_by: ClassVar[str] = "it follows the load that was recorded; an unbalance follows the position alone"
    action: ClassVar[str] = "Nothing: the load is known."
    says: ClassVar[str] = "The known load acts with {0.gain:.3g} {unit} of drive torque for each {unit}."
    reads: ClassVar[tuple[Variable, ...]] = (
        Variable(name="load_torque", unit="N.m", description="Known load, resists"),
    )
    gain: Scalar = parameter("1", "Drive torque per torque of the load", default=1.0, low=0, high=1e3)

    def load(self, motion: Motion) -> Scalar:
        """`gain load_torque`."""
        return self.gain * motion.inputs["load_torque"]
