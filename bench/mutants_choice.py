"""Which files of tests are asked of an error in a module, the likeliest to notice it first.

Those whose text names what was changed (the function around the line, or what the line declares) come first; then those
in the folder that mirrors the module's, those that import it over fewer steps, and those that share words with its
name; of equal ones the shortest. A C file is imported where the Python beside it is that loads its library.
"""

import ast
import re
from functools import cache
from pathlib import Path

HOME = Path(__file__).parents[1]
PRODUCT = ("cosim", "pyfmi_models", *sorted(path.parent.name for path in HOME.glob("cosim_*/__init__.py")))
MOST, TOGETHER, MANY = 4, 8, 20
"""Imports between a test and a module at most; files of which tests that name what was changed are asked first and
together, and how many."""
SLOW = ("test_attack", "test_prove", "test_proof", "test_serve", "test_benchmarks", "test_platforms")
"""Test files that are not asked, nor those of `NOT_ASKED`: what only they would notice counts as survived."""
NOT_ASKED = ("house", "documents", "studies", "serve")
DECLARING = {"pyfmi_models": "models/test_parameter_ranges.py", "cosim/hardware": "hardware/test_machine_ranges.py"}
"""Tests of what modules of a folder declare, which do not name it: asked first of lines outside of functions."""
LOADED = {
    "cosim/hardware": ("cosim/hardware/library.py",),
    "cosim/master/loop": ("cosim/master/loop/compiled.py",),
    "cosim/estimation/kernels": ("cosim/estimation/kernels/__init__.py",),
    "cosim/estimation/identify": ("cosim/estimation/identify/output_error.py",),
    "cosim_nesting/c": ("cosim_nesting/source.py",),
    "pyfmi_models/export/c": ("pyfmi_models/export/build.py",),
}
"""What loads the C files of a folder."""
COMMON = frozenset({"main", "read", "of", "run", "value", "at", "start", "name", "write", "make", "__init__", "check"})
"""Names that say nothing of who is meant."""


@cache
def imported(path: Path) -> frozenset[Path]:
    """Files of the tree that a file imports by itself, also inside of functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module, *(f"{node.module}.{one.name}" for one in node.names)]
        for name in names:
            stem = name.replace(".", "/")
            files = [
                place / f"{stem}{end}"
                for place in (HOME, HOME / "tests" / "tools", HOME / "bench", path.parent)
                for end in (".py", "/__init__.py")
            ]
            found |= {one for one in files if one.is_file()}
    return frozenset(found - {path})


@cache
def distances(test: Path) -> dict[Path, int]:
    """Imports from a test to each file that it reaches over at most `MOST`."""
    found, edge = {test: 0}, {test}
    for steps in range(1, MOST + 1):
        edge = {one for path in edge for one in imported(path)} - found.keys()
        found |= dict.fromkeys(edge, steps)
    return found


def functions(source: str, line: int) -> list[tuple[int, str]]:
    """Functions around a line of Python, each with its length."""
    return [
        (node.end_lineno - node.lineno, node.name)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef) and node.end_lineno and node.lineno <= line <= node.end_lineno
    ]


def told(source: str, line: int, is_c: bool) -> str:
    """The name of the innermost function around a line, or of what it declares; empty where that says nothing."""
    if is_c:
        heads = [re.match(r"[\w ]*?[ *](\w+)\([^;]*$", text) for text in source.split("\n")[:line]]
        return next((one[1] for one in reversed(heads) if one and not one.string.startswith((" ", "/"))), "")
    around = functions(source, line)
    declared = re.match(r"\s*(\w+)\b[^=(]*=", source.split("\n")[line - 1])
    name = min(around)[1] if around else declared[1] if declared else ""
    return "" if name in COMMON or name.startswith("__") else name.lstrip("_")


def asked(module: Path, source: str, line: int) -> tuple[list[str], list[str]]:
    """The tests that name what a line is part of, and the files of tests that may notice an error there."""
    is_c, folder = module.suffix == ".c", str(module.parent.relative_to(HOME))
    files = [HOME / one for one in LOADED[folder]] if is_c else [module]
    name, words = told(source, line, is_c), set(module.stem.split("_"))
    ranked = []
    for test in sorted((HOME / "tests").rglob("test_*.py")):
        place = test.relative_to(HOME / "tests")
        steps = min(distances(test).get(one, MOST + 1) for one in files)
        mirror = len(set(place.parts[:-1]) & set(Path(folder).parts))
        # A module that is found by its folder, as an effect is, is imported nowhere.
        if place.parts[0] in NOT_ASKED or test.stem.startswith(SLOW) or (steps > MOST and not mirror):
            continue
        text = test.read_text("utf-8")
        named = bool(name) and bool(re.search(rf"\b_?{re.escape(name)}\b", text))
        shared = len(words & set(re.split(r"[_\W]", test.stem)[1:]))
        near = steps - 4 * named - 2 * shared - 2 * mirror - (module.stem in text)
        ranked.append((near, len(text), str(place)))
    declares = not is_c and not functions(source, line)
    first = [test for place, test in DECLARING.items() if declares and folder.startswith(place)]
    found = list(dict.fromkeys([*first, *(one for *_, one in sorted(ranked))]))
    return [one for file in found[:TOGETHER] for one in naming(file, name)][:MANY], found


def naming(file: str, name: str) -> list[str]:
    """The tests of a file whose own text has a name."""
    tree = ast.parse((HOME / "tests" / file).read_text("utf-8"))
    inside = [("", node) for node in tree.body]
    inside += [(f"{one.name}::", node) for one in tree.body if isinstance(one, ast.ClassDef) for node in one.body]
    return [
        f"{file}::{owner}{node.name}"
        for owner, node in inside
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
        if name and re.search(rf"\b_?{re.escape(name)}\b", ast.unparse(node))
    ]
