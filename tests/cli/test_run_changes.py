"""A run with other numbers, results without a folder that was given, an answer that begins with the axis."""

import json
from pathlib import Path

import numpy as np
import pytest
from commands import call

import cosim


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_numbers_are_changed_for_one_run_and_the_recording_says_so(scenario: Path, tmp_path: Path) -> None:
    text = scenario.read_text().replace("k = 5.0", "k = 7.0").replace("frequency = 2.0", "frequency = 3.0")
    (other := tmp_path / "other.toml").write_text(text)
    asked = cosim.run(scenario, set={"controller.k": 7.0, "r.frequency": 3.0}).recording
    for name, values in cosim.run(other).recording.table.items():
        assert np.array_equal(values, asked[name]), name


def test_the_command_takes_several_numbers_and_a_stop(scenario: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("run", scenario, "--set", "controller.k=7", "n.seed=9", "--stop", "0.25", "--out", "out", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["steps"] == 250
    assert json.loads(Path("out/run.json").read_text()) == told


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--set", "controller.kk=7"], '"controller.kk" is nothing that can be set; of controller can be set: '),
        (["--set", "rest.k=7"], "there are: plant, controller, r, n."),
        (["--set", "controller.k"], '--set "controller.k": write component.parameter=value.'),
        (["--set", "controller.k=soft"], "--set controller.k=soft: it must be a number, true or false."),
        (["--set", "controller.k=1", "--set", "controller.k=2"], "--set controller.k is given twice"),
        (["--stop", "0.2505"], "stop = 0.2505 is not a whole number of steps of 0.001 s."),
        (["--stop", "-1"], "stop = -1 must be above 0 s."),
    ],
)
def test_what_cannot_be_set_is_one_sentence(
    scenario: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], sentence: str
) -> None:
    assert call("run", scenario, *arguments, "--out", "out") == 2
    assert sentence in capsys.readouterr().err
    assert not Path("out").exists()


def test_results_without_a_folder_get_one_of_their_own_which_is_said(
    scenario: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number in (1, 2):
        assert call("run", scenario, "--no-page") == 0
        said = capsys.readouterr()
        assert f"results go to cosim_out/loop-{number}\n" in said.err
        assert said.out == f"cosim_out/loop-{number}/recording.parquet\n"


@pytest.mark.parametrize(
    "arguments",
    [
        "run loop.toml --set controller.kk=7",
        "run bad.toml",
        "identify run.csv --system bad.toml --free plant.k",
        "identify run.csv --system loop.toml --free plant.wibble",
        "diagnose run.csv run.csv --card bad.toml",
        "export bad.toml",
        "sweep bad.toml",
        "compare run.csv run.csv",
        "card run.csv",
        "card short.csv",
    ],
)
@pytest.mark.usefixtures("scenario")
def test_where_results_go_is_not_said_of_what_is_refused(arguments: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("bad.toml").write_text("[mount]\n")
    Path("run.csv").write_text("t,q\n0,1\n")
    Path("short.csv").write_text("t,q,tau\n" + "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(20)))
    assert call(*arguments.split()) == 2
    assert "results go to" not in capsys.readouterr().err


def test_the_answer_begins_with_how_well_the_axis_followed(scenario: Path, tmp_path: Path) -> None:
    done = cosim.run(scenario, tmp_path / "out", page=False)
    (axis,) = done.statistics["tracking"]
    error = done.recording["q_d"] - done.recording["q"]
    assert axis["rms"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    assert axis["largest"] == np.abs(error).max()
    assert str(done).startswith(f"loop: RMS tracking error {axis['statement'].split()[3]} ")


def test_a_sweep_is_called_from_python_and_tells_its_best_run(scenario: Path, tmp_path: Path) -> None:
    cosim.run(scenario)  # it loads what sweeps are made of, and `cosim.sweep` is a function still
    (tmp_path / "many.toml").write_text(
        'scenario = "loop.toml"\n[vary]\n"controller.k" = [1.0, 5.0, 3.0]\n'
        '[statistics]\nerror = { signal = "r.position", minus = "plant.y", kind = "rms" }\n'
    )
    found = cosim.sweep(tmp_path / "many.toml", tmp_path / "many", workers=1)
    table = found.frame()
    best = table.loc[table["error"].idxmin()]  # type: ignore[attr-defined]
    assert found.best == {"run": best["run"], "controller.k": best["controller.k"], "error": best["error"]}
    assert str(found).startswith(f"best by error: run {best['run']} with ")
    assert len(found.plot().axes) == 1
    assert repr(found).startswith("SweepResult(3 runs, table=")
