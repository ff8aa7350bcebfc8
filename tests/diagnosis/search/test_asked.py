"""A spring must be asked for by the set point, and what is late must be late away from turns too."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.commanded import is_asked_for
from cosim.diagnosis.search.stages import admission, weighed
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import away_from_turns
from pyfmi_models.effects import Delay
from pyfmi_models.effects.compliance import LoadSideCompliance
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

J, DT, SECONDS = 2.0, 2e-3, 60.0
MOUNT = Mount(name="axis", axis=Axis(inertia=J), friction=Coulomb(Fc=0.5, sigma2=0.5), effects=())
SPRING = LoadSideCompliance(resonance_hz=12.0, encoder_share=0.5)


def motion(noise: float, asked: float, seed: int) -> tuple[Any, Any, Any]:
    """Time, set point and position of an axis that a slow loop holds: torque noise moves it, the loop answers."""
    rng, t = np.random.default_rng(seed), np.arange(0, SECONDS, DT)
    q_d = 0.5 * np.sin(2 * np.pi * 0.2 * t) + asked * np.sin(2 * np.pi * 5 * t) / (2 * np.pi * 5) ** 2
    w, e = 2 * np.pi * 4, rng.standard_normal(len(t)) * noise
    # e'' + 1.4 w e' + w^2 e = noise, by semi-implicit Euler
    moved = lfilter([DT**2], [1, -2 + 1.4 * w * DT + (w * DT) ** 2, 1 - 1.4 * w * DT], e)
    return t, q_d, q_d + moved


def recordings(noise: float, asked: float, spring: bool) -> list[Recording]:
    """Two recordings: the torque of the loop, without the noise that moved the axis, or of a machine with a spring."""
    out = []
    for seed in (1, 2):
        t, q_d, q = motion(noise, asked, seed)
        v, a = np.gradient(q, DT), np.gradient(np.gradient(q, DT), DT)
        desired = np.gradient(np.gradient(q_d, DT), DT)
        w = 2 * np.pi * 4
        answer = desired - 1.4 * w * np.gradient(q - q_d, DT) - w**2 * (q - q_d)
        tau = J * (a if spring else answer) + 0.5 * v + 0.5 * np.sign(v)
        if spring:
            tau = tau + J * np.gradient(np.gradient(a, DT), DT) / (2 * np.pi * 12.0) ** 2
        out.append(Recording(f"run_{seed}", {"t": t, "q": q, "q_d": q_d, "tau": tau}))
    return out


def asked_for(noise: float, asked: float, spring: bool, *, with_set_point: bool = True) -> bool:
    made = recordings(noise, asked, spring)
    if not with_set_point:
        made = [Recording(one.name, {n: one.table[n] for n in ("t", "q", "tau")}) for one in made]
    prepared = prepare(made, 8.0)
    problem = Problem(MOUNT, prepared, np.ones(len(prepared.recording_of)), DT)
    base = problem.fit(MOUNT, 25)
    found = problem.fit(replace(base.mount, effects=(SPRING,)), 15)
    return is_asked_for(Comparison.of(problem, base, POLICY), found, found.mount.effects[-1])


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_a_spring_that_the_set_point_moves_is_asked_for(noise: float) -> None:
    assert asked_for(noise, 2.0, True)


def test_a_loop_that_answers_noise_is_no_spring() -> None:
    assert not asked_for(5.0, 0.0, False)


def test_without_a_set_point_nobody_can_be_asked() -> None:
    assert asked_for(5.0, 0.0, False, with_set_point=False)


def swung(left: Any) -> tuple[Problem, Any, Any]:
    """Rows of a motion that turns every 5 s, what is left of them with an effect (`left` of the time), and without."""
    t = np.arange(0, SECONDS, DT)
    recording = Recording("run", {"t": t, "q": np.sin(2 * np.pi * 0.1 * t), "tau": np.zeros_like(t)})
    prepared = prepare([recording], 8.0)
    when = prepared.stacked("t")
    problem = Problem(MOUNT, prepared, np.ones(len(when)), DT)
    return problem, left(when), np.ones(len(when))


def turning(t: Any) -> Any:
    """0 for 60 ms after each turn, 1 elsewhere: all that is removed is removed there."""
    return np.where((t - 2.5) % 5.0 < 0.06, 0.0, 1.0)


def test_where_something_removes_energy() -> None:
    problem, left, without = swung(turning)
    assert away_from_turns(problem, left, without) == 1.0  # a hundredth of the energy says nothing
    loud = np.where(turning(problem.prepared.stacked("t")) == 0.0, 5.0, 1.0)
    assert away_from_turns(problem, left, loud) == pytest.approx(0.0, abs=1e-12)
    assert away_from_turns(problem, 0 * left, without) == pytest.approx(0.94, abs=0.03)


def test_what_is_late_about_turns_alone_is_not_named() -> None:
    """An axis that sticks within a step of its encoder is read late as it turns: the friction is 20 ms ahead, alone."""
    made = []
    for seed in (1, 2):
        t = np.arange(0, SECONDS, DT)
        v = np.cos(2 * np.pi * 0.3 * t + seed) + 0.3 * np.cos(2 * np.pi * 0.11 * t)
        ahead = np.sign(np.interp(t + 0.02, t, v))
        a = np.gradient(v, DT)
        noise = 0.02 * np.random.default_rng(seed).standard_normal(len(t))
        tau = 0.01 * a + 0.5 * v + 2 * ahead + noise
        made.append(Recording(f"run_{seed}", {"t": t, "q": np.cumsum(v) * DT, "tau": tau}))
    mount = replace(MOUNT, axis=Axis(inertia=0.01), friction=Coulomb(Fc=2.0, sigma2=0.5))
    prepared = prepare(made, 8.0)
    problem = Problem(mount, prepared, np.ones(len(prepared.recording_of)), DT)
    base = problem.fit(problem.mount, 25)
    comparison = Comparison.of(problem, base, POLICY)
    found = problem.fit(replace(base.mount, effects=(Delay(delay_ms=5.0),)), 15)
    one = weighed(comparison, found, base)
    assert one.evidence > POLICY.clear
    assert one.away < POLICY.small
    assert not all_pass(admission(comparison, one))
    assert all_pass(admission(comparison, replace(one, away=1.0)))
