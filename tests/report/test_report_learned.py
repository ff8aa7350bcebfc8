"""The report and the terminal on what has no name: learned as a table, or tried and left out."""

import re
from dataclasses import replace
from typing import Any

import pytest
from learned_told import TOLD
from report_example import diagnosis, report_of

from cosim.diagnosis.answer.result import Diagnosis
from cosim.report import render
from cosim.report.learned import nameless
from cosim.report.quantities import Scales
from cosim.report.terminal import summary


def learned() -> Diagnosis:
    improved: Any = {"card": "card.toml", "fmu": "m_improved.fmu", "speed": [0.3, 1.5], "position": [-1.0, 1.0]}
    return replace(diagnosis("unknown"), learned=TOLD, improved=improved)


def section(html: str) -> str:
    found = re.search(r'<section class="nameless".*?</section>', html, re.DOTALL)
    assert found
    return found[0]


def test_what_was_learned_is_said_with_size_error_range_and_band() -> None:
    said = re.sub(r"<[^>]*>", " ", section(render(learned()))).replace("\N{NO-BREAK SPACE}", " ")
    for part in ("position and temperature", "0.31 N·m", "0.42 → 0.15 N·m", "0.21 to 0.33 N·m", "below 10 Hz"):
        assert part in said
    assert "temperature 18 to 26 °C" in said
    assert "torque = k1 q³; k1 0.310 N·m/rad³ (0.290 to 0.330)" in said


def test_each_table_has_a_figure_with_the_data_beside() -> None:
    found = nameless(learned(), Scales.of(learned()))
    assert found is not None
    assert [one.heading for one in found.pictures] == [
        "Torque over position", "Friction over position and temperature", "Drive over command", "Hysteresis",
    ]  # fmt: skip
    assert all("training recordings" in one.caption for one in found.pictures)


def test_a_model_with_a_table_is_not_called_unchanged() -> None:
    html, text = render(learned()), " ".join(summary(learned()).split())
    assert "No improved model was written" not in html
    assert "there is no gain to prove" not in html
    assert "with what was learned" in html
    assert TOLD["statement"] in text
    assert "As good, and shorter: torque = k1 q³; k1 0.31 N.m/rad3" in text
    assert "→ 0.39 (with what was learned)" in text


@pytest.mark.parametrize("kind", ["two", "none", "unknown"])
def test_where_nothing_was_asked_nothing_is_said(kind: str) -> None:
    assert 'class="nameless"' not in report_of(kind)


def test_a_table_that_does_not_help_is_said_to_be_left_out() -> None:
    said = "A table over position was tried for what has no name and is not in the model."
    told = replace(diagnosis("unknown"), not_learned={"quantities": ["position"], "statement": said})
    assert said in section(render(told))
    assert said in " ".join(summary(told).split())
