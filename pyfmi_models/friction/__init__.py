"""Friction laws, one a file. `LAWS` maps the word used in a card to the law."""

from pyfmi_models.friction.base import FrictionLaw, MemorylessLaw
from pyfmi_models.friction.coulomb import Coulomb, Frictionless
from pyfmi_models.friction.lugre import LuGre
from pyfmi_models.friction.stribeck import Stribeck

LAWS: dict[str, type[FrictionLaw]] = {law.key: law for law in (Frictionless, Coulomb, Stribeck, LuGre)}

__all__ = ["LAWS", "Coulomb", "FrictionLaw", "Frictionless", "LuGre", "MemorylessLaw", "Stribeck"]
