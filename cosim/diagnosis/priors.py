"""How far a fitted number may be from its fit: the priors of evidence."""

import numpy as np

from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array
from pyfmi_models.friction import FrictionLaw
from pyfmi_models.model import Pair


def trust(found: Fit) -> Array:
    """How far each free parameter may move from its fit before its tangent says nothing more: standard deviations."""
    law = found.mount.friction
    return np.array([_trust(law, name, value) for name, value in zip(found.free, found.values, strict=True)])


def _trust(law: FrictionLaw, name: str, value: float) -> float:
    if name.endswith("phase"):
        return 1.0
    return (0.1 if name.startswith("friction.") and not is_linear(law, name) else 1.0) * max(abs(value), 1e-12)


def is_linear(law: FrictionLaw, name: str) -> bool:
    """Whether the torque is linear in a parameter of the law, by its full name; a number of one side counts as such."""
    owner, _, own = name.partition(".")
    return owner == "friction" and (own in law.linear or own.endswith(tuple(f".{side}" for side in Pair._fields)))
