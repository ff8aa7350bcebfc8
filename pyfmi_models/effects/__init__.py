"""Kinds of physics a model may lack, one a file.

`CATALOGUE` maps the id used in cards and answers to the forms of that effect: usually one class, several where the
same physics has more than one shape (a rough spot, a periodic rise). A form is found by the names of its parameters.
"""

from pyfmi_models.effects.actuator_lag import ActuatorLag
from pyfmi_models.effects.base import DriveEffect, Effect, FrictionEffect, LoadEffect, Motion
from pyfmi_models.effects.cogging import Cogging
from pyfmi_models.effects.delay import Delay
from pyfmi_models.effects.friction_asymmetry import FrictionAsymmetry
from pyfmi_models.effects.gravity_unbalance import GravityUnbalance
from pyfmi_models.effects.position_friction import LocalFriction, PeriodicFriction
from pyfmi_models.effects.stribeck import StribeckEffect
from pyfmi_models.effects.torque_offset import TorqueOffset

FORMS: tuple[type[Effect], ...] = (
    StribeckEffect,
    FrictionAsymmetry,
    PeriodicFriction,
    LocalFriction,
    Cogging,
    GravityUnbalance,
    TorqueOffset,
    ActuatorLag,
    Delay,
)

CATALOGUE: dict[str, tuple[type[Effect], ...]] = {}
for _form in FORMS:
    CATALOGUE[_form.id] = (*CATALOGUE.get(_form.id, ()), _form)

__all__ = [
    "CATALOGUE",
    "FORMS",
    "ActuatorLag",
    "Cogging",
    "Delay",
    "DriveEffect",
    "Effect",
    "FrictionAsymmetry",
    "FrictionEffect",
    "GravityUnbalance",
    "LoadEffect",
    "LocalFriction",
    "Motion",
    "PeriodicFriction",
    "StribeckEffect",
    "TorqueOffset",
]
