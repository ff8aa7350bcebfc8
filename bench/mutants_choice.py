"""Which tests are asked of a mutant: those that call what was changed, or use what was declared there.

A line inside of a function belongs to the innermost one. Of hundreds of tests that call it those come first that name
it, then those of files that are near the module, by imports and names, then all others. A line outside declares
something: a constant of the module, a field of a class. Of such a line the tests come first that name it, then those
that call a function which uses it in the same class, in the same module, and elsewhere; last all others that call
anything of the module.
"""

import ast
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from reach import Reached

HOME = Path(__file__).parents[1]
PRODUCT = ("cosim", "pyfmi_models")
MOST, NEAREST = 4, 6
"""Imports between a test and a module at most, and test files that are asked at most."""
BUDGET, MANY = 20.0, 200
"""Seconds that the tests of a mutant take without it in all, and how many tests that are at most."""
SLOW = ("test_attack", "test_prove", "test_proof", "test_serve", "test_benchmarks", "test_same_bits", "test_platforms")
"""Test files that are not asked: a mutant that only they would notice counts as survived."""
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Declared:
    """What a line outside of functions declares: its names, and the class around it (empty: the module)."""

    names: frozenset[str]
    inside: str = ""


@cache
def parsed(path: Path) -> ast.Module:
    """The tree of a file; nothing of one that is not there."""
    return ast.parse(path.read_text("utf-8") if path.is_file() else "")


@cache
def imported(path: Path) -> frozenset[Path]:
    """Files of the tree that a file imports by itself, also inside of functions."""
    found = set()
    for node in ast.walk(parsed(path)):
        names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module, *(f"{node.module}.{one.name}" for one in node.names)]
        for name in names:
            stem = name.replace(".", "/")
            files = [
                place / f"{stem}{end}"
                for place in (HOME, HOME / "tests" / "tools", path.parent)
                for end in (".py", "/__init__.py")
            ]
            found |= {one for one in files if one.is_file()}
    return frozenset(found - {path})


def distance(test: Path, module: Path) -> int:
    """Imports from a test to a module, at most `MOST` + 1."""
    seen, edge = {test}, {test}
    for steps in range(1, MOST + 1):
        edge = {one for path in edge for one in imported(path)} - seen
        if module in edge:
            return steps
        seen |= edge
    return MOST + 1


@cache
def belonging(module: Path) -> tuple[str, ...]:
    """The test files nearest to a module: by imports and by words of the name, the smallest of equally near first."""
    words = set(str(module.relative_to(HOME).with_suffix("")).replace("/", "_").split("_"))
    ranked = []
    for test in (HOME / "tests").rglob("test_*.py"):
        steps, shared = distance(test, module), len(words & set(test.stem.split("_")[1:]))
        if steps <= MOST and not test.stem.startswith(SLOW):
            ranked.append((steps - 2 * shared, test.stat().st_size, str(test.relative_to(HOME / "tests"))))
    return tuple(name for *_, name in sorted(ranked)[:NEAREST])


def functions(tree: ast.AST, outside: str = "") -> Iterator[tuple[str, Function]]:
    """Every function of a tree under its qualified name, as Python tells it."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, Function):
            yield f"{outside}{node.name}", node
            yield from functions(node, f"{outside}{node.name}.<locals>.")
        else:
            yield from functions(node, f"{outside}{node.name}." if isinstance(node, ast.ClassDef) else outside)


def around(source: str, line: int) -> str:
    """The qualified name of the innermost function around a line, its decorators included; empty outside."""
    spans = [
        (range(min([node.lineno, *(one.lineno for one in node.decorator_list)]), (node.end_lineno or 0) + 1), name)
        for name, node in functions(ast.parse(source))
    ]
    return min((one for one in spans if line in one[0]), key=lambda one: len(one[0]), default=(range(0), ""))[1]


def declared(source: str, line: int) -> Declared:
    """What a line outside of functions declares, and what is declared by means of that in the same module."""
    statements = list(_statements(ast.parse(source)))
    found = next((one for node, one in statements if node.lineno <= line <= (node.end_lineno or 0)), None)
    if found is None or found.inside:
        return found or Declared(frozenset())
    names = set(found.names)
    while more := {name for node, one in statements for name in one.names if _named(node) & names} - names:
        names |= more
    return Declared(frozenset(names))


def _statements(tree: ast.Module | ast.ClassDef, inside: str = "") -> Iterator[tuple[ast.stmt, Declared]]:
    """Statements that declare something outside of functions, and what."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            yield from _statements(node, f"{inside}{node.name}.")
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = {one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)}
            yield node, Declared(frozenset(names), inside.removesuffix("."))


@cache
def _named(node: ast.AST) -> frozenset[str]:
    """Names and attributes that stand in a piece of code."""
    return frozenset(
        one.id if isinstance(one, ast.Name) else one.attr
        for one in ast.walk(node)
        if isinstance(one, ast.Name | ast.Attribute)
    )


@cache
def users(module: str, what: Declared) -> dict[str, dict[str, int]]:
    """Functions of each module that use what is declared, and how far they are: 0 in the class, 1 in the module, 2."""
    found: dict[str, dict[str, int]] = {}
    for path in (one for folder in PRODUCT for one in (HOME / folder).rglob("*.py")):
        name = str(path.relative_to(HOME))
        if name != module and not what.inside and HOME / module not in imported(path):
            continue  # a constant is used where it is imported, a field wherever an object gets
        for function, node in functions(parsed(path)):
            if _named(node) & what.names:
                within = name == module and bool(what.inside) and function.startswith(f"{what.inside}.")
                found.setdefault(name, {})[function] = 0 if within else 1 if name == module else 2
    return found


@cache
def _texts(file: str) -> dict[str, str]:
    """The text of each test of a file."""
    return {name: ast.unparse(node) for name, node in functions(parsed(HOME / file)) if "<locals>" not in name}


def _names(test: str, word: str) -> bool:
    """Whether the text of a test has a word."""
    file, _, name = test.split("[")[0].partition("::")
    return bool(re.search(rf"\b{re.escape(word)}\b", _texts(file).get(name.replace("::", "."), "")))


def nearness_of_function(module: str, function: str, one: Reached) -> int | None:
    """How far a test is from a function: 0 where it names it, 1 in a file near the module, else 2; None: too far."""
    if function not in one.calls.get(module, []):
        return None
    if _names(one.test, function.rsplit(".")[-1]):
        return 0
    return 1 if one.test.split("::")[0].removeprefix("tests/") in belonging(HOME / module) else 2


def nearness(module: str, what: Declared, one: Reached) -> int | None:
    """How far a test is from what a line declares: from who uses it, less the names that it tells; None: too far."""
    words = what.names | {what.inside.rsplit(".")[-1]} - {""}
    told = sum(_names(one.test, word) for word in words)
    using = users(module, what).items()
    used = [far for file, by in using for name, far in by.items() if name in one.calls.get(file, [])]
    if used or module in one.calls or (told and HOME / module in imported(HOME / one.test.split("::")[0])):
        return min([*used, 3]) - told
    return None


def calling(module: str, source: str, line: int, reached: Sequence[Reached]) -> tuple[str, ...]:
    """Tests that call the function around a line, for `BUDGET` seconds; outside of functions see above.

    Of each test function the cheapest case comes first, the second of each counts as farther.
    """
    function, what = around(source, line), declared(source, line)
    cases: dict[str, int] = {}
    ranked = []
    for one in reached:  # the cheapest first
        near = nearness_of_function(module, function, one) if function else nearness(module, what, one)
        if near is not None:
            case = cases.setdefault(one.test.split("[")[0], 0)
            ranked.append((near + case, case, one.seconds, one.test))
            cases[one.test.split("[")[0]] += 1
    return _within_budget([(seconds, test) for *_, seconds, test in sorted(ranked)])


def _within_budget(ranked: Sequence[tuple[float, str]]) -> tuple[str, ...]:
    spent, found = 0.0, []
    for seconds, test in ranked:
        if not found or spent + seconds <= BUDGET:  # a cheap one may stand behind one that takes too long
            spent += seconds
            found.append(test.removeprefix("tests/"))
    return tuple(found[:MANY])
