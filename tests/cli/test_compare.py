"""Runs and recordings over each other: aligned in time and sampling, differences by column, a page and a figure."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from browsing import browser, check_by_axe
from commands import call

import cosim
from cosim.support.errors import InputError, OutputError, RecordingError

__all__ = ["browser"]


def waves(t: np.ndarray) -> np.ndarray:
    return np.sin(1.3 * t) + 0.4 * np.sin(3.1 * t + 1)


def table(rate: float, seconds: float = 20.0, start: float = 0.0, moved: float = 0.0, extra: float = 0.0) -> Any:
    """A motion sampled at a rate from a start on; `moved` is what its clock is behind, `extra` a torque on top."""
    t = start + np.arange(round(seconds * rate)) / rate
    return pd.DataFrame({"t": t - moved, "q": waves(t), "tau": 2 * np.cos(t) + extra})


def test_other_rates_and_spans_are_compared_on_the_rows_of_the_first() -> None:
    found = cosim.compare(table(500.0), table(200.0, 15.0, 2.0, extra=0.25))
    assert (found.overlay.t[0], found.overlay.t[-1]) == pytest.approx((2.0, 16.994), abs=0.01)
    by_column = {one.column: one for one in found.differences}
    assert (by_column["tau"].rms, by_column["tau"].largest) == pytest.approx((0.25, 0.25), rel=1e-3)
    assert by_column["q"].rms < 1e-4
    assert not found.notes
    told = found.as_json()
    assert told["span"] == pytest.approx([2.0, 16.994], abs=1e-9)
    assert told["rows"] == 7498


def test_another_clock_is_moved_by_what_the_motion_says_and_it_is_said() -> None:
    late = table(500.0, 12.0, 4.0, moved=-5000.0)
    found = cosim.compare(table(500.0, 30.0), late)
    (note,) = found.notes
    assert "has another clock: it is moved by -5000 s, at which q agrees best" in note
    assert max(one.rms for one in found.differences) < 0.01


def test_gaps_stay_gaps() -> None:
    holed = table(100.0)
    holed = holed[(holed.t < 8) | (holed.t > 12)]
    found = cosim.compare(table(100.0), holed)
    inside = (found.overlay.t > 8.02) & (found.overlay.t < 11.98)
    assert np.isnan(found.overlay.columns["q"][1][inside]).all()
    assert max(one.rms for one in found.differences) < 1e-9


def test_three_recordings_and_columns_that_not_all_have() -> None:
    first, second, third = (cosim.read(table(100.0, extra=k), name=f"run {k}") for k in range(3))
    more = cosim.read(table(100.0).assign(temperature=20.0), name="warm")
    found = cosim.compare(first, second, third, more)
    assert {(one.column, one.other): round(one.rms, 9) for one in found.differences}["tau", "run 2"] == 2
    assert found.notes == ("Not in all of them, and left out: temperature.",)
    assert len(found.plot().axes) == 2 * 2
    assert len(found.frame()) == 2 * 3


def test_the_command_writes_a_page_that_needs_no_network_a_figure_and_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, extra in (("a", 0.0), ("b", 0.5)):
        table(100.0, extra=extra).to_csv(tmp_path / f"{name}.csv", index=False)
    out = tmp_path / "out"
    assert call("compare", tmp_path / "a.csv", tmp_path / "b.csv", "--out", out, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((out / "compare.json").read_text())
    assert [one["rms"] for one in told["differences"] if one["column"] == "tau"] == [pytest.approx(0.5)]
    page = (out / "compare.html").read_text()
    assert "http" not in page.replace("http-equiv", "")
    assert (out / "compare.svg").read_text().count("<svg") == 1
    with pytest.raises(OutputError):
        cosim.compare(tmp_path / "a.csv", tmp_path / "b.csv", out=out)


def test_what_cannot_be_compared_is_one_sentence() -> None:
    with pytest.raises(InputError, match="A comparison needs two recordings or more"):
        cosim.compare(table(100.0))
    with pytest.raises(RecordingError, match="no column in common"):
        cosim.compare(table(100.0), pd.DataFrame({"t": np.arange(200) / 10, "x": np.arange(200.0)}))


def test_axe_finds_nothing_in_the_page_of_a_comparison(browser: Any, tmp_path: Path) -> None:
    cosim.compare(table(500.0), table(200.0, 15.0, 2.0, extra=0.25), out=tmp_path / "out")
    check_by_axe(browser, (tmp_path / "out" / "compare.html").read_text("utf-8"), tmp_path)
