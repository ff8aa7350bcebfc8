"""Sizes of the house: python tests/measures.py [FOLDER OF A CHECKOUT]

Lines of functions and files (docstrings counted), occurrences of `dict[str, Any]`, calls of `isinstance` in the
diagnosis, public names without a docstring (a setter has its property's), and the modules directly in `cosim/`.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import median

PACKAGES = ("cosim", "cosim_studies", "pyfmi_models")
Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions(tree: ast.AST) -> Iterator[int]:
    """Lines of each function, from `def` to its end."""
    for node in ast.walk(tree):
        if isinstance(node, Function):
            yield (node.end_lineno or node.lineno) - node.lineno + 1


def public(node: ast.AST) -> Iterator[Function | ast.ClassDef]:
    """Functions and classes of a module, and the methods of its classes, whose names have no underscore."""
    for one in ast.iter_child_nodes(node):
        if isinstance(one, Function | ast.ClassDef) and not one.name.startswith("_") and not is_setter(one):
            yield one
            if isinstance(one, ast.ClassDef):
                yield from public(one)


def is_setter(node: Function | ast.ClassDef) -> bool:
    """Whether it is the setter of a property."""
    return any(isinstance(one, ast.Attribute) and one.attr == "setter" for one in node.decorator_list)


def spread(values: list[int]) -> str:
    """Median, 90 % and largest."""
    ranked = sorted(values)
    return f"{len(ranked):,}; lines: median {median(ranked):g}, p90 {ranked[int(0.9 * len(ranked))]}, max {ranked[-1]}"


def main() -> None:
    root = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1])
    texts = {path: path.read_text("utf-8") for name in PACKAGES for path in sorted((root / name).rglob("*.py"))}
    trees = {path: ast.parse(text) for path, text in texts.items()}
    names = [(path, one) for path, tree in trees.items() for one in public(tree)]
    bare = [f"{path.relative_to(root)}: {one.name}" for path, one in names if not ast.get_docstring(one)]
    diagnosis = [text for path, text in texts.items() if "diagnosis" in path.relative_to(root).parts]
    print("functions:", spread([lines for tree in trees.values() for lines in functions(tree)]))
    print("files:", spread([len(text.splitlines()) for text in texts.values() if text]))
    print("dict[str, Any]:", sum(text.count("dict[str, Any]") for text in texts.values()))
    print("isinstance in the diagnosis:", sum(text.count("isinstance(") for text in diagnosis))
    print(f"public names: {len(names):,}, without a docstring: {len(bare)}", *bare)
    print("modules in cosim/:", *(path.name for path in sorted((root / "cosim").glob("*.py"))))


if __name__ == "__main__":
    main()
