"""The controller tick by tick, written again in plain Python from the equations of its docstrings."""

from dataclasses import dataclass
from math import comb, exp
from random import Random
from typing import Any

import numpy as np
import pytest

from pyfmi_models.adrc import VELOCITIES, Adrc, Estimate, Gains, Observer, Seen
from pyfmi_models.model import Chapter

J, H, B, KP, KD, LIMIT = 3.0, 1e-3, 120.0, 400.0, 40.0, 25.0


@dataclass(frozen=True, kw_only=True)
class Linear(Estimate):
    """A torque that goes with all that an estimate sees."""

    def chapter(self, onto: str) -> Chapter:
        return Chapter(prefix="linear", name="", title="", text="", onto=onto)

    def advance(self, symbols: Any, state: list[Any], seen: Seen, period: float) -> Any:
        return [], 0.7 + 3.0 * seen.observed - 0.5 * seen.reference + 0.05 * seen.residual


class Expected:
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
    model, dice, own = made.model(), Random(order), Expected(order, source)
    state, numbers = [one.start for one in model.states], [one.start for one in model.parameters]
    limited = 0
    for _ in range(60):
        u = [dice.uniform(-5e-5, 5e-5), dice.uniform(-0.02, 0.02), dice.uniform(-0.3, 0.3), dice.uniform(-3, 3)]
        following, outputs = model.equations(0.0, state, u, numbers)
        state = following.full().ravel()
        tau, friction = own.tick(*u)
        np.testing.assert_allclose(outputs.full().ravel(), [tau, friction, *own.zeta[:3]], rtol=1e-9, atol=1e-12)
        limited += abs(tau) == LIMIT
    assert 5 < limited < 55, "both within the limit and at it"
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
