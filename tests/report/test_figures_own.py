"""The figure of one effect shows that effect: its curve, and what was measured of it with the others taken out."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from report_example import FOUND, diagnosis, report_of
from report_text import text_of

from cosim.diagnosis.answer.result import Diagnosis, Finding
from cosim.diagnosis.measure.breakdown import samples
from cosim.plots.style import STYLE
from cosim.report.figures_own import own, own_torque
from cosim.report.page import payload
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture

Q, V = np.linspace(-3.0, 3.0, 200), np.where(np.arange(200) % 2, 0.4, -0.4)
RIPPLE = Finding(
    effect="position_friction", title="Position-dependent friction", answer="found", probability=0.9, gain=0.2,
    parameters={"cycles_per_rev": 2.0, "relative_amplitude": 0.25, "phase": 0.0}, size="25 %",
)  # fmt: skip
LAW = {"friction.Fc": (2.0, 2.0, 2.0), "friction.sigma2": (0.0, 0.0, 0.0)}


def drawn(finding: Finding, of: Diagnosis) -> Picture | None:
    with mpl.rc_context(STYLE):
        return own(finding, of, samples(of.traces), Scales.of(of))


def with_law(finding: Finding) -> Diagnosis:
    whole = diagnosis("two")
    return replace(
        whole, findings=(finding,), delivered=(finding.effect,), friction_law={"base": "coulomb"}, base_parameters=LAW
    )


def test_the_torque_of_a_ripple_is_its_wave_with_the_harmonics() -> None:
    torque = own_torque(FOUND[0], diagnosis("two"))
    assert torque is not None
    expected = 0.42 * np.cos(24 * Q + 0.4) + 0.125 * np.cos(48 * Q - 0.3)
    assert torque(Q, V) == pytest.approx(expected, abs=1e-9)


def test_friction_over_position_resists_by_its_share_of_the_level() -> None:
    torque = own_torque(RIPPLE, with_law(RIPPLE))
    assert torque is not None
    change = torque(Q, V) * np.sign(V)
    assert change.max() == pytest.approx(0.25 * 2.0, rel=0.05)
    assert torque(Q, -V) == pytest.approx(-torque(Q, V))


def test_an_effect_of_the_model_is_drawn_by_itself_and_one_that_is_not_there_is_not() -> None:
    whole = diagnosis("two")
    picture = drawn(FOUND[0], whole)
    assert picture is not None
    assert "other effects taken out" in picture.caption
    assert drawn(FOUND[0], replace(whole, delivered=())) is None
    assert drawn(RIPPLE, with_law(RIPPLE)) is not None


def test_where_nothing_was_added_one_model_is_drawn_and_named_once() -> None:
    whole = diagnosis("none")
    lines = [line[0] for sheet in payload(whole, Scales.of(whole))["sheets"] for line in sheet["lines"]]  # type: ignore[index,union-attr,call-overload]
    assert lines == ["tau", "before", "lost", "q"]
    text = text_of(report_of("none"))
    assert "Worst seconds" in text
    assert "Worst before" not in text


def test_the_box_says_which_model_to_use_outside_the_range() -> None:
    assert "Outside this range it is not validated: use the original model there." in text_of(report_of("two"))
