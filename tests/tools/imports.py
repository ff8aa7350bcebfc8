"""What the modules of the packages import, read from their text."""

import ast
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLUG_INS = tuple(sorted(path.parent.name for path in ROOT.glob("cosim_*/__init__.py")))
"""Packages that only entry points name."""
PACKAGES = ("cosim", "pyfmi_models", *PLUG_INS)
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in PACKAGES
    for path in (ROOT / package).rglob("*.py")
}


@cache
def imports(name: str, inside: bool = True) -> frozenset[str]:
    """List what a module imports, as far as modules of ours go; `inside` counts imports within functions too."""
    tree = ast.parse(FILES[name].read_text("utf-8"))
    return _imported(ast.walk(tree) if inside else tree.body)


@cache
def imports_for_types(name: str) -> frozenset[str]:
    """List what a module imports for type checkers and editors alone: under `if TYPE_CHECKING`, at the top."""
    tree = ast.parse(FILES[name].read_text("utf-8"))
    guarded = [one for one in tree.body if isinstance(one, ast.If) and ast.unparse(one.test) == "TYPE_CHECKING"]
    return _imported(node for one in guarded for node in ast.walk(one))


def _imported(nodes: Iterable[ast.AST]) -> frozenset[str]:
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {one if one in FILES else node.module for one in whole}
    return frozenset(found)
