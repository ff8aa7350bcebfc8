"""What a start knows only roughly of an effect is found by further fits."""

import numpy as np
import pytest

from cosim.diagnosis.fit import with_values
from cosim.diagnosis.prepare import prepare
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.tuning import tuned
from cosim.recording import Recording
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.effects.thermal_viscosity import ThermalViscosity
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount


def warmed(name: str, coldest: float, phase: float) -> Recording:
    """20 s in air and grease that thins as it warms up."""
    t = np.arange(4000) / 200
    tones = [(0.5, 0.11, phase), (0.1, 0.37, 1.0 + phase), (0.02, 0.9, 2.0)]
    waves = [(a, 2 * np.pi * f, 2 * np.pi * f * t + p) for a, f, p in tones]
    q = sum(a * np.sin(x) for a, _, x in waves)
    v = sum(a * w * np.cos(x) for a, w, x in waves)
    acceleration = sum(-a * w**2 * np.sin(x) for a, w, x in waves)
    temperature = coldest + 8 * t / t[-1]
    thinner = np.exp(-0.04 * (temperature - 20))
    tau = 5 * acceleration + 2 * np.sign(v) + 3 * v * thinner + 1.5 * v * np.abs(v)
    noise = 0.002 * np.random.default_rng(int(coldest)).standard_normal(len(t))
    return Recording(name, {"t": t, "tau": tau + noise, "q": q, "temperature": temperature})


def test_grease_is_found_to_thin_where_a_drag_had_taken_its_place() -> None:
    card = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0))
    prepared = prepare([warmed("cold", 8.0, 0.0), warmed("warm", 16.0, 2.0)], 20.0)
    weight = (np.abs(prepared.stacked("v")) > 0.02).astype(float)
    problem, start = Problem(card, prepared, weight, 0.005), ThermalViscosity(viscous_per_degC=-0.3)
    drag = Mount(name="axis", axis=card.axis, friction=card.friction, effects=(QuadraticDrag(coefficient=6.0), start))
    stuck = problem.fit(with_values(drag, ("friction.sigma2",), np.array([1e-3])), 12)
    assert stuck.parameters()["friction.sigma2"] < 0.3
    found = tuned(problem, stuck, start).parameters()
    assert found["thermal_viscosity.viscous_per_degC"] == pytest.approx(-0.04, rel=0.05)
    assert found["friction.sigma2"] == pytest.approx(3.0, rel=0.05)
