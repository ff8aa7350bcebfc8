"""What a mechanic stumbles over in a report: private words, units full of zeros, orders that help nobody."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from report_example import FOUND, REST, RIVALS, diagnosis
from report_text import text_of
from test_report_truth import drawn

from cosim.delivery.deliver import without_files
from cosim.diagnosis.answer.result import Sanity
from cosim.plots.quantities import spelled
from cosim.report import render, words
from cosim.report.lead import heading, lead
from cosim.report.next_experiment import motion
from cosim.report.quantities import Scales
from cosim.report.tables import limits
from cosim.report.terminal import summary
from cosim.report.words import sized


def test_how_far_a_rival_is_behind_in_evidence_stands_among_the_numbers() -> None:
    told = "Torque offset: removes 70.7% of the error energy, this 83.0% (126 nats behind)"
    whole = diagnosis("two")
    html = render(replace(whole, findings=(replace(FOUND[0], ruled_out=(told,)), *FOUND[1:], *RIVALS, *REST)))
    assert "<dd>Torque offset: removes 70.7% of the error energy, this 83.0%</dd>" in html
    assert "nats" not in text_of(html)
    assert "Evidence by which rivals are behind: Torque offset, 126 nats." in html


def test_of_rivals_that_remove_as_much_it_is_said_what_decides() -> None:
    told = "Gravity unbalance: removes 96.9 % of the error energy, this 96.9 % (10 nats behind)"
    whole = diagnosis("two")
    html = render(replace(whole, findings=(replace(FOUND[0], less_likely=(told,)), *FOUND[1:], *RIVALS, *REST)))
    assert "removes 96.9 % of the error energy, this 96.9 %: the detail of what is left decides</dd>" in html


def test_nothing_is_to_be_done_about_what_did_not_prove_itself() -> None:
    weak = replace(FOUND[0], answer="not_proven", action="Check the bearing.")
    whole = replace(diagnosis("two"), findings=(weak, *FOUND[1:], *REST), verdict=("friction_asymmetry",))
    assert "Nothing yet: not confirmed. “cosim why” names the rule." in render(whole)
    assert "Check the bearing" not in render(whole) + summary(whole)


def test_each_limit_stands_beside_the_effect_that_it_is_of() -> None:
    seen = [
        replace(REST[0], effect=f"e{k}", title=f"E{k}", visible_from=0.5 + k, evidence="at 2 cycles") for k in (0, 1)
    ]
    whole = replace(diagnosis("none"), findings=tuple(seen))
    rows = limits(whole, Scales.of(whole)).rows
    assert [(row[0], row[2].replace("\N{NO-BREAK SPACE}", " ")) for row in rows] == [
        ("E0", "0.5 ms at 2 cycles"),
        ("E1", "1.5 ms at 2 cycles"),
    ]
    play = replace(REST[0], visible_from=None, evidence="wider than 0.00013 rad")
    assert limits(replace(whole, findings=(play,)), Scales.of(whole)).rows[0][2] == "wider than 0.45′"


def test_effects_that_were_not_detected_are_one_line_on_the_terminal() -> None:
    untold = [replace(REST[0], effect=f"e{k}", title=f"E{k}", answer="not_testable") for k in range(3)]
    said = " ".join(summary(replace(diagnosis("none"), findings=(*untold, REST[0]))).split())
    assert "1 other effect: not detected, limits in the report; 3 not testable here" in said


def test_a_chirp_of_a_few_micrometres_is_not_told_in_metres() -> None:
    whole = diagnosis("two", "linear")
    said = motion({"kind": "chirp", "amplitude": 1.3e-5, "start": 0.5, "stop": 49}, Scales.of(whole))
    assert said.replace("\N{NO-BREAK SPACE}", " ") == "a sine of 13 µm to each side that rises from 0.5 Hz to 49 Hz"


def test_names_of_people_keep_their_capitals_inside_a_sentence() -> None:
    assert [words.lowered(title) for title in ("Stribeck friction", "Delay")] == ["Stribeck friction", "delay"]
    assert words.started("motor torque") == "Motor torque"


def test_measured_points_are_black_and_the_improved_model_is_blue() -> None:
    svg = drawn(FOUND[1], diagnosis("two")).svg
    marks = re.findall(r"<use [^>]*style=\"([^\"]*)", svg)
    assert marks
    assert not any("var(--after)" in one for one in marks)


def test_an_answer_that_was_not_written_names_no_file() -> None:
    whole = without_files(diagnosis("two"))
    assert "Wrote" not in summary(replace(whole, improved={}))
    assert "scenario" not in whole.next_experiment


@pytest.mark.parametrize("kind", ["two", "none", "unknown"])
def test_the_lead_has_at_most_two_sentences_and_a_heading_one(kind: str) -> None:
    whole = diagnosis(kind)
    said = " ".join(lead(whole, Scales.of(whole)))
    assert len(re.findall(r"[.!?](?= [A-Z]|$)", said)) <= 2
    assert len(re.findall(r"[.!?](?= [A-Z])", heading(whole))) == 0


def test_numbers_with_an_exponent_are_written_out() -> None:
    assert (
        spelled("2.32e+06 N/m, 1.8e+03 to -4.1e-04, 1e+09, 3e-05x") == "2,320,000 N/m, 1,800 to −0.00041, 1e+09, 3e-05x"
    )
    stiff = replace(FOUND[0], size="2.32e+06 N/m", size_range="2091449 to 2546496")
    assert sized(stiff) == ("2,320,000 N/m", "2,091,449 to 2,546,496")


def test_many_remarks_are_folded_on_the_terminal_and_alarms_are_not(tmp_path: Path) -> None:
    remarks = tuple(Sanity(finding="encoder_step", statement=f"Remark {k}.") for k in range(7))
    whole = replace(diagnosis("two"), sanity=remarks)
    assert summary(whole).count("Remark") == 7  # without a folder there is no report to read
    told = summary(whole, out=tmp_path)
    assert told.count("Remark") == 3
    assert "4 more remarks in report.html" in told


def test_what_did_not_prove_itself_has_no_size() -> None:
    weak = replace(FOUND[0], answer="not_proven", size="663 N·m", size_range="1 to 1,325")
    whole = replace(diagnosis("two"), findings=(weak, *FOUND[1:], *REST), verdict=("friction_asymmetry",))
    assert "663" not in summary(whole)
    assert "not confirmed" in summary(whole)
