"""Numbers, units and sentences of the report, and the summary on a terminal."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from report_example import FOUND, REST, diagnosis
from test_report import KINDS, page

from cosim.diagnosis.answer.result import Diagnosis
from cosim.plots.quantities import FAMILIES, Scale, minus, number, raised
from cosim.report import tables
from cosim.report.figures_proof import relative
from cosim.report.findings import block
from cosim.report.lead import improvement
from cosim.report.page import unexplained
from cosim.report.quantities import Scales
from cosim.report.tables import limits
from cosim.report.terminal import summary
from cosim.report.words import blocks
from cosim.support.units import unit


def test_where_nothing_is_missing_no_effect_is_left_out_of_the_first_screen_and_no_gain_is_claimed() -> None:
    whole = diagnosis("none")
    cells = " ".join(row[0] for row in limits(whole, Scales.of(whole)).rows).lower()
    assert all(one.title.lower() in cells for one in whole.findings if one.answer in ("not_seen", "not_testable"))
    assert "so there is no gain to prove" in page("none")
    assert "so there is no gain to prove" not in page("two")


def test_units_are_printed_with_powers() -> None:
    assert raised("N.m.s2/rad2") == "N·m·s²/rad²"


def test_numbers_read_well() -> None:
    assert [number(x) for x in (0.4203, 0.0, -12.34, 1234.0, float("nan"))] == ["0.42", "0", "−12", "1,200", "–"]
    assert minus("-0.01 to 0.11, run-3") == "−0.01 to 0.11, run-3"
    assert relative(FOUND[0]) == pytest.approx((8.4, 7.8, 9.0))


@KINDS
def test_terminal_summary_fits_80_columns(kind: str, motion: str) -> None:

    text = summary(diagnosis(kind, motion))
    assert max(map(len, text.splitlines())) <= 80
    assert "not detected" in text
    assert "\033" not in text
    assert ("either    gravity unbalance" in text) == (kind == "two")


def test_terminal_is_bold_only_where_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    from cosim.report.terminal import print_summary

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    for variable, value, bold in (("TERM", "xterm", True), ("TERM", "dumb", False), ("NO_COLOR", "1", False)):
        monkeypatch.delenv("NO_COLOR", raising=False)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv(variable, value)
        print_summary(diagnosis(), out := Terminal())
        assert ("\033[1m" in out.getvalue()) == bold
    assert "\033" not in summary(diagnosis(mount="\033[31mred"))


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


# Where training never was: what is left there is said to lie there, what is left everywhere is not.


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


# Units of what people read: each shown number is the SI value in the unit that stands behind it.

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
