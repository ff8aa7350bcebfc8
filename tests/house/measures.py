"""Sizes of the house: python tests/house/measures.py [FOLDER OF A CHECKOUT]

Lines of functions and files (docstrings counted), occurrences of `dict[str, Any]`, calls of `isinstance` in the
diagnosis, public names without a docstring (a setter has its property's, an overload its function's), and the modules
directly in `cosim/`.
"""

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

PACKAGES = (
    "cosim",
    "cosim_ethercat",
    "cosim_formulas",
    "cosim_observatory",
    "cosim_serve",
    "cosim_studies",
    "pyfmi_models",
)
Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions(tree: ast.AST) -> Iterator[int]:
    """Lines of each function, from `def` to its end."""
    for node in ast.walk(tree):
        if isinstance(node, Function):
            yield (node.end_lineno or node.lineno) - node.lineno + 1


def public(node: ast.AST) -> Iterator[Function | ast.ClassDef]:
    """Functions and classes of a module, and the methods of its classes, whose names have no underscore."""
    for one in ast.iter_child_nodes(node):
        if isinstance(one, Function | ast.ClassDef) and not one.name.startswith("_") and not borrows(one):
            yield one
            if isinstance(one, ast.ClassDef):
                yield from public(one)


def borrows(node: Function | ast.ClassDef) -> bool:
    """Whether it is the setter of a property, or an overload."""
    names = [one.attr if isinstance(one, ast.Attribute) else getattr(one, "id", "") for one in node.decorator_list]
    return bool({"setter", "overload"} & set(names))


@dataclass(frozen=True)
class Measures:
    """Sizes of a checkout."""

    functions: list[int]
    """Lines of each function, the shortest first."""
    files: list[int]
    """Lines of each file that holds any, the shortest first."""
    dictionaries: int
    """Occurrences of `dict[str, Any]`."""
    instances: int
    """Calls of `isinstance` in the diagnosis."""
    public: int
    bare: list[str]
    """Public names without a docstring, each with its file."""
    modules: list[str]
    """Directly in `cosim/`."""


def measured(root: Path) -> Measures:
    """Measure the packages of a checkout."""
    texts = {path: path.read_text("utf-8") for name in PACKAGES for path in sorted((root / name).rglob("*.py"))}
    trees = {path: ast.parse(text) for path, text in texts.items()}
    names = [(path, one) for path, tree in trees.items() for one in public(tree)]
    diagnosis = [
        text for path, text in texts.items() if set(path.relative_to(root).parts) & {"diagnosis", "report", "delivery"}
    ]
    return Measures(
        functions=sorted(lines for tree in trees.values() for lines in functions(tree)),
        files=sorted(len(text.splitlines()) for text in texts.values() if text),
        dictionaries=sum(text.count("dict[str, Any]") for text in texts.values()),
        instances=sum(text.count("isinstance(") for text in diagnosis),
        public=len(names),
        bare=[f"{path.relative_to(root)}: {one.name}" for path, one in names if not ast.get_docstring(one)],
        modules=[path.name for path in sorted((root / "cosim").glob("*.py"))],
    )


def at_90(ranked: list[int]) -> int:
    """What 90 % of sorted values do not exceed."""
    return ranked[int(0.9 * len(ranked))]


def spread(ranked: list[int]) -> str:
    """Median, 90 % and largest."""
    return f"{len(ranked):,}; lines: median {median(ranked):g}, p90 {at_90(ranked)}, max {ranked[-1]}"


def main() -> None:
    found = measured(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[2]))
    print("functions:", spread(found.functions))
    print("files:", spread(found.files))
    print("dict[str, Any]:", found.dictionaries)
    print("isinstance in the diagnosis:", found.instances)
    print(f"public names: {found.public:,}, without a docstring: {len(found.bare)}", *found.bare)
    print("modules in cosim/:", *found.modules)


if __name__ == "__main__":
    main()
