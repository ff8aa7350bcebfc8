"""A controller that remembers: a repeated path is learned, friction is identified while it is compensated."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from simulating import simulate

from pyfmi_models.adrc import (
    Adaptation,
    Adrc,
    DifferencedVelocity,
    Estimate,
    Gains,
    Learning,
    Observer,
    Seen,
    compensation_case,
)
from pyfmi_models.export import export_fmu
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Model, Pair

J, H = 30.0, 1e-3
GAINS = Gains(inertia=J, kp=225.0, kd=30.0, observer_bandwidth=220.0)
LUGRE = LuGre(sigma0=9.23e4, sigma1=497.0, sigma2=32.77, Fc=2.322, Fs=3.322, Vs=0.04129)
STARS = 5 * 7.268e-5


def controller(*estimates: Estimate, **changes: Any) -> Model:
    return Adrc(**({"name": "m", "gains": GAINS, "period": H, "estimates": estimates} | changes)).model()


def sine(seconds: float, frequency: float = 0.2) -> np.ndarray:
    """Position, speed and acceleration of the paper's reference, a row a tick."""
    w, t = 2 * np.pi * frequency, H * np.arange(round(seconds / H))
    return np.stack([STARS / w * np.sin(w * t), STARS * np.cos(w * t), -STARS * w * np.sin(w * t)], axis=1)


def close(model: Model, reference: np.ndarray, resist: np.ndarray) -> dict[str, np.ndarray]:
    """Close the loop around an exact double integrator; a command acts from the next tick on.

    Args:
        model: the controller.
        reference: position, speed and acceleration, a row a tick.
        resist: resisting torque [N m], one a tick.
    """
    n = len(model.states)
    x, u = ca.SX.sym("x", n + 3), ca.SX.sym("u", 4)
    q, v, pending = x[n], x[n + 1], x[n + 2]
    following, outputs = model.equations(0, x[:n], ca.vertcat(q, u[:3]), [one.start for one in model.parameters])
    push = (pending - u[3]) / J
    after = ca.vertcat(following, q + H * v + H * H / 2 * push, v + H * push, outputs[0])
    start = [*(one.start for one in model.states), reference[0, 0], reference[0, 1], resist[0]]
    step = ca.Function("step", [x, u], [after, ca.vertcat(outputs, q, x[:n])])
    rows = step.mapaccum(len(resist))(start, ca.DM(np.column_stack([reference, resist])).T)[1].full()
    names = [*(one.name for one in model.outputs), "q", *(one.name for one in model.states)]
    return dict(zip(names, rows, strict=True)) | {"e": reference[:, 0] - rows[len(model.outputs)]}


def friction_of(law: LuGre, speed: np.ndarray, bias: float = 0.0) -> np.ndarray:
    """Friction torque of a prescribed motion."""
    (part,) = compensation_case("C3a", law)
    numbers = {variable.name: ca.SX(variable.start) for variable in part.parameters()}
    x, v = ca.SX.sym("x", 2), ca.SX.sym("v")
    state, torque = part.advance(numbers, ca.vertsplit(x), Seen(0, v, 0), H)
    step = ca.Function("step", [x, v], [ca.vertcat(*state), torque])
    return np.asarray(step.mapaccum(len(speed))(0, ca.DM(speed).T)[1].full()).ravel() + bias


# Learning

PASS = 1000
"""Ticks of a pass: 1 s."""


def passes(count: int, torque: float = 2.0) -> np.ndarray:
    """A torque that reverses twice a pass, as friction does, within 50 ms."""
    one = torque * np.tanh(np.sin(2 * np.pi * np.arange(PASS) / PASS) / 0.3)
    return np.tile(one, count)


def test_what_repeats_is_learned_from_pass_to_pass() -> None:
    resist = passes(12)
    still = np.zeros((len(resist), 3))
    plain = close(controller(), still, resist)["e"].reshape(12, PASS).std(axis=1)
    found = close(controller(Learning(ticks=PASS, lead=3 / 220)), still, resist)
    error = found["e"].reshape(12, PASS).std(axis=1)
    assert np.all(np.diff(error[:8]) < 0)
    assert error[-1] < 0.1 * plain[-1]
    np.testing.assert_allclose(found["friction_estimate"][-PASS:], resist[-PASS:], atol=0.02)


# On-line identification


@pytest.mark.parametrize(("level", "stiffness", "bias"), [(1.3, 0.8, 0.4), (0.7, 1.5, -0.6)])
@pytest.mark.parametrize("start", [LUGRE, replace(LUGRE, Fc=Pair(2.322, 2.322))])
def test_level_stiffness_and_bias_are_found_while_the_axis_moves(
    level: float, stiffness: float, bias: float, start: LuGre
) -> None:
    true = replace(LUGRE, Fc=level * 2.322, Fs=level * 3.322, sigma0=stiffness * 9.23e4)
    reference = sine(40)
    resist = friction_of(true, reference[:, 1], bias)
    found = close(controller(Adaptation(law=start)), reference, resist)
    assert found["adaptation.level"][-1] == pytest.approx(level, rel=0.02)
    assert found["adaptation.stiffness"][-1] == pytest.approx(stiffness, rel=0.05)
    assert found["adaptation.bias"][-1] == pytest.approx(bias, abs=0.03)
    plain = close(controller(*compensation_case("C3a", LUGRE)), reference, resist)
    late = slice(30_000, None)
    assert found["e"][late].std() < 0.25 * plain["e"][late].std()


def test_steady_sliding_does_not_wind_up_what_it_cannot_tell() -> None:
    """At constant speed level and bias are one number, and stiffness none: no variance grows beyond its start."""
    t = H * np.arange(30_000)  # fifteen times its memory
    reference = np.stack([STARS * t, np.full_like(t, STARS), np.zeros_like(t)], axis=1)
    found = close(controller(Adaptation(law=LUGRE, memory=2.0)), reference, friction_of(LUGRE, reference[:, 1], 0.2))
    for name in ("P00", "P11", "P22"):
        variance = found[f"adaptation.{name}"]
        assert variance.max() <= 1.001 * variance[0]
        assert variance.min() > 0


def test_the_fmu_of_a_controller_with_everything_gives_the_same_numbers(tmp_path: Path) -> None:
    parts = (Adaptation(law=LUGRE, source="observed"), Learning(ticks=PASS, knots=20))
    model = controller(*parts, observer=Observer(order=4), velocity=DifferencedVelocity())
    fmu = export_fmu(model, tmp_path / "c.fmu")
    reference = sine(1.5)
    q = reference[:, 0] + 1e-6 * np.sin(np.arange(len(reference)))
    signals = {"q": q, "q_d": reference[:, 0], "v_d": reference[:, 1], "a_d": reference[:, 2]}
    wires = [(name, f"c.{name}") for name in signals]
    record = {"tau": "c.tau", "level": "c.adaptation.level", "learned": "c.learning.torque3"}
    done = simulate({"c": fmu}, wires, record=record, step=H, ticks=len(q), signals=signals).recording
    x, u = ca.SX.sym("x", len(model.states)), ca.SX.sym("u", 4)
    tick = ca.Function("tick", [x, u], model.equations(0, x, u, [one.start for one in model.parameters]))
    state, outputs = tick.mapaccum(len(q))([one.start for one in model.states], ca.DM(np.stack([q, *reference.T])))
    names = [one.name for one in model.states]
    np.testing.assert_allclose(np.asarray(done["tau"])[1:], outputs.full()[0, :-1], rtol=1e-9, atol=1e-9)
    for column, name in (("level", "adaptation.level"), ("learned", "learning.torque3")):
        np.testing.assert_allclose(np.asarray(done[column])[1:], state.full()[names.index(name), :-1], rtol=1e-8)
