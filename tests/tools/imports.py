"""What the modules of the packages import, read from their text."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLUG_INS = ("cosim_ethercat", "cosim_formulas", "cosim_observatory", "cosim_serve", "cosim_studies")
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
    found: set[str] = set()
    for node in ast.walk(tree) if inside else tree.body:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {one if one in FILES else node.module for one in whole}
    return frozenset(found)
