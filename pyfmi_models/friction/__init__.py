"""Friction laws, one a file. `LAWS` maps the word used in a card to the law."""

from pyfmi_models.friction.base import FrictionLaw, MemorylessLaw
from pyfmi_models.friction.coulomb import Coulomb, Frictionless
from pyfmi_models.friction.dahl import Dahl
from pyfmi_models.friction.lugre import LuGre
from pyfmi_models.friction.maxwell_slip import MaxwellSlip
from pyfmi_models.friction.stribeck import Stribeck

LAWS: dict[str, type[FrictionLaw]] = {
    law.key: law for law in (Frictionless, Coulomb, Stribeck, Dahl, LuGre, MaxwellSlip)
}

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
