"""The controller and its parts: tick by tick as their docstrings say, and what they are worth in a closed loop."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import comb, exp
from pathlib import Path
from random import Random
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
import pytest
from simulating import simulate

from pyfmi_models.adrc import (
    VELOCITIES,
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
from pyfmi_models.friction import Frictionless, LuGre
from pyfmi_models.model import Chapter, Model, Pair
from pyfmi_models.mount import Axis, Mount

Array = npt.NDArray[np.float64]
BANDWIDTH, H = 220.0, 1e-3
LUGRE = LuGre(sigma0=9.23e4, sigma1=497.0, sigma2=32.77, Fc=2.322, Fs=3.322, Vs=0.04129)
STEP = 1e-5
"""Relative step of a central difference: its error is of its square, 1e-10."""
TICKS = 400


def ticks(part: Estimate, seen: Array, period: float = H) -> tuple[Array, Array]:
    """States after each tick and the torque expected in it; `seen` has observed speed, reference and residual."""
    states, numbers = part.states(), {one.name: ca.SX(one.start) for one in part.parameters()}
    numbers["observer_bandwidth"] = ca.SX(BANDWIDTH)
    x, u = ca.SX.sym("x", len(states)), ca.SX.sym("u", 3)
    state, torque = part.advance(numbers, ca.vertsplit(x), Seen(*ca.vertsplit(u)), period)
    step = ca.Function("step", [x, u], [ca.vertcat(*state), torque])
    found, torques = step.mapaccum(len(seen))([one.start for one in states], ca.DM(seen).T)
    return found.full().T, torques.full().ravel()


def slope(formula: Callable[[float], float], place: float, size: float) -> float:
    """Central difference."""
    return (formula(place + STEP * size) - formula(place - STEP * size)) / (2 * STEP * size)


class Expected:
    """The recursion of `Adaptation` in numpy; derivatives are differences of LuGre's own equations."""

    def __init__(self, widest: float, memory: float, slowest: float, noise: float, doubt: float) -> None:
        self.theta, self.bristle, self.before = np.array([1.0, 1.0, 0.0]), 0.0, 0.0
        self.slopes, self.chain = np.zeros(2), np.zeros((2, 3))
        self.first = np.array([doubt, doubt, doubt * 3.322]) ** 2
        self.P, self.R = np.diag(self.first), noise**2 * 2 * 0.3 / H
        self.widest, self.memory, self.slowest = widest, memory, slowest

    def walked(self, v: float, z: float, level: float, stiffness: float) -> float:
        law = replace(LUGRE, Fc=level * 2.322, Fs=level * 3.322, sigma0=stiffness * 9.23e4)
        return float(law.advance(z, v, law.level(v), H))

    def felt(self, v: float, z: float, level: float, stiffness: float) -> float:
        law = replace(LUGRE, Fc=level * 2.322, Fs=level * 3.322, sigma0=stiffness * 9.23e4)
        return float(law.contact(z, v, law.level(v)) + law.viscous(v))

    def along(self, formula: Callable[[float, float, float, float], float], v: float) -> tuple[float, Array]:
        """Value of a formula, and how it goes with level and stiffness, also by way of the bristle."""
        z, level, stiffness = self.bristle, self.theta[0], self.theta[1]
        by_z = slope(lambda one: formula(v, one, level, stiffness), z, 1.0)
        by_level = slope(lambda one: formula(v, z, one, stiffness), level, 1.0)
        by_stiffness = slope(lambda one: formula(v, z, level, one), stiffness, 1.0)
        return formula(v, z, level, stiffness), by_z * self.slopes + [by_level, by_stiffness]

    def tick(self, v: float, residual: float) -> float:
        self.bristle, self.slopes = self.along(self.walked, (self.before + v) / 2)
        torque, regressors = self.along(self.felt, v)
        self.before = v
        for filters, value in zip(self.chain, regressors, strict=True):
            for k in range(3):
                filters[k] = value = filters[k] + (1 - np.exp(-BANDWIDTH * H)) * (value - filters[k])
        if abs(v) > self.slowest:
            self.learn(np.array([*self.chain[:, 2], 1.0]), residual)
        return torque + float(self.theta[2])

    def learn(self, phi: Array, residual: float) -> None:
        push = self.P @ phi
        spread = self.R + phi @ push
        self.theta += push / spread * residual
        self.P = self.P - np.outer(push, push) / spread
        if np.all(np.diag(self.P) < self.first):
            self.P = self.P * (1 + H / self.memory)
        self.theta[:2] = np.clip(self.theta[:2], 1 / self.widest, self.widest)
        self.theta[2] = np.clip(self.theta[2], -3.322, 3.322)  # the break-away torque of the model, not of the estimate


def motion(seed: int) -> Array:
    """Speeds through zero and rest, and a residual that pushes estimates to their bounds."""
    rng, t = np.random.default_rng(seed), H * np.arange(TICKS)
    v = 4e-3 * np.sin(40 * t + seed) * (np.abs(np.sin(9 * t)) > 0.3)
    return np.column_stack([v + 1e-4, v, 40 * np.sin(25 * t) + rng.normal(0, 1, TICKS)])


@pytest.mark.parametrize("source", ["reference", "observed"])
@pytest.mark.parametrize("numbers", [{}, {"widest": 1.2, "memory": 0.2, "slowest": 2e-3, "noise": 0.05, "doubt": 0.4}])
def test_identification_is_recursive_least_squares_with_forgetting(numbers: dict[str, float], source: str) -> None:
    all_numbers = {"widest": 3.0, "memory": 20.0, "slowest": 2e-5, "noise": 0.5, "doubt": 0.3} | numbers
    seen = motion(len(numbers))
    found, torques = ticks(Adaptation(law=LUGRE, source=source, **numbers), seen)  # type: ignore[arg-type]
    expected, speeds = Expected(**all_numbers), seen[:, 1 if source == "reference" else 0]
    for state, torque, v, residual in zip(found, torques, speeds, seen[:, 2], strict=True):
        assert torque == pytest.approx(expected.tick(v, residual), rel=1e-6, abs=1e-6)
        np.testing.assert_allclose(state[:3], expected.theta, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(state[3:7], [expected.bristle, v, *expected.slopes], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(state[7:13], expected.chain.ravel(), rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(state[13:], expected.P[np.triu_indices(3)], rtol=1e-5, atol=1e-7)
    assert np.ptp(found[:, :3], axis=0).min() > 1e-3
    if numbers:  # every bound was met
        assert (found[:, :2].max(), np.abs(found[:, 2]).max()) == (1.2, 3.322)
        assert found[:, :2].min() == pytest.approx(1 / 1.2)


def hats(clock: float, knots: int, of: int) -> Array:
    """1 at a knot, 0 at its neighbours, round the circle."""
    distance = np.abs(clock * knots / of - np.arange(knots)) % knots
    return np.maximum(0, 1 - np.minimum(distance, knots - distance))


@pytest.mark.parametrize(("lead", "limit"), [(0.0, 1e6), (0.0136, 1e6), (0.03, 0.05)])
def test_a_pass_learns_its_share_of_the_residual_where_it_belongs(lead: float, limit: float) -> None:
    of, knots, gain = 150, 7, 0.4
    seen = motion(3)
    found, torques = ticks(Learning(ticks=of, knots=knots, gain=gain, lead=lead, limit=limit), seen)
    learned = np.zeros(knots)
    for k, (state, torque, residual) in enumerate(zip(found, torques, seen[:, 2], strict=True)):
        clock = k % of
        assert torque == pytest.approx(float(learned @ hats(clock, knots, of)), abs=1e-9)
        learned = learned + gain * knots / of * residual * hats(clock - lead / H, knots, of)
        learned = np.clip(learned, -limit, limit)
        np.testing.assert_allclose(state, [(k + 1) % of, *learned], atol=1e-9)
    assert np.abs(learned).max() > 0.04


# The whole controller

J, B, KP, KD, LIMIT = 3.0, 120.0, 400.0, 40.0, 25.0


@dataclass(frozen=True, kw_only=True)
class Linear(Estimate):
    """A torque that goes with all that an estimate sees."""

    def chapter(self, onto: str) -> Chapter:
        return Chapter(prefix="linear", name="", title="", text="", onto=onto)

    def advance(self, symbols: Any, state: list[Any], seen: Seen, period: float) -> Any:
        return [], 0.7 + 3.0 * seen.observed - 0.5 * seen.reference + 0.05 * seen.residual


class Controlled:
    """States of the controller between ticks."""

    def __init__(self, order: int, source: str) -> None:
        self.order, self.source, self.started = order, source, False
        self.last = self.acted = self.expected = self.q_last = 0.0
        self.zeta = np.zeros(order)

    def observe(self, q: float) -> None:
        if not self.started:
            self.zeta = np.array([q, *[0.0] * (self.order - 1)])
            return
        push = (self.acted - self.expected) / J
        z1, z2, z3, *rest = self.zeta
        jerk = rest[0] if rest else 0.0
        a = z3 + push
        predicted = [z1 + H * z2 + H**2 / 2 * a + H**3 / 6 * jerk, z2 + H * a + H**2 / 2 * jerk, z3 + H * jerk, jerk]
        surprise = q - predicted[0]
        gains = Observer(order=self.order).gains(exp(-B * H), H)  # type: ignore[arg-type]
        self.zeta = np.array([p + k * surprise for p, k in zip(predicted, map(float, gains), strict=False)])

    def tick(self, q: float, q_d: float, v_d: float, a_d: float) -> tuple[float, float]:
        self.observe(q)
        speed = (q - self.q_last) / H if self.source == "difference" and self.started else self.zeta[1]
        friction = 0.7 + 3.0 * self.zeta[1] - 0.5 * v_d - 0.05 * J * self.zeta[2]
        wanted = J * (a_d + KP * (q_d - q) + KD * (v_d - speed) - self.zeta[2]) + friction
        tau = float(np.clip(wanted, -LIMIT, LIMIT))
        self.acted, self.last = self.last, tau
        self.expected, self.q_last, self.started = friction, q, True
        return tau, friction


@pytest.mark.parametrize("order", [3, 4])
@pytest.mark.parametrize("source", ["observer", "difference"])
def test_a_controller_ticks_as_its_equations_say(order: Any, source: str) -> None:
    gains = Gains(inertia=J, kp=KP, kd=KD, observer_bandwidth=B, torque_limit=LIMIT)
    observer = Observer(order=order)
    made = Adrc(name="m", gains=gains, period=H, observer=observer, velocity=VELOCITIES[source], estimates=(Linear(),))
    model, dice, own = made.model(), Random(order), Controlled(order, source)
    state, numbers = [one.start for one in model.states], [one.start for one in model.parameters]
    torques = []
    for _ in range(60):
        u = [dice.uniform(-5e-5, 5e-5), dice.uniform(-0.02, 0.02), dice.uniform(-0.3, 0.3), dice.uniform(-3, 3)]
        following, outputs = model.equations(0.0, state, u, numbers)
        state = following.full().ravel()
        tau, friction = own.tick(*u)
        np.testing.assert_allclose(outputs.full().ravel(), [tau, friction, *own.zeta[:3]], rtol=1e-9, atol=1e-12)
        torques.append(tau)
    assert 5 < len(set(torques)) - 2 < 55
    assert {-LIMIT, LIMIT} < {*torques}, "within the limit, and at it on both sides"
    assert model.period == H


@pytest.mark.parametrize("order", [3, 4])
@pytest.mark.parametrize("pole", [0.2, 0.9, 0.999])
def test_every_pole_of_the_observer_is_at_one_place(order: Any, pole: float) -> None:
    """(I - K C) A of the chain of integrators has the polynomial (z - pole)^n."""
    chain = np.array(
        [[H ** (j - i) / [1, 1, 2, 6][j - i] if j >= i else 0.0 for j in range(order)] for i in range(order)]
    )
    gains = np.array([float(one) for one in Observer(order=order).gains(pole, H)])
    corrected = chain - np.outer(gains, chain[0])
    scale = np.diag([H**k for k in range(order)])
    found = np.poly(scale @ corrected @ np.linalg.inv(scale))
    np.testing.assert_allclose(found, [comb(order, k) * (-pole) ** k for k in range(order + 1)], atol=1e-9)


# In a closed loop: what is compensated, learned and identified is worth what theory says.

INERTIA, FINE = 30.0, 1e-4
GAINS = Gains(inertia=INERTIA, kp=225.0, kd=30.0, observer_bandwidth=220.0)
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
    push, h = (pending - u[3]) / INERTIA, model.period
    after = ca.vertcat(following, q + h * v + h * h / 2 * push, v + h * push, outputs[0])
    start = [*(one.start for one in model.states), reference[0, 0], reference[0, 1], resist[0]]
    step = ca.Function("step", [x, u], [after, ca.vertcat(outputs, q, v, x[:n])])
    rows = step.mapaccum(len(resist))(start, ca.DM(np.column_stack([reference, resist])).T)[1].full()
    names = [*(one.name for one in model.outputs), "q", "v", *(one.name for one in model.states)]
    return dict(zip(names, rows, strict=True)) | {"e": reference[:, 0] - rows[len(model.outputs)]}


def compensated(law: LuGre, speed: np.ndarray, period: float = H) -> tuple[Array, Array]:
    """Bristles and friction torque of a law on a prescribed motion."""
    return ticks(*compensation_case("C3a", law), np.column_stack([0 * speed, speed, 0 * speed]), period)


def test_the_observer_is_fed_the_command_that_acted_also_by_fmus_in_the_master(tmp_path: Path) -> None:
    """An impulse of tick 10 acts from tick 11: an observer fed with it at that moment is never surprised."""
    kick = np.zeros((200, 3))
    kick[10, 2] = 1.0
    found = close(controller(period=FINE), kick, np.zeros(200))
    assert found["tau"][10] == pytest.approx(INERTIA)
    assert found["q"][11] == 0
    assert found["q"][12] == pytest.approx(FINE**2 / 2)
    np.testing.assert_allclose(found["zeta1"], found["q"], rtol=0, atol=1e-20)
    np.testing.assert_allclose(found["zeta2"], found["v"], rtol=0, atol=1e-15)
    # What rounding of q (5e-9 rad, 1e-24) leaves in zeta3 is multiplied by (1 - pole)^3 / H^2 = 1e3.
    assert np.abs(found["zeta3"]).max() < 1e-12
    mount = Mount(name="m", axis=Axis(inertia=INERTIA), friction=Frictionless())
    fmus = {"plant": export_fmu(mount.model(), tmp_path / "plant.fmu")}
    fmus["controller"] = export_fmu(controller(period=FINE), tmp_path / "controller.fmu")
    wires = [("controller.tau", "plant.tau"), ("plant.q", "controller.q"), ("pulse", "controller.a_d")]
    record = {name: f"controller.{name}" for name in ("tau", "zeta1", "zeta3")} | {"q": "plant.q"}
    done = simulate(fmus, wires, record=record, step=FINE, ticks=200, signals={"pulse": kick[:, 2]}).recording
    np.testing.assert_allclose(done["q"], found["q"], rtol=1e-7, atol=1e-18)  # the solver's tolerance, 1e-8
    # An output computed at tick k is seen from tick k+1 on.
    np.testing.assert_allclose(np.asarray(done["tau"])[1:], found["tau"][:-1], atol=1e-6)
    assert np.abs(done["zeta3"]).max() < 1e-7


def test_compensation_integrates_the_bristles_with_the_speed_of_the_middle() -> None:
    """At 5 deg/s and 2 Hz: 1e-5 of break-away, where the speed of the start of the step would leave 1e-2."""

    def bristles(period: float) -> np.ndarray:
        v = np.radians(5) * np.sin(4 * np.pi * period * np.arange(1, round(1 / period) + 1))
        return compensated(LUGRE, v, period)[0][:, 0]

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


def test_what_repeats_is_learned_from_pass_to_pass() -> None:
    """A torque that reverses twice a pass of 1 s, as friction does, within 50 ms."""
    of, count = 1000, 12
    resist = np.tile(2.0 * np.tanh(np.sin(2 * np.pi * np.arange(of) / of) / 0.3), count)
    still = np.zeros((len(resist), 3))
    plain = close(controller(), still, resist)["e"].reshape(count, of).std(axis=1)
    found = close(controller(Learning(ticks=of, lead=3 / 220)), still, resist)
    error = found["e"].reshape(count, of).std(axis=1)
    assert np.all(np.diff(error[:8]) < 0)
    assert error[-1] < 0.1 * plain[-1]
    np.testing.assert_allclose(found["friction_estimate"][-of:], resist[-of:], atol=0.02)


@pytest.mark.parametrize(("level", "stiffness", "bias"), [(1.3, 0.8, 0.4), (0.7, 1.5, -0.6)])
@pytest.mark.parametrize("start", [LUGRE, replace(LUGRE, Fc=Pair(2.322, 2.322))])
def test_level_stiffness_and_bias_are_found_in_motion(level: float, stiffness: float, bias: float, start: Any) -> None:
    true = replace(LUGRE, Fc=level * 2.322, Fs=level * 3.322, sigma0=stiffness * 9.23e4)
    reference = sine(40)
    resist = compensated(true, reference[:, 1])[1] + bias
    found = close(controller(Adaptation(law=start)), reference, resist)
    assert found["adaptation.level"][-1] == pytest.approx(level, rel=0.02)
    assert found["adaptation.stiffness"][-1] == pytest.approx(stiffness, rel=0.05)
    assert found["adaptation.bias"][-1] == pytest.approx(bias, abs=0.03)
    plain = close(controller(*compensation_case("C3a", LUGRE)), reference, resist)
    late = slice(30_000, None)
    assert found["e"][late].std() < 0.25 * plain["e"][late].std()


def test_the_fmu_of_a_controller_with_everything_gives_the_same_numbers(tmp_path: Path) -> None:
    parts = (Adaptation(law=LUGRE, source="observed"), Learning(ticks=1000, knots=20))
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
