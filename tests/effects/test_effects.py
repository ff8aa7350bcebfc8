"""Effects act where they say, resist, and are written with the ids and words of the contract."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from effect_examples import EXAMPLES

from pyfmi_models.effects import (
    CATALOGUE,
    ActuatorLag,
    ClockEffect,
    Cogging,
    Coupling,
    Delay,
    DriveEffect,
    Effect,
    FrictionEffect,
    InertiaEffect,
    LoadEffect,
    Motion,
    SensorEffect,
    StribeckEffect,
)
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

MULTIPLIED = ("friction_asymmetry", "stribeck", "position_friction", "thermal_viscosity")
MULTIPLIERS = [one for one in EXAMPLES if one.id in MULTIPLIED and not one.states()]
KINDS = (DriveEffect, FrictionEffect, LoadEffect, InertiaEffect, Coupling, SensorEffect, ClockEffect)


def motion(q: float = 0.0, v: float = 0.1, turn: float = 1.0) -> Motion:
    return Motion(t=0.0, q=q, v=v, angle=turn * q)


def acceleration(*effects: Effect, q: float = 0.0, v: float = 0.0, tau: float = 0.0, **changes: Any) -> float:
    """Acceleration of a 2 kg m2 axis with Coulomb friction of 1 N m, from the plant's own equations."""
    law = Coulomb(Fc=1.0, sigma2=3.0)
    model = Mount(name="m", axis=Axis(inertia=2.0), friction=law, effects=effects, **changes).model()
    state = [q, v, *[0.0] * (len(model.states) - 2)]
    rates, _ = model.equations(0, state, [tau, 0], [parameter.start for parameter in model.parameters])
    return float(rates[1])


def state_space(drive: DriveEffect) -> tuple[np.ndarray, ...]:
    """Matrices (A, B, C, D) from command to applied torque, from the effect's equations."""
    x, u = ca.SX.sym("x", len(drive.states())), ca.SX.sym("u")
    outputs = (drive.rate(x, u), drive.applied(x, u))
    slopes = [ca.jacobian(ca.SX(output), variable) for output in outputs for variable in (x, u)]
    return tuple(value.full() for value in ca.Function("slopes", [x, u], slopes)(0, 0))


def frequency_response(drive: DriveEffect, omega: np.ndarray) -> np.ndarray:
    A, B, C, D = state_space(drive)
    return np.array([(C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D).item() for w in omega])


@pytest.mark.parametrize("effect", EXAMPLES, ids=lambda one: type(one).__name__)
@pytest.mark.parametrize("unit", ["N·m", "N"])
def test_an_effect_says_what_it_is_and_what_tells_it_from_its_rivals(effect: Effect, unit: str) -> None:
    statement = effect.statement(unit)
    assert statement.endswith(".")
    assert "\n" not in statement
    assert "N·m" not in statement or unit == "N·m"
    for text in (effect.title, effect.told_apart_by, effect.action):
        assert text
    assert effect.id not in effect.rivals
    assert set(effect.rivals) <= set(CATALOGUE)


@pytest.mark.parametrize("effect", EXAMPLES, ids=lambda one: type(one).__name__)
def test_an_effect_acts_in_one_place(effect: Effect) -> None:
    assert sum(isinstance(effect, kind) for kind in KINDS) == 1


# Loads


def test_cycles_of_a_linear_axis_are_per_metre() -> None:
    effect = Cogging(cycles_per_rev=4, amplitude=1.0)
    for q, load in ((0.0, 1.0), (0.125, -1.0), (0.25, 1.0), (1.0, 1.0)):
        assert acceleration(effect, q=q, motion="linear") == pytest.approx(-load / 2.0, abs=1e-12)


# Friction


@pytest.mark.parametrize("effect", MULTIPLIERS, ids=lambda one: one.id)
def test_friction_that_is_not_there_cannot_be_multiplied(effect: FrictionEffect) -> None:
    expected = pytest.approx(0, abs=1e-12)
    warm = motion(1.0)._replace(inputs={"temperature": 35.0})
    assert isinstance(effect, StribeckEffect) or float(effect.level(0.0, warm)) == expected
    assert float(effect.viscous(0.0, warm)) == expected


# Drive


def test_the_plant_sends_the_command_through_its_drive_effects_in_series() -> None:
    drives = (Delay(delay_ms=4.0), ActuatorLag(time_constant_ms=3.0))
    model = Mount(name="m", axis=Axis(inertia=2.0), friction=Coulomb(Fc=0.0), effects=drives).model()
    values = [parameter.start for parameter in model.parameters]
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", len(model.states)), ca.SX.sym("u", 2)
    rates, outputs = model.equations(t, x, u, values)
    applied = [one.name for one in model.outputs].index("applied")
    wanted = [ca.jacobian(part, of)[:, :] for part in (rates, outputs[applied]) for of in (x, u[0])]
    A, B, C, D = (part.full() for part in ca.Function("slopes", [t, x, u], wanted)(0, 0, 0))
    A, B, C = A[2:, 2:], B[2:], C[:, 2:]
    for omega in (1.0, 40.0, 300.0):
        found = (C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B) + D).item()
        alone = [frequency_response(drive, np.array([omega])).item() for drive in drives]
        assert found == pytest.approx(alone[0] * alone[1], rel=1e-9)
