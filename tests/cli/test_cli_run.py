"""The command line: data on stdout, messages on stderr, one sentence for a mistake, nothing overwritten unasked."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Refused, cache, call, python

import cosim.cli.run
from cosim.cli import main
from cosim.data.recording import Recording
from cosim.support.errors import ScenarioError

__all__ = ["cache"]


def test_run_writes_a_recording_and_prints_its_path_or_as_json_what_it_also_writes(scenario: Path, capsys: Any) -> None:
    assert call("run", scenario, "--out", "out") == 0
    said = capsys.readouterr()
    assert said.out == "out/recording.parquet\n"
    assert "loop: 500 steps of 0.001 s\nRMS tracking error " in said.err
    assert "\n500 steps in " in said.err
    assert "not connected, at their start values: plant.b" in said.err
    assert len(Recording.read("out/recording.parquet")) == 250
    assert call("run", scenario, "--out", "out", "--force", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads(Path("out/run.json").read_text())
    assert (told["steps"], told["recording"]) == (500, "out/recording.parquet")
    np.testing.assert_allclose(told["ratio_to_real_time"], 0.5 / told["seconds"])


def test_nothing_is_overwritten_without_force(scenario: Path, refused: Refused, capsys: Any) -> None:
    assert call("run", scenario, "--out", "out") == 0
    said = "cosim: out/recording.parquet exists already; give --force to overwrite it.\n"
    assert refused("run", scenario, "--out", "out") == said
    assert call("run", scenario, "--out", "out", "--force", "--interpreted") == 0
    assert "It was asked for: the loop ran in Python." in capsys.readouterr().err


CARD = 'stop = 1.0\n[components.plant]\ncard = "none"\npart = "plant"\n[record]\nsignals = ["plant.q"]\n'


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("none.toml", "none.toml: no such scenario; a scenario is a .toml or .ssp file or one of: "),
        ("card.toml", 'card.toml: components.plant.card = "none": no such card; a card is a .toml file or one of: '),
    ],
)
def test_a_mistake_is_one_sentence_and_exit_code_2(refused: Refused, name: str, sentence: str) -> None:
    Path("card.toml").write_text(CARD)
    said = refused("run", name, "--out", "out")
    assert said.startswith(f"cosim: {sentence}")
    assert said.count("\n") == 1
    assert not Path("out").exists()
    with pytest.raises(ScenarioError):
        main(["run", name, "--out", "out", "--debug"])


def test_a_failing_component_leaves_what_was_recorded(scenario: Path, refused: Refused) -> None:
    scenario.write_text(scenario.read_text().replace("k = 5.0", "k = 5.0, fail_at = 0.3"))
    note, sentence = refused("run", scenario, "--out", "out").splitlines()[-2:]
    assert note == "what was recorded until then is in out/recording.parquet"
    assert sentence.startswith('cosim: controller returned an error at tick 300 (0.3 s); it said "the shaft broke"; ')
    assert len(Recording.read("out/recording.parquet")) == 151


def test_an_fmu_that_prints_does_not_spoil_the_data(scenario: Path, tmp_path: Path) -> None:
    scenario.write_text(scenario.read_text().replace("k = 5.0", "k = 5.0, fail_at = 0.3, status = 13"))
    done = python("-m", "cosim", "run", str(scenario), "--out", "out", "--json", folder=tmp_path)
    assert json.loads(done.stdout)["steps"] == 500
    assert done.stderr.count("chatter") == 200


def test_a_long_run_says_how_long_and_an_absurd_one_ends(scenario: Path, refused: Refused, monkeypatch: Any) -> None:
    told: list[str] = []
    with monkeypatch.context() as clock:
        clock.setattr(cosim.cli.run, "perf_counter", iter([45.0, 45.01, 2.0, 4.0]).__next__)
        loaded_late = cosim.cli.run.with_forecast(lambda done, of: None, 8000, told.append)
        loaded_late(100, 500)
        loaded_late(200, 500)
        progress = cosim.cli.run.with_forecast(lambda done, of: None, 2_000_000_000, told.append)
        progress(1000, 7_201_000)
        progress(2000, 7_201_000)
    assert told == ["about 4 h to go; the recording grows to 2 GB"]
    scenario.write_text(scenario.read_text().replace("stop = 0.5", "stop = 1e12"))
    assert "PB are needed and " in refused("run", scenario, "--out", "out")
    assert not Path("out").exists()


def test_the_reference_of_the_paper_runs_from_its_card_and_builds_its_fmus_once(cache: Path, capsys: Any) -> None:
    for name, built in (("a", True), ("b", False)):
        assert call("run", "sidereal", "--out", name) == 0
        assert ("building the FMU of the plant of paper_mount" in capsys.readouterr().err) == built
    assert len(list(cache.iterdir())) == 2
    one, other = (Recording.read(f"{name}/recording.parquet") for name in "ab")
    error = (one["q_d"] - one["position"])[25_000:] * 648000 / np.pi
    assert np.abs(error).max() < 0.1  # arcsec; matched compensation: the paper's C2a without its disturbances
    for name in one:
        np.testing.assert_array_equal(one[name], other[name])


def test_export_writes_plant_and_controller_for_both_versions(refused: Refused, capsys: Any) -> None:
    assert call("export", "paper_mount", "--out", "out", "--json") == 0
    parts = [f"paper_mount_{part}_fmi{version}.fmu" for part in ("plant", "controller") for version in (2, 3)]
    assert json.loads(capsys.readouterr().out) == {"fmus": [f"out/{part}" for part in parts]}
    said = refused("export", "paper_mount", "--out", "out", "--fmi", "3")
    assert "exists already; give --force to overwrite it." in said
    refused("export", "none", "--out", "out")


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("sidereal", ["scenario: sidereal", "15 s (150,000 steps)", "rows: every step", "→ mount: 2 ticks, 0.2 ms"]),
        ("sidereal", ["─ tau ───────────▶ mount.tau       1 tick, 0.1 ms"]),
        ("paper_mount", ["card: paper_mount", "friction.sigma0", "kg.m2", "controller: C2a"]),
        ("loop.toml", ["scenario: loop", "x 2; quantum 1e-06; + n", "r.position"]),
        ("tiny3.fmu", ["FMI: 3.0", "model: tiny", "output     Float64  rad"]),
        ("run.csv", ["rows: 200", "rate: 1000 Hz", "least", "gaps: 0"]),
    ],
)
@pytest.mark.usefixtures("scenario")
def test_show_tells_what_a_file_is(tiny: dict[int, Path], capsys: Any, what: str, words: list[str]) -> None:
    file = {"tiny3.fmu": tiny[3]}.get(what, what)
    Recording("run", {"t": np.arange(200) * 1e-3, "q": np.arange(200.0)}).write("run.csv")
    assert call("show", file) == 0
    shown = capsys.readouterr().out
    assert [word for word in words if word not in shown] == []
    assert call("show", file, "--json") == 0
    json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("none", None, "does not exist; shipped are: sidereal, two_axis, altaz_altitude,"),
        ("none.csv", None, "none.csv does not exist."),
        ("odd.toml", "a = ", "is not valid TOML"),
        ("odd", "x", "is unsupported: cosim show takes a recording, FMU, SSP, scenario, card, sweep, or a folder of"),
        ("odd.xyz", "x", "is of no known kind, .xyz; known are: .csv, "),
    ],
)
def test_show_says_what_it_cannot_show(refused: Refused, name: str, text: str | None, sentence: str) -> None:
    if text is not None:
        Path(name).write_text(text)
    assert sentence in refused("show", name)


def test_wrong_use_is_exit_code_2_and_help_lists_the_verbs(refused: Refused, capsys: Any) -> None:
    refused("dance")
    refused("run")
    assert call("--help") == 0
    shown = capsys.readouterr().out
    assert all(word in shown for word in ("export", "run", "show", "--install-completion"))
    for option in ("--version", "-V"):
        assert call(option) == 0
        assert capsys.readouterr().out == f"mount-cosim {cosim.__version__}\n"
