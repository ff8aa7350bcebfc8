"""The sizes of the house stay what they are: short functions and files, types, docstrings; so do the tests' files."""

from pathlib import Path
from statistics import median

from measures import at_90, measured

ROOT = Path(__file__).parents[1]
FOUND = measured(ROOT)
LONGEST = 300
"""Lines of a file."""


def test_functions_are_short() -> None:
    assert median(FOUND.functions) <= 6
    assert at_90(FOUND.functions) <= 16
    assert FOUND.functions[-1] <= 62


def test_files_are_short() -> None:
    assert at_90(FOUND.files) <= 210
    assert FOUND.files[-1] <= LONGEST


def test_files_of_tests_are_short() -> None:
    lines = {path: len(path.read_text("utf-8").splitlines()) for path in (ROOT / "tests").rglob("*.py")}
    long = {path.name: number for path, number in lines.items() if number > LONGEST}
    assert not long, f"split by meaning: {long}"


def test_what_has_a_type_is_no_dictionary_and_a_diagnosis_does_not_ask_for_classes() -> None:
    assert FOUND.dictionaries <= 40
    assert FOUND.instances <= 10


def test_public_names_have_docstrings() -> None:
    assert not FOUND.bare
