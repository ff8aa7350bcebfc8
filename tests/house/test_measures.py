"""The sizes of the house have limits: functions, files and the tests' files; types and docstrings."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from imports import PACKAGES, ROOT

LONGEST = 400
"""Lines of a file: beyond them it holds more than one idea."""
Function = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def texts() -> dict[Path, str]:
    """What stands in each file of the packages."""
    return {path: path.read_text("utf-8") for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))}


@cache
def trees() -> dict[Path, ast.Module]:
    return {path: ast.parse(text) for path, text in texts().items()}


def public(node: ast.AST) -> Iterator[Function | ast.ClassDef]:
    """Functions and classes of a module, and the methods of its classes, whose names have no underscore."""
    for one in ast.iter_child_nodes(node):
        if isinstance(one, Function | ast.ClassDef) and not one.name.startswith("_") and not borrows(one):
            yield one
            if isinstance(one, ast.ClassDef):
                yield from public(one)


def borrows(node: Function | ast.ClassDef) -> bool:
    """Whether it is the setter of a property, or an overload, whose docstring stands elsewhere."""
    names = [one.attr if isinstance(one, ast.Attribute) else getattr(one, "id", "") for one in node.decorator_list]
    return bool({"setter", "overload"} & set(names))


def test_no_function_has_more_than_60_lines() -> None:
    """From `def` to its end, docstrings counted."""
    functions = [node for tree in trees().values() for node in ast.walk(tree) if isinstance(node, Function)]
    assert max((one.end_lineno or one.lineno) - one.lineno + 1 for one in functions) <= 60


def test_files_of_packages_tests_and_benches_are_short() -> None:
    files = [*texts(), *(path for folder in ("bench", "tests") for path in (ROOT / folder).rglob("*.py"))]
    lines = {path: len(path.read_text("utf-8").splitlines()) for path in files}
    long = {path.name: number for path, number in lines.items() if number > LONGEST}
    assert not long, f"split by meaning: {long}"


def test_what_has_a_type_is_no_dictionary_and_a_diagnosis_does_not_ask_for_classes() -> None:
    rooms = {"diagnosis", "report", "delivery"}
    asking = [text for path, text in texts().items() if set(path.relative_to(ROOT).parts) & rooms]
    assert sum(text.count("dict[str, Any]") for text in texts().values()) <= 40
    assert sum(text.count("isinstance(") for text in asking) <= 10


def test_public_names_have_docstrings() -> None:
    named = [(path, one) for path, tree in trees().items() for one in public(tree)]
    assert not [f"{path.relative_to(ROOT)}: {one.name}" for path, one in named if not ast.get_docstring(one)]
