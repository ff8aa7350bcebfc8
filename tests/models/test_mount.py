"""What an axis declares, and the limit of its drive; how it moves is in `test_model_equations.py`."""

from typing import Any

import numpy as np
import pytest
from effect_examples import evaluate

from pyfmi_models.effects import Cogging, Effect, GravityUnbalance, TorqueOffset
from pyfmi_models.friction import FrictionLaw, Frictionless, LuGre
from pyfmi_models.mount import Axis, Mount

J = 30.0
LUGRE = LuGre(sigma0=9.23e4, sigma1=497.0, sigma2=32.77, Fc=2.322, Fs=3.322, Vs=0.04129)


def mount(friction: FrictionLaw = Frictionless(), *effects: Effect, **changes: Any) -> Mount:
    return Mount(**({"name": "m", "axis": Axis(inertia=J), "friction": friction, "effects": effects} | changes))


@pytest.mark.parametrize("tau", [-9.0, -5.0, 3.0, 5.0, 50.0])
def test_the_drive_gives_no_more_than_its_limit(tau: float) -> None:
    found = evaluate(mount(axis=Axis(inertia=J, torque_limit=5.0)).model(), tau=tau)
    assert found["applied"] == np.clip(tau, -5, 5)
    assert found["der(speed)"] == pytest.approx(np.clip(tau, -5, 5) / J)


def test_a_repeated_effect_has_parameters_of_its_own() -> None:
    twice = (Cogging(cycles_per_rev=k, amplitude=1.0) for k in (4, 8, 12))
    names = {v.name: v.start for v in mount(Frictionless(), *twice, TorqueOffset(torque=1)).parameters()}
    assert [names[f"{one}.cycles_per_rev"] for one in ("cogging", "cogging2", "cogging3")] == [4, 8, 12]
    assert names["torque_offset.torque"] == 1


def test_a_linear_axis_has_linear_units() -> None:
    effects = (GravityUnbalance(mgl=1.0), Cogging(cycles_per_rev=400, amplitude=1.0, phase=0.1))
    linear = mount(LUGRE, *effects, motion="linear")
    model = linear.model()
    units = {v.name: v.unit for part in (model.inputs, model.outputs, model.states, model.parameters) for v in part}
    assert units == {
        **{"tau": "N", "disturbance": "N", "q": "m", "v": "m/s", "friction": "N", "applied": "N"},
        **{"position": "m", "speed": "m/s", "friction.bristle": "N", "axis.inertia": "kg", "axis.torque_limit": "N"},
        **{"friction.sigma0": "N/m", "friction.sigma1": "N.s/m", "friction.sigma2": "N.s/m"},
        **{"friction.Fc": "N", "friction.Fs": "N", "friction.Vs": "m/s", "friction.delta": "1"},
        **{"gravity_unbalance.mgl": "N", "gravity_unbalance.phase": "rad"},
        **{"cogging.cycles_per_rev": "1", "cogging.amplitude": "N", "cogging.phase": "rad"},
    }
    rotary = {variable.name: variable.unit for variable in mount(LUGRE, *effects).parameters()}
    assert rotary["axis.inertia"] == "kg.m2"
    assert rotary["friction.sigma0"] == "N.m/rad"
