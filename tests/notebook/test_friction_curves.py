"""Friction over speed in the report: smooth curves of both cards, markers without the other effects."""

from dataclasses import replace

import numpy as np
import pytest
from report_example import diagnosis

from cosim.diagnosis.answer.result import Diagnosis, Finding, Where
from cosim.diagnosis.measure.breakdown import samples
from cosim.report.figures_friction import curves, friction
from cosim.report.page import context
from cosim.report.quantities import Scales

ASYMMETRY = Finding(
    effect="friction_asymmetry",
    title="Friction asymmetry",
    answer="found",
    probability=0.99,
    gain=0.5,
    parameters={"level_asymmetry": 0.2, "viscous_asymmetry": 0.0},
    where=Where(axis="direction", description="both directions", regions=()),
)
NUMBERS = {
    "axis.inertia": (0.8, 0.8, 0.8),
    "friction.Fc": (1.0, 1.1, 1.2),
    "friction.sigma2": (0.2, 0.2, 0.3),
}


@pytest.fixture
def told() -> Diagnosis:
    law = {"base": "coulomb", "proposed": "coulomb", "gain": 0.0}
    whole = diagnosis("two")
    others = [one for one in whole.findings if one.effect != ASYMMETRY.effect]
    return replace(whole, findings=(ASYMMETRY, *others), base_parameters=NUMBERS, friction_law=law)  # type: ignore[arg-type]


def test_curves_are_the_laws_of_both_cards(told: Diagnosis) -> None:
    both = curves(told)
    assert both is not None
    v = np.array([0.1, 0.5, 1.0])
    np.testing.assert_allclose(both.before(v), 1.1 + 0.2 * v)
    np.testing.assert_allclose(both.after(v), 1.2 * 1.2 + 0.3 * v)
    np.testing.assert_allclose(both.after(-v), -(0.8 * 1.2 + 0.3 * v))


def test_a_picture_is_drawn_with_smooth_curves_in_the_report(told: Diagnosis) -> None:
    drawn = friction(ASYMMETRY, told, samples(told.traces), Scales.of(told))
    assert drawn is not None
    assert "other effects taken out" in drawn.caption
    assert "dotted: backward" in drawn.caption
    shown = context(told)["blocks"]
    assert "improved card" in shown[0].picture.caption  # type: ignore[index]


@pytest.mark.parametrize("change", [{"base_parameters": {}}, {"friction_law": {}}, {"friction_law": {"base": "none"}}])
def test_without_the_numbers_of_the_law_there_is_no_curve(told: Diagnosis, change: dict[str, dict[str, str]]) -> None:
    less = replace(told, **change)  # type: ignore[arg-type]
    assert curves(less) is None
    assert friction(ASYMMETRY, less, samples(less.traces), Scales.of(less)) is None
