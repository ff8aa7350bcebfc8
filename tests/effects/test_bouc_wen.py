"""Hysteresis of Bouc and Wen: its loop, its energy, and an FMU with all effects of this kind beside numpy alone."""

import numpy as np
import pytest
from effect_examples import mount
from export_models import Driver
from scipy.integrate import solve_ivp
from test_effects_of_cards import GEAR, SPOT, WEIGHT, drooped

from pyfmi_models.card import parse_card
from pyfmi_models.effects.bouc_wen import BoucWen
from pyfmi_models.effects.torque_droop import WarmTorqueDroop
from pyfmi_models.errors import CardError
from pyfmi_models.export import build_library
from pyfmi_models.friction import Coulomb


def turned(effect: BoucWen, way: np.ndarray, z: float = 0.0) -> np.ndarray:
    """State z along a way, by steps of Runge and Kutta in numpy, from the equation without the speed: dz/dq."""

    def slope(z: float, sign: float) -> float:
        fall = effect.beta * np.sign(z) * sign + effect.gamma
        return (effect.A - fall * np.abs(z) ** effect.n) / effect.stroke

    found = [z]
    for step in np.diff(way):
        h, sign = step, np.sign(step)
        a = slope(z, sign)
        b = slope(z + h / 2 * a, sign)
        c = slope(z + h / 2 * b, sign)
        d = slope(z + h * c, sign)
        z += h / 6 * (a + 2 * b + 2 * c + d)
        found.append(z)
    return np.array(found)


SHAPES = [{}, {"beta": 0.6, "gamma": -0.3, "n": 1.5}, {"A": 2.0, "beta": 0.4, "gamma": 0.1, "n": 4.0}]


@pytest.mark.parametrize("numbers", [*SHAPES, {"beta": 0.5, "gamma": -0.49}, {"beta": 2.0, "gamma": 2.0, "n": 3.0}])
def test_a_loop_never_gives_more_than_it_took(numbers: dict[str, float]) -> None:
    """Also from a state that no motion from zero reaches: at most z^2 T stroke / (2 A)."""
    effect, rng = BoucWen(torque=0.8, stroke=0.05, **numbers), np.random.default_rng(2)
    for z in (0.0, 0.7, -3.0):
        way = np.cumsum(np.repeat(rng.normal(0, 2e-3, 60), 40))
        states = turned(effect, way, z)
        work = np.cumsum(0.8 * (states[1:] + states[:-1]) / 2 * np.diff(way))
        assert work.min() >= -0.8 * 0.05 * z * z / (2 * effect.A) - 1e-6
        assert np.abs(states).max() <= max(abs(z), (effect.A / (effect.beta + effect.gamma)) ** (1 / effect.n)) + 1e-9


def test_numbers_that_would_make_energy_are_refused_in_a_sentence() -> None:
    """With gamma above beta, pushing back against a large z makes it larger still, without end."""
    bad = BoucWen(torque=1.0, stroke=0.05, beta=0.5, gamma=1.5)
    states = turned(bad, -np.linspace(0, 0.1, 4000), z=1.5)
    assert np.trapezoid(states, -np.linspace(0, 0.1, 4000)) < -2 * 0.05 * 1.5**2 / 2
    text = '[mount]\ninertia = 2.0\n[friction]\nmodel = "none"\n[[effects]]\neffect = "bouc_wen"\ntorque = 1.0\n'
    for beta, gamma in ((0.5, 1.5), (0.5, -0.5), (0.0, 0.0)):
        with pytest.raises(CardError, match=rf"\(bouc_wen\): gamma = {gamma:g} must be above -beta and at most beta"):
            parse_card(text + f"stroke = 0.05\nbeta = {beta}\ngamma = {gamma}\n", "c")
    assert parse_card(text + "stroke = 0.05\nbeta = 0.5\ngamma = 0.5\n", "c").effects


def rates(t: float, x: np.ndarray, tau: float) -> list[float]:
    """The plant of these effects in numpy: position, speed, z; inertia 2 kg m2, friction 1 N m and 3 N m s/rad."""
    q, v, z = x
    load = 2.0 * np.sin(q + 0.3)
    level = 1.0 * (1 + (0.8 if v > 0 else -0.3) * np.exp(-0.5 * ((q - 0.3) / 0.1) ** 2))
    level += (0.6 if load * v > 0 else 0.2) * abs(load)
    bent = (z * z + 1e-6) ** 0.25
    turning = (v - bent * (0.6 * abs(v) * z - 0.3 * v * abs(z))) / 0.05
    applied = drooped(tau, 0.2, 8.0) * (1 - 0.002 * (45.0 - 20.0))
    return [v, (applied - level * np.tanh(v / 1e-2) - 3 * v - load - 0.8 * z) / 2.0, turning]


def test_an_fmu_with_these_effects_moves_as_numpy_says() -> None:
    hysteresis = BoucWen(torque=0.8, stroke=0.05, beta=0.6, gamma=-0.3, n=1.5)
    warm = WarmTorqueDroop(droop=0.2, rated_torque=8.0, per_degC=-0.002)
    law = Coulomb(Fc=1.0, sigma2=3.0, smoothing=1e-2)
    model = mount(warm, SPOT, WEIGHT, GEAR, hysteresis, friction=law).model()
    driver, now, x, moved = Driver(model, build_library(model), 3), 0, np.zeros(3), []
    driver.start(tolerance=1e-9, temperature=45.0)
    for until, tau in ((300, 9.0), (700, -8.0), (900, 0.5), (1200, 7.0)):
        span = (now * 1e-3, until * 1e-3)
        x = solve_ivp(rates, span, x, "Radau", args=(tau,), rtol=1e-10, atol=1e-12, max_step=1e-3).y[:, -1]
        driver.set("tau", tau)
        driver.run(now * 1e-3, until - now, 1e-3)
        now = until
        found = np.array(driver.get("q", "v", "bouc_wen.z"))
        np.testing.assert_allclose(found, x, rtol=0, atol=2e-6)
        moved.append(found[0])
    assert np.ptp(moved) > 0.2
