"""Documents and docstrings name files, modules and their members that there are."""

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from imports import PACKAGES

ROOT = Path(__file__).parents[2]
SOURCES = sorted(path for folder in (*PACKAGES, "bench", "tests") for path in (ROOT / folder).rglob("*.py"))
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "results").glob("*.md")])
MODULES = {".".join(one.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): one for one in SOURCES}
PATH = re.compile(rf"(?<![\w/.])(?:{'|'.join(PACKAGES)}|bench|tests|docs|results|\.ci)(?:/[\w.-]+)+")
NAME = re.compile(rf"\b(?:{'|'.join(PACKAGES)})(?:\.[a-zA-Z_]\w*)+")
BARE = re.compile(r"`(\w+\.(?:py|c|h))`")
TO_WRITE = {"herschel_bulkley.py", "wind_load.py", "wind_load", "my_drive.py", "camera.py", "equations.c", "model.c"}
"""Files that a reader is told to write, or that an export makes."""
MOVED = {"cosim.stiffness"}
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
    return frozenset(re.findall(r"\w+", MODULES[module].read_text("utf-8")))


def texts() -> Iterator[tuple[str, str]]:
    """Where something is said, and what."""
    for page in DOCUMENTS:
        yield str(page.relative_to(ROOT)), page.read_text("utf-8")
    for path in SOURCES:
        if path != Path(__file__):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if (
                    isinstance(node, ast.Expr)
                    and isinstance(node.value, ast.Constant)
                    and isinstance(node.value.value, str)
                ):
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value.value


def is_there(name: str) -> bool:
    """Whether a dotted name is a module, or a name that stands in one."""
    parts = name.split(".")
    known = next(i for i in range(len(parts), 0, -1) if ".".join(parts[:i]) in MODULES)
    return known == len(parts) or parts[known] in members(".".join(parts[:known]))


def untrue(text: str) -> set[str]:
    """What a text names and is not there."""
    names = {
        one
        for one in NAME.findall(text)
        if one.split(".")[-1] not in (*ENDINGS, *TO_WRITE) and one not in MOVED | GROUPS and not is_there(one)
    }
    paths = {one.rstrip(".") for one in PATH.findall(text)}
    paths = {one for one in paths if not re.search(r"[A-Z]{2}", Path(one).stem) and Path(one).name not in TO_WRITE}
    bare = {one for one in BARE.findall(text) if one not in FILES | TO_WRITE | OTHERS}
    return names | {one for one in paths if not (ROOT / one).exists()} | bare


FILES = {one.name for folder in (*PACKAGES, "bench", "tests", "docs") for one in (ROOT / folder).rglob("*.*")}


def test_what_is_named_is_there() -> None:
    wrong = {where: found for where, text in texts() if (found := untrue(text))}
    assert not wrong, wrong


@pytest.mark.parametrize(
    "text", ["see `gone.py`", "cosim.data.nowhere.Recording", "cosim/data/nowhere.py", "cosim.data.recording.Nothing"]
)
def test_what_is_not_there_is_noticed(text: str) -> None:
    assert untrue(text)
    assert not untrue("cosim.data.recording.Recording of cosim/data/recording.py, `recording.py`")


@pytest.mark.parametrize("package", PACKAGES)
def test_no_function_has_a_name_that_could_mean_anything(package: str) -> None:
    vague = re.compile(r"\bdef _?(told|beside|left|stands|found|aside|asked)\(")
    found = [
        f"{path}: {name}" for path in (ROOT / package).rglob("*.py") for name in vague.findall(path.read_text("utf-8"))
    ]
    assert not found
