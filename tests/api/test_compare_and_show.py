"""Runs and recordings over each other; and `cosim show` reads what the project wrote, and says no path of a cache."""

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from browsing import check_by_axe
from commands import call
from report_example import diagnosis

import cosim
from cosim.delivery.deliver import as_json
from cosim.support.errors import InputError, OutputError, RecordingError
from cosim.support.extras import install
from cosim.system.diagram import origin
from cosim.system.sections import ComponentSection


def table(rate: float, seconds: float = 20.0, start: float = 0.0, moved: float = 0.0, extra: float = 0.0) -> Any:
    """A motion sampled at a rate from a start on; `moved` is what its clock is behind, `extra` a torque on top."""
    t = start + np.arange(round(seconds * rate)) / rate
    q = np.sin(1.3 * t) + 0.4 * np.sin(3.1 * t + 1)
    return pd.DataFrame({"t": t - moved, "q": q, "tau": 2 * np.cos(t) + extra})


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


def test_the_command_writes_a_page_that_needs_no_network_a_figure_and_numbers_which_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, other, out = tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "out"
    table(100.0).to_csv(one, index=False)
    table(100.0, extra=0.5).to_csv(other, index=False)
    assert call("compare", one, other, "--out", out, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((out / "compare.json").read_text())
    rms = {"tau": pytest.approx(0.5), "q": 0.0}
    assert {row["column"]: row["rms"] for row in told["differences"]} == rms
    page = (out / "compare.html").read_text()
    assert "http" not in page.replace("http-equiv", "")
    assert (out / "compare.svg").read_text().count("<svg") == 1
    with pytest.raises(OutputError):
        cosim.compare(one, other, out=out)
    for path in (out, out / "compare.json"):
        shown = cosim.show(path)
        assert shown.facts["open"] == str(out / "compare.html")
        (rows,) = shown.tables.values()
        assert {row["column"]: row["rms"] for row in rows} == rms


def test_what_cannot_be_compared_is_one_sentence() -> None:
    with pytest.raises(InputError, match="A comparison needs two recordings or more"):
        cosim.compare(table(100.0))
    with pytest.raises(RecordingError, match="no column in common"):
        cosim.compare(table(100.0), pd.DataFrame({"t": np.arange(200) / 10, "x": np.arange(200.0)}))


def test_axe_finds_nothing_in_the_page_of_a_comparison(browser: Any, tmp_path: Path) -> None:
    cosim.compare(table(500.0), table(200.0, 15.0, 2.0, extra=0.25), out=tmp_path / "out")
    check_by_axe(browser, (tmp_path / "out" / "compare.html").read_text("utf-8"), tmp_path)


SCENARIO = (files("cosim") / "scenarios" / "sidereal.toml").read_text("utf-8").replace("stop = 15.0", "stop = 0.1")
SWEEP = """
scenario = "short.toml"
[vary]
"controller.kp" = [100.0, 225.0]
[statistics]
error = { signal = "q_d", minus = "q", kind = "rms", unit = "arcsec" }
"""


@pytest.mark.parametrize("name", ["", "diagnosis.json"])
def test_a_diagnosis_is_shown_from_its_folder_and_its_file(tmp_path: Path, name: str) -> None:
    (tmp_path / "diagnosis.json").write_text(json.dumps(as_json(diagnosis("two")), default=str), "utf-8")
    (tmp_path / "report.html").write_text("", "utf-8")
    shown = cosim.show(tmp_path / name)
    assert "cogging" in shown.facts["missing"]
    assert shown.facts["open"] == str(tmp_path / "report.html")
    rows = {row["effect"]: row["answer"] for row in shown.tables["effects"]}
    assert rows["cogging"] == "detected"
    assert "not_seen" not in rows.values()


@pytest.mark.parametrize("text", ["[1]", "{}", "{", "[" * 100_000, '{"verdict": 5, "effects": 3, "heldout": []}'])
def test_a_broken_diagnosis_is_one_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "diagnosis.json").write_text(text, "utf-8")
    with pytest.raises(cosim.InputError) as refused:
        cosim.show(tmp_path)
    assert "diagnosis.json" in str(refused.value)


def test_a_run_is_shown_from_its_folder_and_a_folder_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(cosim.InputError, match="a folder of a run, diagnosis, sweep"):
        cosim.show(tmp_path)
    cosim.run("sidereal", tmp_path / "run", stop=0.05, page=False)
    shown = cosim.show(tmp_path / "run")
    assert shown.facts["scenario"] == "sidereal"
    assert shown.facts["recording"] == str(tmp_path / "run" / "recording.parquet")
    assert "RMS tracking error" in str(shown.facts["tracking"])


def test_an_fmu_is_told_by_its_place_in_the_archive_and_advice_names_packages_that_can_be_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.system.diagram.cache_home", lambda: tmp_path)
    inside = tmp_path / "ssp" / "0123456789abcdef" / "resources" / "theirs.fmu"
    assert origin(ComponentSection(fmu=inside)) == "resources/theirs.fmu"
    assert origin(ComponentSection(fmu=Path("/elsewhere/mine.fmu"))) == "/elsewhere/mine.fmu"
    assert "mount-cosim" not in install("serve")
    assert '"starlette>=' in install("serve")


@pytest.mark.parametrize("name", ["out", "out/table.parquet", "two.toml"])
def test_a_sweep_is_shown_from_its_folder_its_table_and_its_file(sweep: Path, name: str, monkeypatch: Any) -> None:
    monkeypatch.chdir(sweep)
    shown = cosim.show(name)
    if name == "two.toml":
        assert shown.facts["runs"] == 2
        return
    assert str(shown.facts["best"]).startswith("run = 1, controller.kp = 225")
    (rows,) = shown.tables.values()
    assert [row["run"] for row in rows] == [1, 0]
    assert shown.facts["picture"] == str(Path("out") / "sweep.svg")


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "short.toml").write_text(SCENARIO, "utf-8")
    (folder / "two.toml").write_text(SWEEP, "utf-8")
    cosim.sweep(folder / "two.toml", folder / "out", workers=1)
    return folder


def test_a_blind_benchmark_is_shown_and_another_file_of_the_name_of_a_comparison_is_not(tmp_path: Path) -> None:
    foreign = tmp_path / "compare.json"
    foreign.write_text(json.dumps([{"t": k, "tau": 1.0, "q": 2.0 * k} for k in range(200)]), "utf-8")
    assert cosim.show(foreign).facts["recording"] == str(foreign)
    foreign.unlink()
    score = {"title": "false alarms", "value": 0.0, "low": 0.0, "high": 0.65761, "n": 2, "asked": "<= 0.02"}
    told = {"played": 2, "cases": 2, "seed": 1, "command": "cosim prove --cases 2", "scores": [score]}
    (tmp_path / "proof.json").write_text(json.dumps(told), "utf-8")
    shown = cosim.show(tmp_path)
    assert shown.facts["cases"] == "2 of 2, seed 1"
    (row,) = shown.tables["scores, with 95 % ranges"]
    assert row == {"score": "false alarms", "value": 0.0, "from": 0.0, "to": 0.6576, "cases": 2, "target": "<= 0.02"}
