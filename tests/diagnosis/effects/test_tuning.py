"""What a start knows only roughly of an effect is found by further fits."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.tuning import in_cycles
from cosim.estimation.fit import fit, with_values
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.inertia_variation import InertiaVariation
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


def test_a_metre_knows_no_whole_numbers_of_waves() -> None:
    t = np.arange(4000) / 200
    q, v, a = (0.1 * f for f in (np.sin(2 * t), 2 * np.cos(2 * t), -4 * np.sin(2 * t)))
    wave = 2 * np.pi * 0.6
    needed = 5 * (1 + 0.1 * np.cos(wave * q)) * a - 2.5 * 0.1 * wave * np.sin(wave * q) * v**2
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(t))  # in which a whole number fits as well
    prepared = prepare([Recording("r", {"t": t, "tau": needed + 2 * np.sign(v) + 3 * v + noise, "q": q})], 20.0)
    card = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0), motion="linear")
    problem = Problem(card, prepared, (np.abs(prepared.stacked("v")) > 0.01).astype(float), 0.005)
    start = InertiaVariation(relative_amplitude=0.05, cycles_per_rev=0.7)
    grown = problem.fit(replace(card, effects=(start,)), 12)
    found = in_cycles(problem, grown).mount.effects[-1]
    assert isinstance(found, InertiaVariation)
    assert found.cycles_per_rev != 1.0


def test_grease_is_found_to_thin_where_a_drag_had_taken_its_place() -> None:
    card = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0))
    prepared = prepare([warmed("cold", 8.0, 0.0), warmed("warm", 16.0, 2.0)], 20.0)
    weight = (np.abs(prepared.stacked("v")) > 0.02).astype(float)
    problem, start = Problem(card, prepared, weight, 0.005), ThermalViscosity(viscous_per_degC=-0.3)
    drag = Mount(name="axis", axis=card.axis, friction=card.friction, effects=(QuadraticDrag(coefficient=6.0), start))
    lost = with_values(drag, ("friction.sigma2",), np.array([1e-3]))
    stuck = fit(lost, prepared.pieces, weight, evaluations=12)  # held to where it starts, not to the card
    assert stuck.parameters()["friction.sigma2"] < 0.3
    found = hypothesis_of(start).tuned(problem, stuck, start, lambda one: -problem.error(one)).parameters()
    assert found["thermal_viscosity.viscous_per_degC"] == pytest.approx(-0.04, rel=0.05)
    assert found["friction.sigma2"] == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize(("second", "turns"), [(0.6, 6.0), (0.0, 12.0)])
def test_a_disc_is_found_at_its_own_turns_though_its_error_twice_a_turn_is_larger(second: float, turns: float) -> None:
    t = np.arange(8000) / 200
    q, v, a = (0.8 * f for f in (np.sin(t), np.cos(t), -np.sin(t)))
    once, twice = 6 * q + 0.4, 2 * (6 * q + 0.4)
    error = 2e-3 * (np.sin(once) + 0.6 * np.sin(twice)) if second else 1.2e-3 * np.sin(twice)
    noise = 0.01 * np.random.default_rng(2).standard_normal(len(t))
    read = {"t": t, "tau": 5 * a + 2 * np.sign(v) + 3 * v + noise, "q": q + error}
    prepared = prepare([Recording("r", read)], 20.0)
    card = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0))
    problem = Problem(card, prepared, (np.abs(prepared.stacked("v")) > 0.05).astype(float), 0.005)
    start = EncoderEccentricity(cycles_per_rev=12.0, amplitude_rad=1e-3, phase=0.8)
    began = problem.fit(replace(card, effects=(start,)), 12)
    tuned = hypothesis_of(start).tuned(problem, began, start, lambda fit: 1e3 * (1 - problem.error(fit)))
    found = tuned.mount.effects[-1]
    assert isinstance(found, EncoderEccentricity)
    assert found.cycles_per_rev == turns
    assert found.second == pytest.approx(second, abs=0.05)
    assert found.amplitude_rad == pytest.approx(2e-3 if second else 1.2e-3, rel=0.1)
