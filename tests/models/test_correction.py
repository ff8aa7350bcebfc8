"""The torque that makes a plant do what a better model of it does, at single points of its motion."""

from dataclasses import replace

import numpy as np
import pytest
from effect_examples import evaluate, mount

from pyfmi_models.correction import correction
from pyfmi_models.effects import Cogging, GravityUnbalance, PeriodicFriction
from pyfmi_models.effects.actuator_lag import ActuatorLag
from pyfmi_models.friction import LuGre
from pyfmi_models.mount import Axis

WEIGHT = GravityUnbalance(mgl=5.0, phase=0.1)
WAVE = PeriodicFriction(cycles_per_rev=3, relative_amplitude=0.2, phase=0.4)
RIPPLE = Cogging(cycles_per_rev=4, amplitude=0.7, phase=0.2)


@pytest.mark.parametrize("v", [0.2, -0.3])
@pytest.mark.parametrize("tau", [0.0, 4.0])
def test_the_plant_gets_what_the_better_one_needs_and_its_own_friction_back(v: float, tau: float) -> None:
    plant = mount()
    better = replace(mount(WEIGHT, WAVE), axis=Axis(inertia=3.0))
    model, q = correction(plant, better), 0.7
    (corrected,) = model.outputs
    assert (corrected.name, corrected.unit) == ("corrected", "N.m")
    found = evaluate(model, tau=tau, q=q, v=v)[corrected.name]
    own = np.sign(v) + 3 * v
    needed = np.sign(v) * (1 + 0.2 * np.cos(3 * q + 0.4)) + 3 * v + 5 * np.sin(q + 0.1)
    assert found == pytest.approx((tau - needed) * 2 / 3 + own, rel=1e-12)
    assert (found - own) / 2 == pytest.approx((tau - needed) / 3), "the acceleration of the better one"


def test_states_of_both_sides_follow_the_motion_of_the_plant() -> None:
    """Each side's bristles bend by its own law, each drive lags behind the command by its own time."""
    law = LuGre(sigma0=1e4, sigma1=20.0, sigma2=3.0, Fc=1.0, Fs=1.5, Vs=0.1)
    other = replace(law, sigma0=2e4, Fc=2.0, Fs=2.5)
    plant = mount(ActuatorLag(time_constant_ms=40.0), friction=law)
    better = mount(ActuatorLag(time_constant_ms=10.0), RIPPLE, friction=other)
    model = correction(plant, better)
    bent = {"before.friction.bristle": 0.3, "after.friction.bristle": -0.6}
    own_lag, lag = (one.name for one in model.states if "actuator_lag" in one.name)
    found = evaluate(model, tau=4.0, q=0.3, v=0.02, **bent, **{own_lag: 3.5, lag: 2.5})
    for name, one in (("before", law), ("after", other)):
        z = bent[f"{name}.friction.bristle"]
        assert found[f"der({name}.friction.bristle)"] == pytest.approx(float(one.rate(z, 0.02, one.level(0.02))))
    assert found[f"der({own_lag})"] == pytest.approx((4.0 - 3.5) / 40e-3)
    assert found[f"der({lag})"] == pytest.approx((4.0 - 2.5) / 10e-3)
    own, needed = (
        float(one.contact(z, 0.02, one.level(0.02)) + one.viscous(0.02)) for one, z in ((law, 0.3), (other, -0.6))
    )
    needed += float(RIPPLE.load(mount().at(0.0, 0.3, 0.02)))
    assert found["corrected"] == pytest.approx(2.5 - needed + own, rel=1e-12)
