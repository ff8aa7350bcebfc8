"""What a machine is off the equation of a named effect is no evidence of another one."""

from dataclasses import replace

import numpy as np
import pytest
from problems import compared, problem_of
from wandering import axis, recorded, swing

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.adequacy import share_beside
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.stages import weighed
from cosim.estimation.problem import Problem
from pyfmi_models.effects import FrictionAsymmetry
from pyfmi_models.effects.quadratic_drag import QuadraticDrag

MOUNT = axis()
DRAG, EVEN = QuadraticDrag(coefficient=6.0), FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=0.0)


def oiled(drag_one_way: float = 0.0, level_one_way: float = 0.0, phase: float = 1.0) -> Problem:
    """An axis in oil; its drag, or its friction level, is larger by this share forward and smaller backward."""
    t = np.arange(8000) / 200
    q, v, a = swing(t, [(0.5, 0.9, 2 * phase), (0.1, 3.1, 2.0 + phase), (0.02, 7.0, 0.5 + phase)], per=1)
    way = np.sign(v)
    tau = 5 * a + 2 * way * (1 + level_one_way * way) + v + 6 * v * np.abs(v) * (1 + drag_one_way * way)
    return problem_of(MOUNT, recorded(tau + 0.01 * np.random.default_rng(1).standard_normal(len(t)), t, q))


@pytest.mark.parametrize(
    ("one_way", "low", "high"),
    [
        pytest.param({"drag_one_way": 0.12}, -np.inf, POLICY.clear, id="a drag that is stronger one way is none"),
        pytest.param({"level_one_way": 0.1}, POLICY.strong, np.inf, id="a level that is higher one way is one"),
    ],
)
def test_evidence_of_a_friction_asymmetry_beside_a_drag(one_way: dict[str, float], low: float, high: float) -> None:
    comparison, _ = compared(oiled(**one_way), 30)
    alone, both = (comparison.problem.fit(replace(MOUNT, effects=some), 30) for some in ((DRAG,), (DRAG, EVEN)))
    assert low < weighed(comparison, both, alone).evidence < high


@pytest.mark.parametrize(("one_way", "is_left"), [(0.15, False), (0.6, True)])
def test_what_an_equation_may_miss_is_no_rest_and_what_no_machine_misses_is(one_way: float, is_left: bool) -> None:
    comparison, base = compared(oiled(drag_one_way=one_way), 30)
    there = oiled(drag_one_way=one_way, phase=2.0).prepared
    found = comparison.problem.fit(replace(MOUNT, effects=(DRAG,)), 30)
    held = Predictive.of(comparison, there, base, there)
    share = share_beside(comparison, found, held.residual(found.mount), held)
    assert (share > POLICY.slight) is is_left


def test_what_a_rest_follows_is_asked_beside_what_named_equations_may_miss_not_beside_those_of_the_card() -> None:
    problem = oiled(drag_one_way=0.12)
    with_drag = replace(MOUNT, effects=(DRAG,))
    speed = np.abs(problem.prepared.stacked("v"))
    column = (speed / np.sqrt(np.mean(speed**2)))[:, None]
    named, known = (
        compared(one, 30)[0].group(one.fit(with_drag, 30), column)[0]
        for one in (problem, replace(problem, mount=with_drag))
    )
    assert named < 0.5 * known
    assert known > POLICY.sure
