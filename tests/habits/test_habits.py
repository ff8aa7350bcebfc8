"""Habits: defaults of a folder, help in groups with examples that parse, a folder of machines diagnosed and resumed."""

import json
from pathlib import Path

import pytest
from commands import call
from typer.main import get_command

from cosim.cli import application
from cosim.cli.help import GROUPS, epilog, group_of
from cosim.cli.settings import read_settings
from cosim.cli.verbs import module_of, verbs
from cosim.support.errors import InputError


def test_every_verb_has_a_group_and_two_or_three_examples() -> None:
    assert {verb for verb in verbs() if not 2 <= len(examples(verb)) <= 3} == set()
    assert {group_of(verb, module_of(verb)) for verb in verbs()} == {*GROUPS, "Prove"}


def examples(verb: str) -> list[str]:
    return [line.strip() for line in epilog(verb, module_of(verb)).split("\n\n")[1:]]


@pytest.mark.parametrize("line", [line for verb in verbs() for line in examples(verb)])
def test_every_example_of_the_help_parses(line: str) -> None:
    from cosim.cli import repeated

    words = repeated(line.split()[1:])
    command = get_command(application(words))
    helped = [word for word in words if word == "--help"]
    plain = [word for word in words if word not in helped]
    with command.make_context("cosim", list(plain)) as context:
        verb = command.get_command(context, plain[0])  # type: ignore[attr-defined]
        assert verb is not None
        with verb.make_context(plain[0], plain[1:], parent=context):
            pass


def test_help_lists_groups_in_their_order(capsys: pytest.CaptureFixture[str]) -> None:
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
    monkeypatch.chdir(below)
    found = read_settings(verbs)
    assert found.listed("columns") == ["tau=force"]
    assert found.of_verb("run") == {"card": str(Path("..") / "axis.toml"), "stop": 0.02}
    assert found.paths["out"] == str(Path("..") / "results")


def test_another_tool_s_project_file_says_nothing(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text("[tool.other]\nx = 1\n", "utf-8")
    assert read_settings(verbs, tmp_path).pairs == {}


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


def test_a_run_takes_its_defaults_and_the_command_line_comes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
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
