"""Blocks of Python code, each with a mark that a copy of the tree leaves when it runs.

A block is a list of statements that run together: the body of a function, of an `if`, of an `else`, of a loop. Its name
is `module:function:number`, so that it is found again when lines above it have moved.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass

SEEN = "_seen_"
SEEN_MODULE = "mutants_seen"
MARKS = f'''"""Marks that all processes of a test leave in one file."""
import mmap, os
if "{SEEN_MODULE.upper()}" in os.environ:
    with open(os.environ["{SEEN_MODULE.upper()}"], "r+b") as file:
        {SEEN} = mmap.mmap(file.fileno(), 0)
else:
    {SEEN} = bytearray({1 << 20})
'''
BODIES = ("body", "orelse", "finalbody")


@dataclass(frozen=True)
class Block:
    """Statements that run together: the function around them (`A.grown`), their number there, first and last line."""

    function: str
    number: int
    first: int
    last: int

    def named(self, module: str) -> str:
        """The name by which a map knows the block."""
        return f"{module}:{self.function}:{self.number}"


def blocks(source: str) -> list[Block]:
    """The blocks of a module, outer ones before those in them; what runs at import is none."""
    return [one for one, _ in _blocks(ast.parse(source))]


def innermost(source: str, line: int) -> Block | None:
    """The smallest block around a line; None outside of functions."""
    around = [one for one in blocks(source) if one.first <= line <= one.last]
    return min(around, key=lambda one: (one.last - one.first, -one.first), default=None)


def marked(source: str, first: int) -> str:
    """The text of a module whose blocks leave marks, numbered from `first`, in the order of `blocks`."""
    tree = ast.parse(source)
    for number, (_, body) in enumerate(list(_blocks(tree)), first):
        place = 1 if _is_text(body[0]) and len(body) > 1 else 0
        body.insert(place, ast.parse(f"{SEEN}[{number}] = 1").body[0])
    heads = [k for k, one in enumerate(tree.body) if isinstance(one, ast.ImportFrom) and one.module == "__future__"]
    place = heads[-1] + 1 if heads else 1 if tree.body and _is_text(tree.body[0]) else 0
    tree.body.insert(place, ast.parse(f"from {SEEN_MODULE} import {SEEN}").body[0])
    return ast.unparse(ast.fix_missing_locations(tree))


def _blocks(node: ast.AST, owner: str = "", function: str = "") -> Iterator[tuple[Block, list[ast.stmt]]]:
    """Each block with its statements; of a function all before those of the functions in it."""
    numbers: dict[str, int] = {}
    waiting: list[tuple[ast.AST, str, str]] = [(node, owner, function)]
    while waiting:
        one, owner, function = waiting.pop(0)
        if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef):
            function = owner = f"{owner}{one.name}"
            owner += "."
        elif isinstance(one, ast.ClassDef):
            owner, function = f"{owner}{one.name}.", ""
        for name in BODIES if function else ():
            body = getattr(one, name, None)
            if isinstance(body, list) and body and isinstance(body[0], ast.stmt) and not isinstance(one, ast.With):
                number = numbers[function] = numbers.get(function, -1) + 1
                yield Block(function, number, body[0].lineno, body[-1].end_lineno or body[-1].lineno), body
        waiting += [(child, owner, function) for child in ast.iter_child_nodes(one)]


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
