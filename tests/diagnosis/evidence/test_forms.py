"""What a machine is off the equation of a named effect is no evidence of another one."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.adequacy import share_beside
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.stages import weighed
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Effect, FrictionAsymmetry
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))
DRAG, EVEN = QuadraticDrag(coefficient=6.0), FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=0.0)


def problem_of(drag_one_way: float = 0.0, level_one_way: float = 0.0, phase: float = 1.0) -> Problem:
    """An axis in oil; its drag, or its friction level, is larger by this share forward and smaller backward."""
    t = np.arange(8000) / 200
    tones = [(0.5, 0.9, phase), (0.1, 3.1, 2.0), (0.02, 7.0, 0.5)]
    q = sum((size * np.sin(w * t + phase) for size, w, phase in tones), np.zeros_like(t))
    v = sum(size * w * np.cos(w * t + phase) for size, w, phase in tones)
    a = sum(-size * w**2 * np.sin(w * t + phase) for size, w, phase in tones)
    way = np.sign(v)
    tau = 5 * a + 2 * way * (1 + level_one_way * way) + v + 6 * v * np.abs(v) * (1 + drag_one_way * way)
    read = {"t": t, "q": q, "tau": tau + 0.01 * np.random.default_rng(1).standard_normal(len(t))}
    prepared = prepare([Recording("run", read)], 20.0)
    return Problem(MOUNT, prepared, (np.abs(prepared.stacked("v")) > 0.02).astype(float), 0.005)


def asymmetry_beside(drag: Effect, problem: Problem) -> float:
    """Nats of a friction asymmetry beside a drag."""
    comparison = Comparison.of(problem, problem.fit(MOUNT, 30), POLICY)
    alone, both = (problem.fit(replace(MOUNT, effects=some), 30) for some in ((drag,), (drag, EVEN)))
    return weighed(comparison, both, alone).evidence


def test_a_drag_that_is_stronger_one_way_is_no_friction_asymmetry() -> None:
    assert asymmetry_beside(DRAG, problem_of(drag_one_way=0.12)) < POLICY.clear


def test_a_friction_asymmetry_beside_a_drag_is_found() -> None:
    assert asymmetry_beside(DRAG, problem_of(level_one_way=0.1)) > POLICY.strong


@pytest.mark.parametrize(("one_way", "is_left"), [(0.15, False), (0.6, True)])
def test_what_an_equation_may_miss_is_no_rest_and_what_no_machine_misses_is(one_way: float, is_left: bool) -> None:
    problem, there = problem_of(drag_one_way=one_way), problem_of(drag_one_way=one_way, phase=2.0).prepared
    base, found = (problem.fit(replace(MOUNT, effects=some), 30) for some in ((), (DRAG,)))
    comparison = Comparison.of(problem, base, POLICY)
    held = Predictive.of(comparison, there, base, there)
    share = share_beside(comparison, found, held.residual(found.mount), held)
    assert (share > POLICY.slight) is is_left


def test_what_a_rest_follows_is_asked_beside_what_named_equations_may_miss_not_beside_those_of_the_card() -> None:
    problem = problem_of(drag_one_way=0.12)
    with_drag = replace(MOUNT, effects=(DRAG,))
    of_card = replace(problem, mount=with_drag)
    speed = np.abs(problem.prepared.stacked("v"))
    column = (speed / np.sqrt(np.mean(speed**2)))[:, None]
    named, known = (
        Comparison.of(one, one.fit(one.mount, 30), POLICY).group(one.fit(with_drag, 30), column)[0]
        for one in (problem, of_card)
    )
    assert named < 0.5 * known
    assert known > POLICY.sure
