"""The report and the terminal on what has no name: learned as a table, or tried and left out."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from report_example import diagnosis

from cosim.diagnosis.answer.result import Diagnosis
from cosim.report import render
from cosim.report.learned import nameless
from cosim.report.quantities import Scales
from cosim.report.terminal import summary

AT, BY = np.linspace(-1, 1, 24), [18.0, 22.0, 26.0]
DATA = {"at": AT.tolist(), "value": [None, *(0.3 * AT[1:] ** 2)], "band": [0.02] * 24}
CURVE = {
    "kind": "torque", "unit": "N.m", "over": "position", "data": DATA,
    "at": [-1.0, 0.0, 1.0], "value": [0.3, 0.0, 0.3],
}  # fmt: skip
MAP = {
    "kind": "friction", "unit": "1", "over": "position", "by": "temperature", "at": [-1.0, 0.0, 1.0], "by_at": BY,
    "value": [[0.3, 0.1, 0.0], [0.0, -0.2, 0.0], [0.3, 0.0, 0.1]],
    "data": {"at": [-0.5, 0.5], "by_at": [20.0, 24.0], "value": [[0.1, None], [0.1, 0.0]], "band": [[0.1] * 2] * 2},
}  # fmt: skip
DRIVE = {
    "kind": "drive", "unit": "N.m", "command": [-5.0, 0.0, 5.0], "missing": [-0.2, 0.0, 0.2],
    "data": {"at": AT.tolist(), "value": AT.tolist(), "band": [0.1] * 24},
}  # fmt: skip
MEMORY = {"kind": "hysteresis", "unit": "N.m", "strokes": [0.1], "torque": [0.4], "data": DATA}
TOLD: dict[str, Any] = {
    "quantities": ["position and temperature", "torque"], "size": 0.31, "table": [CURVE, MAP, DRIVE, MEMORY],
    "before": 0.42, "after": 0.15, "interval": [0.21, 0.33], "cutoff_hz": 10.0,
    "formula": [{
        "table": 0, "kind": "torque", "over": ["position"], "equation": "torque = k1 q³",
        "parameters": {"k1": {"value": 0.31, "interval": [0.29, 0.33], "unit": "N.m/rad3"}},
    }],
    "range": ["over position -1 to 1 rad", "over temperature 18 to 26 degC"],
    "statement": "Something that depends on position and temperature, and on torque, 0.31 N·m; modelled as a table.",
}  # fmt: skip


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
    assert 'class="nameless"' not in render(diagnosis(kind))


def test_a_table_that_does_not_help_is_said_to_be_left_out() -> None:
    said = "A table over position was tried for what has no name and is not in the model."
    told = replace(diagnosis("unknown"), not_learned={"quantities": ["position"], "statement": said})
    assert said in section(render(told))
    assert said in " ".join(summary(told).split())
