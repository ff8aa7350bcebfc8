"""Every code block of README, docs and help: Python runs, TOML is read, commands parse; what guides show happens."""

import re
import shlex
import textwrap
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from commands import call
from typer.main import get_command

import cosim
from cosim.cli import application, plugged, repeated
from cosim.cli.help import epilog
from cosim.cli.verbs import module_of, verbs
from cosim.master.simulate import run
from cosim.models.cache import with_fmus
from cosim.system.diagram import draw
from cosim.system.scenario import read_scenario
from cosim_serve import example
from cosim_sweeps.conduct import conduct
from cosim_sweeps.file import read_sweep
from pyfmi_models.card import parse_card

ROOT = Path(__file__).parents[2]
FENCED = re.compile(r"^( *)```(\w+)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
TESTED_ELSEWHERE = "adding_physics.md"
"""Its files make a law and an effect, in a copy of the packages: tests/documents/test_new_physics.py."""


class Block(NamedTuple):
    """A block of code: where it is, its language, its text."""

    name: str
    language: str
    text: str


def blocks(page: Path) -> list[Block]:
    found = enumerate(FENCED.findall(page.read_text("utf-8")), 1)
    return [Block(f"{page.name} {number}", language, textwrap.dedent(text)) for number, (_, language, text) in found]


BLOCKS = [one for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))] for one in blocks(page)]
HELP = [Block(f"help of {verb}", "sh", epilog(verb, module_of(verb))) for verb in verbs()]


def each(language: str) -> pytest.MarkDecorator:
    found = [one for one in BLOCKS + HELP if one.language == language]
    if language != "sh":
        found = [one for one in found if not one.name.startswith(TESTED_ELSEWHERE)]
    return pytest.mark.parametrize("block", found, ids=[one.name for one in found])


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the files that examples name; recordings are the first ten seconds of the example's."""
    folder = tmp_path_factory.mktemp("blocks")
    short = {name: "\n".join([*text.split("\n")[:2001], ""]) for name, text in example.recordings().items()}
    texts = list(short.values())
    (folder / "all").mkdir()
    for name in ("run", "night_"):
        for number, text in enumerate(texts, 1):
            (folder / f"{name}{number}.csv").write_text(text, "utf-8")
    for name, text in zip(("north_1.csv", "north_2.csv", "south_1.csv", "south_2.csv"), texts * 2, strict=False):
        (folder / "all" / name).write_text(text, "utf-8")
    (folder / "axis.toml").write_text(example.CARD, "utf-8")
    for path in cosim.export("paper_mount", folder / "fmus", fmi=3).fmus:
        part = "plant" if "plant" in path.name else "controller"
        path.rename(folder / f"{part}.fmu")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(example, "recordings", lambda: short)
        yield folder


@each("python")
def test_a_block_of_python_runs(block: Block, prepared: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(prepared)
    exec(compile(block.text, block.name, "exec"), {"__name__": "block"})


@each("toml")
def test_a_block_of_toml_is_read_and_a_card_makes_a_plant(block: Block) -> None:
    keys = tomllib.loads(block.text)
    assert keys
    if "friction" in keys and "inertia" in keys.get("mount", {}):
        assert parse_card(block.text, block.name).plant().model().parameters


def typed(text: str) -> Iterator[list[str]]:
    """The command lines of cosim in a block, each as words."""
    for line in text.replace("\\\n", " ").splitlines():
        for part in re.split(r"&&|\|\||\||;", line):
            words = shlex.split(part, comments=True)
            while words and not words[0].endswith("cosim"):
                words = words[1:] if "cosim" in " ".join(words) else []
            if len(words) > 1 and words[1].isalpha():
                yield words[1:]


@each("sh")
def test_each_command_that_is_typed_parses(block: Block, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COSIM_PLUGINS", "")
    monkeypatch.setattr("os.path.isdir", lambda path: True)  # folders that examples name
    for words in typed(block.text):
        asked = [word for word in repeated(plugged(words)) if word not in ("--help", "-h")]
        command = get_command(application(asked))
        with command.make_context("cosim", list(asked)) as context:
            verb = command.get_command(context, asked[0])  # type: ignore[attr-defined]
            assert verb is not None, f"{asked[0]} is no verb"
            if hasattr(verb, "commands"):  # hardware run, ...
                verb, asked = verb.commands[asked[1]], asked[1:]
            helped = {"--help", "-h"} & set(words)
            verb.make_context(asked[0], asked[1:], parent=context, resilient_parsing=bool(helped)).close()


def test_command_lines_are_found_and_help_has_two_or_three_of_each_verb() -> None:
    (words,) = typed("VAR=1 .venv/bin/cosim run sidereal \\\n  --out a  # a note")
    assert words == ["run", "sidereal", "--out", "a"]
    assert sum(1 for block in BLOCKS if block.language == "sh" for _ in typed(block.text)) > 40
    assert {len(list(typed(block.text))) for block in HELP} == {2, 3}


def guided(page: str, folder: Path) -> list[Block]:
    """The blocks of a guide; those that begin with the name of a file are written."""
    found = blocks(ROOT / "docs" / page)
    for block in found:
        if named := re.match(r"# (\w+\.\w+)", block.text):
            (folder / named[1]).write_text(block.text, "utf-8")
    return found


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    guided("scenarios.md", tmp_path)
    return tmp_path / "guided.toml"


def test_the_drawing_in_the_guide_is_the_one_of_its_scenario_built_or_not(scenario: Path) -> None:
    drawn = next(text for _, kind, text in blocks(ROOT / "docs" / "scenarios.md") if kind == "text")
    bare = read_scenario(scenario)
    assert ["\n".join(draw(one)) for one in (bare, with_fmus(bare))] == [drawn.rstrip("\n")] * 2


def test_the_investigation_of_the_guide_puts_its_first_name_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = guided("investigate.md", tmp_path)
    command = next(one.text for one in found if one.text.startswith("cosim investigate loop.toml"))
    told = next(one.text for one in found if one.language == "text")
    monkeypatch.chdir(tmp_path)
    assert call(*next(typed(command))) == 0
    said = capsys.readouterr().out
    without_numbers = [re.sub(r"held-out.*| [\d.]+ .*", "", text).splitlines() for text in (told, said)]
    assert without_numbers[0] == without_numbers[1]


def test_the_scenario_of_the_guide_tracks_and_its_encoder_hangs(scenario: Path) -> None:
    done = run(with_fmus(read_scenario(scenario)))
    t, seen, reading = (done.recording[name] for name in ("t", "seen", "reading"))
    hangs = (t >= 1.5) & (t < 1.6)
    assert np.ptp(reading[hangs]) == 0 < np.ptp(done.recording["q"][hangs])
    assert done.recording.units["seen"] == "arcsec"
    assert (np.diff(np.flatnonzero(np.diff(seen))) == 50).all()  # rows, 20 Hz
    looked = (np.arange(len(t)) // 50 - 1) * 50  # rows; a look is shown one step of the camera later
    noise = seen - 206264.806 * done.recording["q"][looked]
    assert 0.02 < noise[t >= 0.05].std() < 0.1
    assert np.abs(done.recording["q"] - done.recording["q_d"])[(t > 1.0) & (t < 1.5)].max() < 1e-6
    assert "camera is a Python function: each of its steps costs microseconds." in done.statistics["notes"]


def test_the_sweep_of_the_guide_runs(scenario: Path) -> None:
    sweep = read_sweep(scenario.with_name("many.toml"))
    done = conduct(sweep, with_fmus(read_scenario(sweep.scenario)), scenario.with_name("many"), workers=2)
    table = pd.read_parquet(done.table)
    assert list(table["status"]) == ["ok"] * 8
    assert table["reference.frequency"].isin([0.1, 0.2]).all()
    assert table["rms_error"].between(0.001, 10.0).all()
