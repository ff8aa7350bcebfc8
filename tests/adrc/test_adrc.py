"""The controller's observer knows what acted; its friction compensation is worth what theory says."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from simulating import simulate

from pyfmi_models.adrc import Adrc, Gains, Seen, compensation_case
from pyfmi_models.export import export_fmu
from pyfmi_models.friction import Frictionless, LuGre
from pyfmi_models.model import Model
from pyfmi_models.mount import Axis, Mount

J, H, LIMIT = 30.0, 1e-4, 50.0
GAINS = Gains(inertia=J, kp=225.0, kd=30.0, observer_bandwidth=220.0, torque_limit=LIMIT)
LUGRE = LuGre(sigma0=9.23e4, sigma1=497.0, sigma2=32.77, Fc=2.322, Fs=3.322, Vs=0.04129)


def controller(case: str = "C1", **gains: float) -> Model:
    return Adrc(name="m", gains=replace(GAINS, **gains), period=H, estimates=compensation_case(case, LUGRE)).model()


def run(model: Model, ticks: int, **motion: Any) -> dict[str, np.ndarray]:
    """Close the loop around an exact double integrator; a command of tick k acts from tick k+1 to tick k+2.

    Args:
        model: the controller.
        ticks: how many.
        motion: reference(t) -> (q_d, v_d, a_d), resist(t) -> torque [N m], lag: ticks between command and action.
    """
    reference = motion.get("reference", lambda t: (0.0, 0.0, 0.0))
    resist, lag = motion.get("resist", lambda t: 0.0), motion.get("lag", 1)
    values = [variable.start for variable in model.parameters]
    memory, (q, v) = [state.start for state in model.states], motion.get("start", (0.0, 0.0))
    names = [variable.name for variable in model.outputs]
    pending, rows = [0.0] * lag, []
    for k in range(ticks):
        t = k * H
        memory, outputs = model.equations(t, memory, [q, *reference(t)], values)
        row = dict(zip(names, outputs.full().ravel().tolist(), strict=True))
        rows.append(row | {"q": q, "v": v, "q_d": reference(t)[0]})
        pending.append(row["tau"])
        push = (pending.pop(0) - resist(t)) / J
        q, v = q + H * v + H * H / 2 * push, v + H * push
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def kick(t: float) -> tuple[float, float, float]:
    """A set point that asks for one impulse of torque at tick 10, then for nothing."""
    return (0.0, 0.0, 1.0 if round(t / H) == 10 else 0.0)


@pytest.mark.parametrize("limit", [LIMIT, 1e6])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_command_is_the_control_law_within_the_limit(limit: float, sign: int) -> None:
    """Equation (7) with a fresh observer: zeta2 = zeta3 = 0."""
    model = controller(torque_limit=limit)
    values = [variable.start for variable in model.parameters]
    _, outputs = model.equations(0, [0] * len(model.states), [sign * one for one in (0.01, 0.03, 0.2, 0.5)], values)
    assert float(outputs[0]) == pytest.approx(sign * min(limit, J * (0.5 + 225 * 0.02 + 30 * 0.2)))


def test_the_observer_is_fed_the_command_that_acted() -> None:
    """An impulse of tick 10 acts from tick 11: an observer fed with it at that moment is never surprised."""
    found = run(controller(), 200, reference=kick)
    assert found["tau"][10] == pytest.approx(J)
    assert found["q"][11] == 0
    assert found["q"][12] == pytest.approx(H**2 / 2)
    np.testing.assert_allclose(found["zeta1"], found["q"], rtol=0, atol=1e-20)
    np.testing.assert_allclose(found["zeta2"], found["v"], rtol=0, atol=1e-15)
    # What rounding of q (5e-9 rad, 1e-24) leaves in zeta3 is multiplied by (1 - pole)^3 / H^2 = 1e3.
    assert np.abs(found["zeta3"]).max() < 1e-12


def test_the_fmus_in_the_master_give_the_same_moment(tmp_path: Path) -> None:
    """The same impulse through both FMUs and the compiled loop: the observer is not surprised there either."""
    mount = Mount(name="m", axis=Axis(inertia=J), friction=Frictionless())
    fmus = {"plant": export_fmu(mount.model(), tmp_path / "plant.fmu")}
    fmus["controller"] = export_fmu(controller(), tmp_path / "controller.fmu")
    pulse = np.array([kick(k * H)[2] for k in range(200)])
    wires = [("controller.tau", "plant.tau"), ("plant.q", "controller.q"), ("pulse", "controller.a_d")]
    record = {name: f"controller.{name}" for name in ("tau", "zeta1", "zeta3")} | {"q": "plant.q"}
    done = simulate(fmus, wires, record=record, step=H, ticks=200, signals={"pulse": pulse}).recording
    expected = run(controller(), 200, reference=kick)
    np.testing.assert_allclose(done["q"], expected["q"], rtol=1e-7, atol=1e-18)  # the solver's tolerance, 1e-8
    # An output computed at tick k is seen from tick k+1 on.
    np.testing.assert_allclose(np.asarray(done["tau"])[1:], expected["tau"][:-1], atol=1e-6)
    assert np.abs(done["zeta3"]).max() < 1e-7


def test_compensation_integrates_the_bristles_with_the_speed_of_the_middle() -> None:
    """At 5 deg/s and 2 Hz: 1e-5 of break-away, where the speed of the start of the step would leave 1e-2."""
    (part,) = compensation_case("C3a", LUGRE)
    x, before, now = ca.SX.sym("x"), ca.SX.sym("before"), ca.SX.sym("now")
    numbers = {variable.name: ca.SX(variable.start) for variable in part.parameters()}

    def bristles(period: float) -> np.ndarray:
        state, _ = part.advance(numbers, [x, before], Seen(0, now, 0), period)
        step = ca.Function("step", [x, before, now], [state[0]])
        v = np.radians(5) * np.sin(4 * np.pi * period * np.arange(round(1 / period) + 1))
        return step.mapaccum(len(v) - 1)(0, ca.DM(v[:-1]).T, ca.DM(v[1:]).T).full().ravel()

    fine = bristles(H / 20)[19::20]  # second order: 400 times better
    assert np.abs(bristles(H) - fine).max() < 5e-5 * LUGRE.Fs


@pytest.mark.parametrize("case", ["C3a", "C3b"])
def test_compensation_by_the_reference_is_the_friction_of_that_motion(case: str) -> None:
    """At constant set-point speed the estimate is steady sliding friction, whatever the axis does."""
    found = run(controller(case), 3000, reference=lambda t: (0.05 * t, 0.05, 0.0))
    expected = float(LUGRE.level(0.05)) + LUGRE.sigma2 * 0.05
    assert found["friction_estimate"][-1] == pytest.approx(expected, rel=1e-6)
