"""The observer knows what acted; what is compensated, learned and identified is worth what theory says."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from simulating import simulate
from test_adrc_equations import LUGRE, H, ticks

from pyfmi_models.adrc import (
    Adaptation,
    Adrc,
    DifferencedVelocity,
    Estimate,
    Gains,
    Learning,
    Observer,
    compensation_case,
)
from pyfmi_models.export import export_fmu
from pyfmi_models.friction import Frictionless, LuGre
from pyfmi_models.model import Model, Pair
from pyfmi_models.mount import Axis, Mount

J, FINE = 30.0, 1e-4
GAINS = Gains(inertia=J, kp=225.0, kd=30.0, observer_bandwidth=220.0)
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
    push, h = (pending - u[3]) / J, model.period
    after = ca.vertcat(following, q + h * v + h * h / 2 * push, v + h * push, outputs[0])
    start = [*(one.start for one in model.states), reference[0, 0], reference[0, 1], resist[0]]
    step = ca.Function("step", [x, u], [after, ca.vertcat(outputs, q, v, x[:n])])
    rows = step.mapaccum(len(resist))(start, ca.DM(np.column_stack([reference, resist])).T)[1].full()
    names = [*(one.name for one in model.outputs), "q", "v", *(one.name for one in model.states)]
    return dict(zip(names, rows, strict=True)) | {"e": reference[:, 0] - rows[len(model.outputs)]}


def seen_of(speed: np.ndarray) -> np.ndarray:
    """What an estimate sees of a reference, a row a tick."""
    return np.column_stack([0 * speed, speed, 0 * speed])


def friction_of(law: LuGre, speed: np.ndarray, bias: float = 0.0) -> np.ndarray:
    """Friction torque of a prescribed motion."""
    return np.asarray(ticks(*compensation_case("C3a", law), seen_of(speed))[1] + bias)


# The moment of a command, and compensation

KICK = np.zeros((200, 3))
KICK[10, 2] = 1.0
"""A set point that asks for one impulse of torque at tick 10, then for nothing."""


def test_the_observer_is_fed_the_command_that_acted() -> None:
    """An impulse of tick 10 acts from tick 11: an observer fed with it at that moment is never surprised."""
    found = close(controller(period=FINE), KICK, np.zeros(200))
    assert found["tau"][10] == pytest.approx(J)
    assert found["q"][11] == 0
    assert found["q"][12] == pytest.approx(FINE**2 / 2)
    np.testing.assert_allclose(found["zeta1"], found["q"], rtol=0, atol=1e-20)
    np.testing.assert_allclose(found["zeta2"], found["v"], rtol=0, atol=1e-15)
    # What rounding of q (5e-9 rad, 1e-24) leaves in zeta3 is multiplied by (1 - pole)^3 / H^2 = 1e3.
    assert np.abs(found["zeta3"]).max() < 1e-12


def test_the_fmus_in_the_master_give_the_same_moment(tmp_path: Path) -> None:
    """The same impulse through both FMUs and the compiled loop: the observer is not surprised there either."""
    mount = Mount(name="m", axis=Axis(inertia=J), friction=Frictionless())
    fmus = {"plant": export_fmu(mount.model(), tmp_path / "plant.fmu")}
    fmus["controller"] = export_fmu(controller(period=FINE), tmp_path / "controller.fmu")
    wires = [("controller.tau", "plant.tau"), ("plant.q", "controller.q"), ("pulse", "controller.a_d")]
    record = {name: f"controller.{name}" for name in ("tau", "zeta1", "zeta3")} | {"q": "plant.q"}
    done = simulate(fmus, wires, record=record, step=FINE, ticks=200, signals={"pulse": KICK[:, 2]}).recording
    expected = close(controller(period=FINE), KICK, np.zeros(200))
    np.testing.assert_allclose(done["q"], expected["q"], rtol=1e-7, atol=1e-18)  # the solver's tolerance, 1e-8
    # An output computed at tick k is seen from tick k+1 on.
    np.testing.assert_allclose(np.asarray(done["tau"])[1:], expected["tau"][:-1], atol=1e-6)
    assert np.abs(done["zeta3"]).max() < 1e-7


def test_compensation_integrates_the_bristles_with_the_speed_of_the_middle() -> None:
    """At 5 deg/s and 2 Hz: 1e-5 of break-away, where the speed of the start of the step would leave 1e-2."""

    def bristles(period: float) -> np.ndarray:
        v = np.radians(5) * np.sin(4 * np.pi * period * np.arange(1, round(1 / period) + 1))
        return np.asarray(ticks(*compensation_case("C3a", LUGRE), seen_of(v), period)[0][:, 0])

    fine = bristles(FINE / 20)[19::20]  # second order: 400 times better
    assert np.abs(bristles(FINE) - fine).max() < 5e-5 * LUGRE.Fs


@pytest.mark.parametrize(("case", "settled"), [("C3a", 1e-6), ("C3b", 1e-6), ("C2a+C3a", 0.01)])
def test_compensation_of_a_steady_motion_is_its_friction(case: str, settled: float) -> None:
    """At constant set-point speed the estimate is steady sliding friction; two halves are a whole.

    The observed speed has come within a per cent of it by then.
    """
    t = FINE * np.arange(3000)
    reference = np.stack([0.05 * t, np.full_like(t, 0.05), 0 * t], axis=1)
    found = close(controller(*compensation_case(case, LUGRE), period=FINE), reference, 0 * t)
    expected = float(LUGRE.level(0.05)) + LUGRE.sigma2 * 0.05
    assert found["friction_estimate"][-1] == pytest.approx(expected, rel=settled)


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
