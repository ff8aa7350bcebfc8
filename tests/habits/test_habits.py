"""Habits: defaults of a folder, help in groups, progress of a diagnosis in stages."""

import json
import re
from itertools import count
from pathlib import Path

import pytest
from commands import call

from cosim.api.progress import Staged, stages_of
from cosim.cli.help import GROUPS, group_of
from cosim.cli.settings import read_settings
from cosim.cli.verbs import module_of, verbs
from cosim.support.errors import InputError


def test_help_lists_groups_in_their_order_and_every_verb_has_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert {group_of(verb, module_of(verb)) for verb in verbs()} == {*GROUPS, "Prove"}
    assert call("--help") == 0
    told = capsys.readouterr().out
    places = [told.index(f"─ {group} ─") for group in (*GROUPS, "Prove")]
    assert places == sorted(places)


SETTINGS = """
out = "results"
card = "axis.toml"
[columns]
tau = "force"
[units]
q = "arcsec"
[run]
stop = 0.02
"""


@pytest.mark.parametrize("name", ["cosim.toml", "pyproject.toml"])
def test_the_nearest_file_of_defaults_is_read(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text = SETTINGS if name == "cosim.toml" else "[tool.cosim]\n" + SETTINGS.replace("\n[", "\n[tool.cosim.")
    (tmp_path / name).write_text(text, "utf-8")
    (tmp_path / "axis.toml").touch()
    (below := tmp_path / "day").mkdir()
    (below / "pyproject.toml").write_text("[tool.other]\nx = 1\n", "utf-8")  # of another tool: it says nothing
    monkeypatch.chdir(below)
    found = read_settings(verbs)
    assert found.listed("columns") == ["tau=force"]
    assert found.of_verb("run") == {"card": str(Path("..") / "axis.toml"), "stop": 0.02}
    assert found.paths["out"] == str(Path("..") / "results")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("columms = 1", '"columms" is no key; keys there are: card, plugins, out, columns'),
        ("columns = 1", "columns = 1 is wrong; it must be a section"),
        ("card = 1", "card = 1 is wrong; it must be text in quotes"),
        ("x = [", "is not valid TOML"),
    ],
)
def test_a_wrong_file_of_defaults_is_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "cosim.toml").write_text(text, "utf-8")
    with pytest.raises(InputError) as refused:
        read_settings(verbs, tmp_path)
    assert sentence in str(refused.value)


def test_a_run_takes_its_defaults_and_the_command_line_comes_first(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COSIM_OUT", "")
    Path("cosim.toml").write_text('out = "results"\n[run]\nstop = 0.02\n', "utf-8")
    assert call("run", "sidereal", "--json") == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 200
    assert Path("results/sidereal-1/run.json").is_file()
    assert call("run", "sidereal", "--stop", "0.01", "--json") == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 100
    Path("cosim.toml").write_text("[run]\nstopp = 1\n", "utf-8")
    assert call("run", "sidereal") == 2
    assert "[run] stopp is no option of it" in capsys.readouterr().err


# Progress of a diagnosis: stages count up to their number, and the time to go comes down.

TOLD = (
    "refitting the base",
    "Delay (1 of 2)",
    "Cogging (2 of 2)",
    "proving on the recording that was not fitted",
    "Delay",
    "building the improved FMU",
    "closing the loop",
    "writing the report",
)


def lines(has_card: bool = True, writes_all: bool = True) -> list[str]:
    """What is said, with 3 s between any two looks at the clock."""
    said: list[str] = []
    staged = Staged(said.append, stages_of(has_card, writes_all), map(float, count(0, 3)).__next__)
    for text in TOLD if writes_all else TOLD[:5]:
        staged(text)
    return said


def test_stages_count_up_and_never_back_and_the_time_to_go_comes_down() -> None:
    said = lines()
    assert re.findall(r"stage (\d) of 6: ", "\n".join(said)) == ["1", "2", "2", "3", "3", "4", "5", "6"]
    assert lines(writes_all=False)[-1].startswith("stage 3 of 3: Delay")
    assert lines(has_card=False)[0].startswith("stage 2 of 7: refitting the base")
    assert "left" not in said[0]  # nothing is known yet
    left = [float(seconds) for seconds in re.findall(r"about (\d+) s left", "\n".join(said[3:]))]
    assert len(left) == 5
    assert left[-1] < left[0]
    assert left[-1] <= 3
