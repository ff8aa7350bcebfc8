"""Of which rows a model says anything: at rest a friction law without memory says nothing."""

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.prepare import Array
from pyfmi_models.friction import FrictionLaw, MemorylessLaw

CLEAR_MOTION = 0.02
"""Clear motion: faster than this share of the highest speed."""


def least_speed(v: Array) -> float:
    """Speed above which motion is clear, on the scale of these speeds."""
    return CLEAR_MOTION * float(np.abs(v).max())


def claimed(law: FrictionLaw, v: Array) -> npt.NDArray[np.bool_]:
    """Rows at these speeds of which the law says something: all, or without memory those in clear motion."""
    if isinstance(law, MemorylessLaw):
        return np.abs(v) > least_speed(v)
    return np.ones(len(v), bool)
