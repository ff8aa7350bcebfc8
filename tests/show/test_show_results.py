"""`cosim show` reads what the project wrote: runs, diagnoses, sweeps, and says no path of a cache."""

import json
from importlib.resources import files
from pathlib import Path

import pytest
from report_example import diagnosis

import cosim
from cosim.delivery.deliver import as_json
from cosim.support.extras import install
from cosim.system.diagram import origin
from cosim.system.sections import ComponentSection

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
def test_a_sweep_is_shown_from_its_folder_its_table_and_its_file(
    sweep: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_a_comparison_and_a_blind_benchmark_are_shown_and_another_file_of_its_name_is_not(
    tmp_path: Path,
) -> None:
    t = [0.01 * k for k in range(200)]
    one, other = ({"t": t, "a": [k + shift for k in t], "b": t} for shift in (0.0, 0.25))
    cosim.compare(one, other, out=tmp_path / "over")
    for path in (tmp_path / "over", tmp_path / "over" / "compare.json"):
        shown = cosim.show(path)
        assert shown.facts["open"] == str(tmp_path / "over" / "compare.html")
        (table,) = shown.tables.values()
        assert [(row["column"], row["rms"]) for row in table] == [("a", 0.25), ("b", 0.0)]
    foreign = tmp_path / "compare.json"
    foreign.write_text(json.dumps([{"t": k, "tau": 1.0, "q": 2.0 * k} for k in t]), "utf-8")
    assert cosim.show(foreign).facts["recording"] == str(foreign)
    foreign.unlink()
    score = {"title": "false alarms", "value": 0.0, "low": 0.0, "high": 0.65761, "n": 2, "asked": "<= 0.02"}
    told = {"played": 2, "cases": 2, "seed": 1, "command": "cosim prove --cases 2", "scores": [score]}
    (tmp_path / "proof.json").write_text(json.dumps(told), "utf-8")
    shown = cosim.show(tmp_path)
    assert shown.facts["cases"] == "2 of 2, seed 1"
    (row,) = shown.tables["scores, with 95 % ranges"]
    assert row == {"score": "false alarms", "value": 0.0, "from": 0.0, "to": 0.6576, "cases": 2, "target": "<= 0.02"}
