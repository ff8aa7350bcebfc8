"""The sizes of the house have limits; types, docstrings, and names that are clear and name what is there."""

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from imports import PACKAGES, ROOT

FOLDERS = (*PACKAGES, "bench", "tests")
LONGEST = 400
"""Lines of a file: beyond them it holds more than one idea."""
Function = ast.FunctionDef | ast.AsyncFunctionDef
TEXTS = {path: path.read_text("utf-8") for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))}
"""What stands in each file of Python."""
PRODUCT = [path for path in TEXTS if path.relative_to(ROOT).parts[0] in PACKAGES]


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(TEXTS[path])


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


def test_no_function_has_more_than_60_lines_and_none_a_name_that_could_mean_anything() -> None:
    """From `def` to its end, docstrings counted."""
    functions = [node for path in PRODUCT for node in ast.walk(tree(path)) if isinstance(node, Function)]
    assert max((one.end_lineno or one.lineno) - one.lineno + 1 for one in functions) <= 60
    vague = {"told", "beside", "left", "stands", "found", "aside", "asked"}
    assert not vague & {one.name.removeprefix("_") for one in functions}


def test_files_of_packages_tests_and_benches_are_short() -> None:
    lines = {path.name: len(text.splitlines()) for path, text in TEXTS.items()}
    long = {name: number for name, number in lines.items() if number > LONGEST}
    assert not long, f"split by meaning: {long}"


def test_what_has_a_type_is_no_dictionary_and_a_diagnosis_does_not_ask_for_classes() -> None:
    rooms = {"diagnosis", "report", "delivery"}
    asking = [TEXTS[path] for path in PRODUCT if set(path.relative_to(ROOT).parts) & rooms]
    assert sum(TEXTS[path].count("dict[str, Any]") for path in PRODUCT) <= 40
    assert sum(text.count("isinstance(") for text in asking) <= 10


def test_public_names_have_docstrings() -> None:
    named = [(path, one) for path in PRODUCT for one in public(tree(path))]
    assert not [f"{path.relative_to(ROOT)}: {one.name}" for path, one in named if not ast.get_docstring(one)]


# Documents and docstrings name files, modules and their members that there are.

DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "results").glob("*.md")])
MODULES = {".".join(one.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): one for one in TEXTS}
FILES = {one.name for folder in (*FOLDERS, "docs") for one in (ROOT / folder).rglob("*.*")}
PATH = re.compile(rf"(?<![\w/.])(?:{'|'.join(PACKAGES)}|bench|tests|docs|results|\.ci)(?:/[\w.-]+)+")
NAME = re.compile(rf"\b(?:{'|'.join(PACKAGES)})(?:\.[a-zA-Z_]\w*)+")
BARE = re.compile(r"`(\w+\.(?:py|c|h))`")
TO_WRITE = {"herschel_bulkley.py", "wind_load.py", "wind_load", "my_drive.py", "camera.py", "equations.c", "model.c"}
"""Files that a reader is told to write, or that an export makes."""
MOVED = {"cosim.stiffness", "cosim.sweeps"}
"""Names that the changelog says were moved."""
GROUPS = {"cosim.effects", "cosim.laws", "cosim.hypotheses"}
GROUPS |= set(tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"])
"""Entry points by which other packages bring their own."""
OTHERS = {"scope_files.c", "csv_output.py"}
"""Files of other projects that a page or docstring says are read."""
ENDINGS = ("py", "c", "toml", "fmu", "md", "so")


@cache
def members(module: str) -> frozenset[str]:
    """Every name that is written in a module, so that classes, their fields and functions all count."""
    return frozenset(re.findall(r"\w+", TEXTS[MODULES[module]]))


def texts() -> Iterator[tuple[str, str]]:
    """Where something is said, and what."""
    for page in DOCUMENTS:
        yield str(page.relative_to(ROOT)), page.read_text("utf-8")
    for path in TEXTS:
        for node in ast.walk(tree(path)) if path != Path(__file__) else ():
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                yield f"{path.relative_to(ROOT)}:{node.lineno}", str(node.value.value)


def is_there(name: str) -> bool:
    """Whether a dotted name is a module, or a name that stands in one."""
    parts = name.split(".")
    known = next(i for i in range(len(parts), 0, -1) if ".".join(parts[:i]) in MODULES)
    return known == len(parts) or parts[known] in members(".".join(parts[:known]))


def untrue(text: str) -> set[str]:
    """What a text names and is not there."""
    names = {one for one in NAME.findall(text) if one.split(".")[-1] not in (*ENDINGS, *TO_WRITE)} - MOVED - GROUPS
    paths = {one.rstrip(".") for one in PATH.findall(text)}
    paths = {one for one in paths if not re.search(r"[A-Z]{2}", Path(one).stem) and Path(one).name not in TO_WRITE}
    bare = set(BARE.findall(text)) - FILES - TO_WRITE - OTHERS
    return {one for one in names if not is_there(one)} | {one for one in paths if not (ROOT / one).exists()} | bare


def test_what_is_named_is_there() -> None:
    wrong = {where: found for where, text in texts() if (found := untrue(text))}
    assert not wrong, wrong


@pytest.mark.parametrize(
    "text", ["see `gone.py`", "cosim.data.nowhere.Recording", "cosim/data/nowhere.py", "cosim.data.recording.Nothing"]
)
def test_what_is_not_there_is_noticed(text: str) -> None:
    assert untrue(text)
    assert not untrue("cosim.data.recording.Recording of cosim/data/recording.py, `recording.py`")
