"""The sizes of the house have limits: functions, files and the tests' files; types and docstrings."""

from functools import cache
from pathlib import Path

from measures import Measures, measured

ROOT = Path(__file__).parents[2]
LONGEST = 400
"""Lines of a file: beyond them it holds more than one idea."""


@cache
def found() -> Measures:
    """Measured when it is asked, not when tests are looked for."""
    return measured(ROOT)


def test_no_function_has_more_than_60_lines_and_no_file_more_than_400() -> None:
    assert found().functions[-1] <= 60
    assert found().files[-1] <= LONGEST


def test_files_of_tests_and_benches_are_short() -> None:
    files = [path for folder in ("bench", "tests") for path in (ROOT / folder).rglob("*.py")]
    lines = {path: len(path.read_text("utf-8").splitlines()) for path in files}
    long = {path.name: number for path, number in lines.items() if number > LONGEST}
    assert not long, f"split by meaning: {long}"


def test_what_has_a_type_is_no_dictionary_and_a_diagnosis_does_not_ask_for_classes() -> None:
    assert found().dictionaries <= 40
    assert found().instances <= 10


def test_public_names_have_docstrings() -> None:
    assert not found().bare
