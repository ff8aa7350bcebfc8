"""Numbers, units and sentences of the report, and the summary on a terminal."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from report_example import FOUND, REST, RIVALS, diagnosis
from report_text import text_of
from test_report import KINDS, page

from cosim.delivery.deliver import without_files
from cosim.diagnosis.answer.result import Diagnosis, Sanity
from cosim.plots.quantities import FAMILIES, Scale, minus, number, spelled
from cosim.report import render, tables
from cosim.report.figures_proof import relative
from cosim.report.findings import block
from cosim.report.lead import heading, improvement, lead
from cosim.report.next_experiment import motion
from cosim.report.page import unexplained
from cosim.report.quantities import Scales
from cosim.report.tables import limits
from cosim.report.terminal import summary
from cosim.report.words import blocks, sized
from cosim.support.units import unit


def test_where_nothing_is_missing_no_effect_is_left_out_of_the_first_screen_and_no_gain_is_claimed() -> None:
    whole = diagnosis("none")
    cells = " ".join(row[0] for row in limits(whole, Scales.of(whole)).rows).lower()
    assert all(one.title.lower() in cells for one in whole.findings if one.answer in ("not_seen", "not_testable"))
    assert "so there is no gain to prove" in page("none")
    assert "so there is no gain to prove" not in page("two")


def test_numbers_read_well() -> None:
    assert [number(x) for x in (0.4203, 0.0, -12.34, 1234.0, float("nan"))] == ["0.42", "0", "−12", "1,200", "–"]
    assert minus("-0.01 to 0.11, run-3") == "−0.01 to 0.11, run-3"
    assert relative(FOUND[0]) == pytest.approx((8.4, 7.8, 9.0))


@KINDS
def test_terminal_summary_fits_80_columns(kind: str, motion: str) -> None:

    text = summary(diagnosis(kind, motion))
    assert max(map(len, text.splitlines())) <= 80
    assert "not detected" in text
    assert "\033" not in summary(diagnosis(mount="\033[31mred"))
    assert ("either    gravity unbalance" in text) == (kind == "two")


def test_what_rests_hide_is_said_of_clear_motion_and_never_called_clear() -> None:
    whole = diagnosis("two")
    assert improvement(whole, Scales.of(whole)).startswith("The validation error falls from ")
    hidden = replace(whole, heldout=replace(whole.heldout, confidence_interval=(-0.02, 0.3)))
    said = improvement(hidden, Scales.of(whole))
    assert said.startswith("In clear motion the validation error falls from 0.35 to 0.17")
    assert "over all samples, rests included, it does not clearly fall: from" in said
    worse = replace(hidden, heldout=replace(hidden.heldout, sliding={"before_rms": 0.17, "after_rms": 0.35}))
    assert improvement(worse, Scales.of(whole)).startswith("The validation error does not clearly fall: from")


def test_a_range_ends_where_the_parameter_does() -> None:
    speeds = replace(REST[0], effect="stribeck", answer="found", parameters={"Vs": 0.018}, units={"Vs": "rad/s"})
    wide = replace(speeds, ranges={"Vs": (-0.19, 0.227)})
    assert tables.numbers(wide).rows == (("Vs", "0.01800", "up to 0.227", "rad/s"),)
    signed = replace(wide, effect="gravity", parameters={"phase": 0.1}, ranges={"phase": (-0.1, 0.3)}, units={})
    assert tables.numbers(signed).rows[0][2] == "−0.100 to 0.300"


@pytest.mark.parametrize(
    ("motion", "units"), [("rotary", ["kg·m²", "N·m", "N·m·s/rad"]), ("linear", ["kg", "N", "N·s/m"])]
)
def test_numbers_of_the_base_have_units(motion: str, units: list[str]) -> None:
    base = dict.fromkeys(("axis.inertia", "friction.Fc.positive", "friction.sigma2"), (1.0, 1.0, 1.0))
    assert [row[-1] for row in tables.parameters(replace(diagnosis("two", motion), base_parameters=base)).rows] == units


@pytest.mark.parametrize(
    ("share", "why"),
    [
        ("97.0", "but fits worse where noise is low"),
        ("90.7", "the detail of what is left decides"),
        ("80.0", "this 90.9 %"),
    ],
)
def test_a_rival_that_removes_more_is_said_to_fit_worse(share: str, why: str) -> None:
    close = replace(
        FOUND[0], ruled_out=(), less_likely=(f"Torque offset: removes {share} % of the error energy, this 90.9 %",)
    )
    whole = replace(diagnosis("two"), findings=(close, *REST))
    said = dict(block(blocks(whole)[0], whole, Scales.of(whole), None).rows)["Less likely"]
    assert why in said
    assert ("decides" in said) == (share == "90.7")


def test_where_rests_are_most_of_the_error_that_of_clear_motion_is_told() -> None:
    """A law without memory says nothing about rest: an error of its own level there is no fault of the model."""
    told = {"before_rms": 0.05, "after_rms": 0.05}
    whole = diagnosis("none")
    held = replace(whole.heldout, before_rms=0.46, after_rms=0.46, sliding=told)
    resting = replace(whole, heldout=held)
    assert "0.050 in clear motion" in " ".join(summary(resting).split())
    near = replace(whole, heldout=replace(held, sliding={"before_rms": 0.4, "after_rms": 0.4}))
    assert "in clear motion" not in " ".join(summary(near).split())


def limited(limit: float, trained: float) -> Diagnosis:
    """Something unknown that acts on the held-out run alone, where its torque passes a limit."""
    whole = diagnosis("none")
    *fitted, held = whole.traces
    large = held.tau > limit
    held = replace(held, after=held.after - 3.0 * large)
    fitted = [replace(one, tau=np.minimum(one.tau, trained)) for one in fitted]
    after = float(np.sqrt(np.mean((held.tau - held.after) ** 2)))
    return replace(whole, verdict=("unknown",), traces=(*fitted, held), heldout=replace(whole.heldout, after_rms=after))


def test_a_rest_where_training_never_was_is_said_to_lie_there() -> None:
    top = float(np.quantile(diagnosis("none").traces[-1].tau, 0.97))
    said = limited(top, top)
    page = " ".join(unexplained(said, Scales.of(said)))
    assert re.search(
        r"9\d % of the error energy on validation runs lies at torques outside .* \(3 % of the time\)", page
    )
    assert "which the fit never had (3 % of the time): what acts there" in " ".join(summary(said).split())


def test_a_rest_where_training_was_too_is_said_to_lie_nowhere() -> None:
    top = float(np.quantile(diagnosis("none").traces[-1].tau, 0.97))
    for known in (limited(top, np.inf), limited(-np.inf, top)):
        assert "the fit never had" not in " ".join(unexplained(known, Scales.of(known))) + summary(known)


SIGNS = {"°": "deg", "′": "arcmin", "″": "arcsec", "·": "."}
SHOWN = [(si, scale) for si, family in FAMILIES.items() for scale in family]


@pytest.mark.parametrize(("si", "scale"), SHOWN, ids=[f"{si} as {scale.unit}" for si, scale in SHOWN])
def test_a_scale_is_the_size_of_its_unit(si: str, scale: Scale) -> None:
    name = scale.unit
    for sign, word in SIGNS.items():
        name = name.replace(sign, word)
    assert unit(name).dimension == unit(si).dimension
    assert scale.factor * unit(name).factor == pytest.approx(1.0, rel=1e-12)


def test_the_scales_of_a_unit_begin_with_the_largest_and_each_is_smaller() -> None:
    for family in FAMILIES.values():
        factors = [scale.factor for scale in family]
        assert factors == sorted(factors)
        assert len(set(factors)) == 3


# What a mechanic stumbles over in a report: private words, units full of zeros, orders that help nobody.


def test_how_far_a_rival_is_behind_in_evidence_stands_among_the_numbers() -> None:
    told = "Torque offset: removes 70.7% of the error energy, this 83.0% (126 nats behind)"
    whole = diagnosis("two")
    html = render(replace(whole, findings=(replace(FOUND[0], ruled_out=(told,)), *FOUND[1:], *RIVALS, *REST)))
    assert "<dd>Torque offset: removes 70.7% of the error energy, this 83.0%</dd>" in html
    assert "nats" not in text_of(html)
    assert "Evidence by which rivals are behind: Torque offset, 126 nats." in html


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


def test_a_chirp_of_a_few_micrometres_is_not_told_in_metres() -> None:
    whole = diagnosis("two", "linear")
    said = motion({"kind": "chirp", "amplitude": 1.3e-5, "start": 0.5, "stop": 49}, Scales.of(whole))
    assert said.replace("\N{NO-BREAK SPACE}", " ") == "a sine of 13 µm to each side that rises from 0.5 Hz to 49 Hz"


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


def test_what_did_not_prove_itself_has_no_size_and_nothing_is_to_be_done_about_it() -> None:
    weak = replace(FOUND[0], answer="not_proven", size="663 N·m", size_range="1 to 1,325", action="Check the bearing.")
    whole = replace(diagnosis("two"), findings=(weak, *FOUND[1:], *REST), verdict=("friction_asymmetry",))
    assert "663" not in summary(whole)
    assert "not confirmed" in summary(whole)
    assert "Nothing yet: not confirmed. “cosim why” names the rule." in render(whole)
    assert "Check the bearing" not in render(whole) + summary(whole)
