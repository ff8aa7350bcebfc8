"""What a person reads is in plain technical English: README, docs, help, the report and the terminal know the swaps."""

import inspect
import re
from pathlib import Path

import pytest
from effect_examples import EXAMPLES
from report_example import diagnosis
from typer.main import get_command

import cosim
from cosim.cli import VERBS, application
from cosim.report import render
from cosim.report.terminal import summary
from pyfmi_models.effects import FORMS

ROOT = Path(__file__).parents[2]
SWAPS = {
    "finds the physics its model left out": "finds missing physics in the model",
    "hides physics from its card": "a mount whose true model contains effects the card lacks",
    "kept for the proof": "used for validation (never fitted)",
    "told as a formula": "fitted as a lookup table or, if equally good, as a formula",
    "FMU of anyone's": "a third-party plant FMU",
    "from which its shares begin to say something": "use at least 60 cases for meaningful rates",
    "giving and taking FMUs": "exporting and importing FMUs",
    "not sure)": "inconclusive at this sample size",
    "has turned a motor yet": "not yet tested on a physical motor",
    "loaded by nobody": "built but untested",
    "how texts are written": "CSV format",
    "is nothing that can be shown": "unsupported file",
    "Nothing mechanical": "drive or bus, not mechanical",
    "is not quite the machine's": "friction-model error alone could explain this",
    "Tell apart": "How to distinguish",
    "tugs": "torque ripple",
    "spanner": "repair",
}
"""Words of ../shared/design/STYLE.md, "Words", with better ones; part of a sentence each."""
FORMS_OF = {
    r"meets recordings": "runs on recordings",
    r"for the proof\b": "for validation (never fitted)",
    r"(?<!variable \"\") has no name\b": "an effect outside the catalogue",
    r"\b(any|every)(one|body)'s\b": "a third-party FMU",
    r"\bseals? (the )?(truths?|answers?)|conceal effects from": "blind benchmark: hide effects, diagnose, score",
    r"\bMAYBE\b|\bnot seen\b|\bno test\b": "detected / possible / not detected / not testable",
    r"no size of it would": "not testable: these recordings do not excite it",
    r"energy that is left|is no missing effect": "would reduce the residual variance by up to 14 %",
    r"recordings? (that was |that were )?not fitted": "validation recording",
    r"is held by friction": "needs a recording where the axis sticks",
    r"\bt(ell|old)s? apart": "how to distinguish; these parameters are correlated",
    r"than the simulation\b": "actuation delay of 0.77 ms (drive or bus, not mechanical)",
    r"of their mean": "differs by 36 % between directions (of the mean)",
    r"leaves as much": "friction-model error alone could explain this",
    r"\b(it|rest|error|what it) goes with\b": "correlates with",
    r"who steps when": "step sizes, ordering and delays",
    r"\btugs?\b": "torque ripple",
    r"\bin its place\b": "instead",
    r"\bnever saw\b|\bunseen runs?\b": "validation runs",
}
"""Its other rows, as expressions: the sentence in all its forms."""
SWAPPED = {re.compile(re.escape(one), re.IGNORECASE): better for one, better in SWAPS.items()}
SWAPPED |= {re.compile(one, re.IGNORECASE): better for one, better in FORMS_OF.items()}


def unplain(text: str) -> list[str]:
    """The swaps that a text needs."""
    flat = " ".join(text.split())
    return [f"{found[0]!r}: write {SWAPPED[one]!r}" for one in SWAPPED for found in [one.search(flat)] if found]


@pytest.mark.parametrize("name", ["README.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))])
def test_a_document_is_in_plain_words(name: str) -> None:
    assert not unplain((ROOT / name).read_text("utf-8"))


@pytest.mark.parametrize("kind", ["two", "none", "unknown"])
def test_report_and_terminal_are_in_plain_words(kind: str) -> None:
    found = diagnosis(kind)
    assert not unplain(re.sub(r"<(script|style).*?</\1>", "", render(found), flags=re.DOTALL))
    assert not unplain(summary(found))


@pytest.mark.parametrize("verb", VERBS)
def test_the_help_of_a_verb_is_in_plain_words(verb: str) -> None:
    command = get_command(application([verb]))
    with command.make_context("cosim", [verb]) as context:
        found = command.get_command(context, verb)  # type: ignore[attr-defined]
        assert found is not None
        with found.make_context(verb, ["--help"], parent=context, resilient_parsing=True) as inner:
            assert not unplain(found.get_help(inner))


def test_what_is_said_of_effects_is_in_plain_words() -> None:
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
