"""What a person reads is in plain technical English: README, docs, help, the report and the terminal know the swaps."""

import inspect
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from effect_examples import EXAMPLES
from plain_words import unplain
from report_example import diagnosis
from typer.main import get_command

import cosim
from cosim.cli import application
from cosim.cli.verbs import verbs
from cosim.diagnosis.effects.base import UNSEEN
from cosim.report import render
from cosim.report.terminal import summary
from pyfmi_models.effects import FORMS

ROOT = Path(__file__).parents[2]


def document(name: str) -> str:
    text = (ROOT / name).read_text("utf-8")
    if name == "CHANGELOG.md":
        return text.split("## [Unreleased]")[1].split("\n## [0.1.0]")[0]
    return text


def report(kind: str) -> str:
    found = diagnosis(kind)
    return re.sub(r"<(script|style).*?</\1>", "", render(found), flags=re.DOTALL) + summary(found)


def help_of(verb: str) -> str:
    """Nothing is returned where it is printed in boxes."""
    command = get_command(application([verb] if verb else []))
    with command.make_context("cosim", [verb or "--help"], resilient_parsing=True) as context:
        if not verb:
            return command.get_help(context)
        found = command.get_command(context, verb)  # type: ignore[attr-defined]
        with found.make_context(verb, ["--help"], parent=context, resilient_parsing=True) as inner:
            return str(found.get_help(inner))


def public(name: str) -> str:
    one = getattr(cosim, name)
    methods = [getattr(one, each) for each in vars(one) if not each.startswith("_")] if inspect.isclass(one) else []
    return "\n".join(inspect.getdoc(each) or "" for each in (one, *methods))


def of_effects(_: str) -> str:
    said = [f"{one.title} {one.action} {one.action_linear} {one.told_apart_by} {one.to_record}" for one in FORMS]
    return "\n".join([str(UNSEEN), *said, *(effect.statement() for effect in EXAMPLES)])


NAMES: dict[Callable[[str], str], list[str]] = {
    document: ["README.md", "CHANGELOG.md", "pyproject.toml", *(f"docs/{one.name}" for one in ROOT.glob("docs/*.md"))],
    report: ["two", "none", "unknown"],
    help_of: ["", *verbs()],
    public: [name for name in cosim.__all__ if not name.startswith("_")],
    of_effects: ["effects"],
}


@pytest.mark.parametrize(("read", "name"), [(read, name) for read, names in NAMES.items() for name in sorted(names)])
def test_what_a_person_reads_is_in_plain_words(
    read: Callable[[str], str], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = read(name) + re.sub("[─-╿]", " ", capsys.readouterr().out)
    assert text or read is public
    assert not unplain(text)


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 140


@pytest.mark.parametrize(
    "text",
    [
        "one that is kept for\nthe proof",
        "sliding friction is higher by 30 % of their mean",
        "It goes with time.",
        "4 effects not seen",
        "tell apart",
    ],
)
def test_a_word_to_be_swapped_is_noticed(text: str) -> None:
    assert unplain(text)
