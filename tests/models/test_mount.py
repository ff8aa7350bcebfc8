"""The mount moves as Newton says: closed forms, energy, and the units of a linear axis."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyfmi_models.effects import ActuatorLag, Cogging, Effect, FrictionAsymmetry, GravityUnbalance, TorqueOffset
from pyfmi_models.friction import Coulomb, FrictionLaw, Frictionless, LuGre
from pyfmi_models.model import Model, Pair
from pyfmi_models.mount import Axis, Mount

J = 30.0
LUGRE = LuGre(sigma0=9.23e4, sigma1=497.0, sigma2=32.77, Fc=2.322, Fs=3.322, Vs=0.04129)
Torque = Callable[[float], float]


def mount(friction: FrictionLaw = Frictionless(), *effects: Effect, **changes: Any) -> Mount:
    return Mount(**({"name": "m", "axis": Axis(inertia=J), "friction": friction, "effects": effects} | changes))


def values(model: Model) -> list[float]:
    return [parameter.start for parameter in model.parameters]


def evaluate(
    model: Model, t: float, x: Any, tau: float, disturbance: float = 0.0
) -> tuple[np.ndarray, dict[str, float]]:
    """Rates of the states, and the outputs by name."""
    rates, outputs = model.equations(t, x, [tau, disturbance], values(model))
    names = [variable.name for variable in model.outputs]
    return rates.full().ravel(), dict(zip(names, outputs.full().ravel().tolist(), strict=True))


def move(model: Model, tau: Torque, end: float, speed: float = 0.0) -> np.ndarray:
    """States at 501 times up to the end, by an implicit method at its tightest."""
    start = [speed if state.name == "speed" else state.start for state in model.states]
    times = np.linspace(0, end, 501)
    found = solve_ivp(
        lambda t, x: evaluate(model, t, x, tau(t))[0], (0, end), start, "Radau", times, rtol=1e-9, atol=1e-12
    )
    assert found.success
    return np.asarray(found.y)


@pytest.mark.parametrize(
    "effects", [(), (FrictionAsymmetry(level_asymmetry=0.2),), (ActuatorLag(time_constant_ms=20),)], ids=len
)
def test_work_is_kinetic_energy_plus_potential_energy_plus_heat(effects: tuple[Effect, ...]) -> None:
    swing = mount(Coulomb(Fc=1.0, sigma2=5.0), GravityUnbalance(mgl=40.0, phase=0.3), *effects)
    model = swing.model()
    t = np.linspace(0, 3, 501)
    states = move(model, lambda t: 8 * np.sin(3 * t), 3.0, speed=0.4)
    q, v = states[:2]
    outputs = [evaluate(model, time, x, 8 * np.sin(3 * time))[1] for time, x in zip(t, states.T, strict=True)]
    power = np.array([(one["applied"] - one["friction"]) * one["v"] for one in outputs])
    heat = np.array([one["friction"] * one["v"] for one in outputs])
    stored = 0.5 * J * v**2 + 40.0 * (np.cos(0.3) - np.cos(q + 0.3))
    worked = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(t))])
    # The trapezoidal rule meets the jump of friction at each reversal: half a sample of 1 N m at v near 0.
    np.testing.assert_allclose(stored - stored[0], worked, atol=2e-3 * np.abs(worked).max())
    assert heat.min() >= 0


def test_at_rest_the_bristles_are_a_damped_spring() -> None:
    """Linearised at rest: J q'' + (sigma1 + sigma2) q' + sigma0 q = 0, 8.8 Hz for the paper's mount."""
    model, small = mount(LUGRE).model(), 1e-9
    columns = [evaluate(model, 0, small * row, 0.0)[0] / small for row in np.eye(3)]
    found = sorted(np.linalg.eigvals(np.array(columns).T), key=abs)
    expected = np.roots([J, LUGRE.sigma1 + LUGRE.sigma2, LUGRE.sigma0])
    assert abs(found[0]) < 1e-6  # the axis may rest anywhere
    for root in expected:
        assert min(abs(root - one) for one in found[1:]) < 1e-4 * abs(root)


def test_below_break_away_the_axis_bends_and_holds() -> None:
    q, v, bristle = move(mount(LUGRE).model(), lambda t: 1.0, 3.0)
    assert bristle[-1] == pytest.approx(1.0, rel=1e-3)
    # z = tau / sigma0 and the part that slid meanwhile: -(Fs / sigma0) ln(1 - tau / Fs) for a slow load
    assert 1.0 / LUGRE.sigma0 < q[-1] < 2 * -(LUGRE.Fs / LUGRE.sigma0) * np.log(1 - 1.0 / LUGRE.Fs)
    assert abs(v[-1]) < 1e-7


def test_above_break_away_it_slides_at_the_speed_where_friction_meets_the_torque() -> None:
    _, v, bristle = move(mount(LUGRE).model(), lambda t: 6.0, 20.0)
    expected = (6.0 - LUGRE.Fc) / LUGRE.sigma2  # far above Vs: Fc + sigma2 v
    assert v[-1] == pytest.approx(expected, rel=1e-3)
    assert bristle[-1] == pytest.approx(float(LUGRE.level(expected)), rel=1e-3)


@pytest.mark.parametrize("tau", [-9.0, -5.0, 3.0, 5.0, 50.0])
def test_the_drive_gives_no_more_than_its_limit(tau: float) -> None:
    model = mount(axis=Axis(inertia=J, torque_limit=5.0)).model()
    rates, outputs = evaluate(model, 0, [0, 0], tau)
    assert outputs["applied"] == np.clip(tau, -5, 5)
    assert rates[1] == pytest.approx(np.clip(tau, -5, 5) / J)


@pytest.mark.parametrize("v", [-0.2, 0.2])
def test_friction_by_direction_is_used_in_its_direction(v: float) -> None:
    model = mount(Coulomb(Fc=Pair(2.0, 3.0), sigma2=Pair(10.0, 20.0))).model()
    expected = 2.0 + 10 * 0.2 if v > 0 else -3.0 - 20 * 0.2
    assert evaluate(model, 0, [0, v], 0.0)[1]["friction"] == pytest.approx(expected)


def test_a_repeated_effect_has_parameters_of_its_own() -> None:
    twice = (Cogging(cycles_per_rev=k, amplitude=1.0) for k in (4, 8, 12))
    names = {v.name: v.start for v in mount(Frictionless(), *twice, TorqueOffset(torque=1)).parameters()}
    assert [names[f"{one}.cycles_per_rev"] for one in ("cogging", "cogging2", "cogging3")] == [4, 8, 12]
    assert names["torque_offset.torque"] == 1


def test_states_start_at_rest_and_carry_the_names_of_their_parts() -> None:
    model = mount(LUGRE, ActuatorLag(time_constant_ms=5.0)).model()
    assert [state.name for state in model.states] == ["position", "speed", "friction.bristle", "actuator_lag.x"]
    assert not any(state.start for state in model.states)
    assert evaluate(model, 0, [0, 0, 0, 0], 0.0)[0].tolist() == [0, 0, 0, 0]


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


def test_the_angle_of_a_linear_axis_turns_once_per_metre() -> None:
    assert mount(motion="linear").at(0, 0.25, 0).angle == pytest.approx(np.pi / 2)
    assert mount().at(0, 0.25, 0).angle == 0.25
