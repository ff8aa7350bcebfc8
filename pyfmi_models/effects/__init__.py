"""Kinds of physics a model may lack, one a file; every file of this folder is found by itself.

`CATALOGUE` maps the id used in cards and answers to the forms of that effect: usually one class, several where the
same physics has more than one shape (a rough spot, a periodic rise). A form is found by the names of its parameters.
Effects from outside (`pyfmi_models.plugins`) come into the catalogue as they are loaded.
"""

from pyfmi_models import plugins
from pyfmi_models.discovery import classes_in
from pyfmi_models.effects.actuator_lag import ActuatorLag
from pyfmi_models.effects.base import (
    ClockEffect,
    Coupling,
    DriveEffect,
    Effect,
    FrictionEffect,
    InertiaEffect,
    LoadEffect,
    Motion,
    MotionEffect,
    PayloadEffect,
    SensorEffect,
    Transmission,
)
from pyfmi_models.effects.cogging import Cogging
from pyfmi_models.effects.delay import Delay
from pyfmi_models.effects.friction_asymmetry import FrictionAsymmetry
from pyfmi_models.effects.friction_wander import FrictionWander
from pyfmi_models.effects.gravity_unbalance import GravityUnbalance
from pyfmi_models.effects.position_friction import LocalFriction, PeriodicFriction
from pyfmi_models.effects.stribeck import StribeckEffect
from pyfmi_models.effects.torque_offset import TorqueOffset
from pyfmi_models.errors import PluginError

FORMS: tuple[type[Effect], ...] = classes_in(__name__, __path__, Effect, "id")

CATALOGUE: dict[str, tuple[type[Effect], ...]] = {}
for _form in FORMS:
    CATALOGUE[_form.id] = (*CATALOGUE.get(_form.id, ()), _form)


def _adopt(form: type[Effect]) -> None:
    """Take an effect from outside; one that is defined anew, as in a notebook, replaces the one of before."""
    if any(own.id == form.id for own in FORMS):
        raise PluginError(
            f'{form.__module__}.{form.__name__}: the id "{form.id}" is that of an effect of this package.'
        )
    others = (one for one in CATALOGUE.get(form.id, ()) if not plugins.is_again(form, one))
    CATALOGUE[form.id] = (*others, form)


plugins.follow(Effect, "id", _adopt)

# The contract, and the effects that other rooms name; a new effect needs no line here.
__all__ = [
    "CATALOGUE",
    "FORMS",
    "ActuatorLag",
    "ClockEffect",
    "Cogging",
    "Coupling",
    "Delay",
    "DriveEffect",
    "Effect",
    "FrictionAsymmetry",
    "FrictionEffect",
    "FrictionWander",
    "GravityUnbalance",
    "InertiaEffect",
    "LoadEffect",
    "LocalFriction",
    "Motion",
    "MotionEffect",
    "PayloadEffect",
    "PeriodicFriction",
    "SensorEffect",
    "StribeckEffect",
    "TorqueOffset",
    "Transmission",
]
