"""How the needed torque changes with the friction level."""

from dataclasses import replace

import numpy as np

from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models.effects import PeriodicFriction
from pyfmi_models.mount import Mount


def friction_level(mount: Mount, prepared: Prepared) -> Array:
    """Derivative of the needed torque by a relative change of the friction level, at the kept rows."""
    if mount.friction.key == "none":
        return np.zeros(len(prepared.recording_of))
    scaled = PeriodicFriction(cycles_per_rev=0.0, relative_amplitude=0.0, phase=0.0)
    extended = replace(mount, effects=(*mount.effects, scaled))
    name = f"{list(extended.components())[-1]}.relative_amplitude"
    return stacked(Inverse(extended, (name,)), prepared.pieces, np.zeros(1))[1][:, 0]
