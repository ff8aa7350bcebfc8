"""Every code block of README and docs: Python runs, TOML is read, and each command line that is typed parses."""

import re
import shlex
import textwrap
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from typer.main import get_command

import cosim
from cosim.cli import application, plugged, repeated
from cosim.cli.verbs import verbs
from cosim_serve import example
from pyfmi_models.card import parse_card

ROOT = Path(__file__).parents[2]
FENCED = re.compile(r"^( *)```(\w+)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
TESTED_ELSEWHERE = {"adding_physics.md"}
"""Its files make a law and an effect: tests/documents/test_new_physics.py."""


class Block(NamedTuple):
    """A block of code: where it is, its language, its text."""

    name: str
    language: str
    text: str


def blocks(*languages: str) -> Iterator[Block]:
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        for number, (_, language, text) in enumerate(FENCED.findall(path.read_text("utf-8")), 1):
            if language in languages:
                yield Block(f"{path.name} {number}", language, textwrap.dedent(text))


def each(*languages: str) -> pytest.MarkDecorator:
    found = [
        one for one in blocks(*languages) if one.name.split()[0] not in TESTED_ELSEWHERE or languages != ("python",)
    ]
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
def test_a_block_of_toml_is_read(block: Block) -> None:
    keys = tomllib.loads(block.text)
    assert keys
    if "friction" in keys and "inertia" in keys.get("mount", {}) and block.name.split()[0] not in TESTED_ELSEWHERE:
        parse_card(block.text, block.name)


def typed(text: str) -> Iterator[list[str]]:
    """The command lines of cosim in a block, each as words."""
    for line in text.replace("\\\n", " ").splitlines():
        for part in re.split(r"&&|\|\||\||;", line):
            words = shlex.split(part, comments=True)
            while words and not words[0].endswith("cosim"):
                words = words[1:] if "cosim" in " ".join(words) else []
            if len(words) > 1 and words[1] in verbs():
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
            if hasattr(verb, "commands"):  # hardware run, ...
                verb, asked = verb.commands[asked[1]], asked[1:]
            verb.make_context(asked[0], asked[1:], parent=context).close()


def test_command_lines_are_found() -> None:
    (words,) = typed("VAR=1 .venv/bin/cosim run sidereal \\\n  --out a  # a note")
    assert words == ["run", "sidereal", "--out", "a"]
    assert sum(1 for block in blocks("sh") for _ in typed(block.text)) > 40
