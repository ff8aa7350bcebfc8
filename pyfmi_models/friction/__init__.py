"""Friction laws, one a file; every file of this folder is found by itself.

`LAWS` maps the word used in a card to the law.
"""

from pyfmi_models.discovery import classes_in
from pyfmi_models.friction.base import FrictionLaw, MemorylessLaw
from pyfmi_models.friction.coulomb import Coulomb, Frictionless
from pyfmi_models.friction.dahl import Dahl
from pyfmi_models.friction.lugre import LuGre
from pyfmi_models.friction.maxwell_slip import MaxwellSlip
from pyfmi_models.friction.stribeck import Stribeck

LAWS: dict[str, type[FrictionLaw]] = {law.key: law for law in classes_in(__name__, __path__, FrictionLaw, "key")}

# The contract, and the laws that other rooms name; a new law needs no line here.
__all__ = [
    "LAWS",
    "Coulomb",
    "Dahl",
    "FrictionLaw",
    "Frictionless",
    "LuGre",
    "MaxwellSlip",
    "MemorylessLaw",
    "Stribeck",
]
