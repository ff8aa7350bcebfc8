"""How far a fitted number may be from its fit: the priors of evidence."""

import numpy as np

from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array
from pyfmi_models.friction import FrictionLaw
from pyfmi_models.model import Pair

PLACES = ("home", "q_center")
"""Names of numbers that are places on the axis: their size says nothing, as the encoder's zero is anywhere."""


def trust(found: Fit, reach: float) -> Array:
    """How far each free parameter may move from its fit before its tangent says nothing more: standard deviations.

    A place may lie anywhere in the motion, whose length is `reach` [rad, m].
    """
    law = found.mount.friction
    return np.array([_trust(law, name, value, reach) for name, value in zip(found.free, found.values, strict=True)])


def _trust(law: FrictionLaw, name: str, value: float, reach: float) -> float:
    if name.endswith("phase"):
        return 1.0
    if name.endswith(PLACES):
        return reach
    return (0.1 if name.startswith("friction.") and not is_linear(law, name) else 1.0) * max(abs(value), 1e-12)


def is_linear(law: FrictionLaw, name: str) -> bool:
    """Whether the torque is linear in a parameter of the law, by its full name; a number of one side counts as such."""
    owner, _, own = name.partition(".")
    return owner == "friction" and (own in law.linear or own.endswith(tuple(f".{side}" for side in Pair._fields)))
