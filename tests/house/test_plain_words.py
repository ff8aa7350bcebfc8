"""What a person reads is in plain technical English: README, docs, help, the report and the terminal know the swaps."""

import inspect
import re
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


@pytest.mark.parametrize("name", ["README.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))])
def test_a_document_is_in_plain_words(name: str) -> None:
    assert not unplain((ROOT / name).read_text("utf-8"))


@pytest.mark.parametrize("kind", ["two", "none", "unknown"])
def test_report_and_terminal_are_in_plain_words(kind: str) -> None:
    found = diagnosis(kind)
    assert not unplain(re.sub(r"<(script|style).*?</\1>", "", render(found), flags=re.DOTALL))
    assert not unplain(summary(found))


@pytest.mark.parametrize("verb", verbs())
def test_the_help_of_a_verb_is_in_plain_words(verb: str) -> None:
    command = get_command(application([verb]))
    with command.make_context("cosim", [verb]) as context:
        found = command.get_command(context, verb)  # type: ignore[attr-defined]
        assert found is not None
        with found.make_context(verb, ["--help"], parent=context, resilient_parsing=True) as inner:
            assert not unplain(found.get_help(inner))


def test_what_is_said_of_effects_is_in_plain_words() -> None:
    assert not unplain(UNSEEN)
    for form in FORMS:
        assert not unplain(f"{form.title} {form.action} {form.action_linear} {form.told_apart_by} {form.to_record}")
    for effect in EXAMPLES:
        assert not unplain(effect.statement())


def test_the_help_of_all_and_the_description_are_in_plain_words() -> None:
    command = get_command(application([]))
    with command.make_context("cosim", ["--help"], resilient_parsing=True) as context:
        assert not unplain(command.get_help(context))
    assert not unplain((ROOT / "pyproject.toml").read_text("utf-8"))


@pytest.mark.parametrize("name", [name for name in cosim.__all__ if not name.startswith("_")])
def test_what_a_public_name_says_of_itself_is_in_plain_words(name: str) -> None:
    one = getattr(cosim, name)
    methods = [getattr(one, each) for each in vars(one) if not each.startswith("_")] if inspect.isclass(one) else []
    assert not unplain("\n".join(inspect.getdoc(each) or "" for each in (one, *methods)))


def test_what_is_new_is_told_in_plain_words() -> None:
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert not unplain(text.split("## [Unreleased]")[1].split("\n## [0.1.0]")[0])


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 140


def test_a_word_to_be_swapped_is_noticed() -> None:
    assert unplain("one that is kept for\nthe proof")
    for text in (
        "sliding friction is higher by 30 % of their mean",
        "It goes with time.",
        "4 effects not seen",
        "tell apart",
    ):
        assert unplain(text)
