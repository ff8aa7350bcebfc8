"""Friction laws, one a file; every file of this folder is found by itself.

`LAWS` maps the word used in a card to the law; laws from outside (`pyfmi_models.plugins`) come into it as they are
loaded.
"""

from pyfmi_models import plugins
from pyfmi_models.discovery import classes_in
from pyfmi_models.errors import PluginError
from pyfmi_models.friction.base import FrictionLaw, MemorylessLaw
from pyfmi_models.friction.coulomb import Coulomb, Frictionless
from pyfmi_models.friction.dahl import Dahl
from pyfmi_models.friction.lugre import LuGre
from pyfmi_models.friction.maxwell_slip import MaxwellSlip
from pyfmi_models.friction.stribeck import Stribeck

LAWS: dict[str, type[FrictionLaw]] = {law.key: law for law in classes_in(__name__, __path__, FrictionLaw, "key")}
_OWN = frozenset(LAWS)


def _adopt(law: type[FrictionLaw]) -> None:
    """Take a law from outside; one that is defined anew, as in a notebook, replaces the one of before."""
    if law.key in _OWN:
        raise PluginError(f'{law.__module__}.{law.__name__}: the key "{law.key}" is that of a law of this package.')
    LAWS[law.key] = law


plugins.follow(FrictionLaw, "key", _adopt)

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
