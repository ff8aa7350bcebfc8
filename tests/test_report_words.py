"""Numbers, units and sentences of the report, and the summary on a terminal."""

import io

import pytest
from report_example import FOUND, diagnosis
from test_report import KINDS, page

from cosim.diagnosis.report.figures_proof import relative
from cosim.diagnosis.report.quantities import Scales
from cosim.diagnosis.report.tables import limits
from cosim.diagnosis.terminal import summary
from cosim.plots.quantities import minus, number, raised


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
    assert "not seen" in text
    assert "\033" not in text
    assert ("EITHER    gravity unbalance" in text) == (kind == "two")


def test_terminal_is_bold_only_where_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    from cosim.diagnosis.terminal import print_summary

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
