"""Blocks of code, each with a mark that a copy of the tree leaves when it runs.

A block is a list of statements that run together: the body of a function, of an `if`, of an `else`, of a loop. Its name
is `module:function:number`, so that it is found again when lines above it have moved. In C files a block begins where a
line of a function ends with a brace, as this house writes C.
"""

import ast
import re
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
MARKS_IN_C = f"""/* The same from C: the file is opened when a library is loaded. */
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
static unsigned char unseen[1 << 20], *{SEEN} = unseen;
__attribute__((constructor)) static void see(void) {{
    const char *name = getenv("{SEEN_MODULE.upper()}");
    int file = name ? open(name, O_RDWR) : -1;
    void *found = file < 0 ? MAP_FAILED : mmap(0, MARKS_SIZE, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (found != MAP_FAILED) {SEEN} = found;
}}
"""
HEAD = re.compile(r"^(?![ /#}\n])[\w ]*?[ *](\w+)\([^;{}]*\{$", re.M)
"""The beginning of a C function."""
OPENED = re.compile(r"^ +(?:} )?(?:if|else|for|while|do)\b.*\{$", re.M)
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


def innermost(source: str, line: int, is_c: bool = False) -> Block | None:
    """The smallest block around a line; None outside of functions."""
    there = blocks_in_c(source) if is_c else blocks(source)
    around = [one for one in there if one.first <= line <= one.last]
    return min(around, key=lambda one: (one.last - one.first, -one.first), default=None)


def blocks_in_c(source: str) -> list[Block]:
    """The blocks of a C file in the order of the text; `last` is the line of the brace that ends one."""
    return [one for one, _ in _blocks_in_c(source)]


def marked_in_c(source: str, first: int, size: int) -> str:
    """The text of a C file whose blocks leave marks, numbered from `first`, of `size` in all."""
    for number, (_, at) in reversed(list(enumerate(_blocks_in_c(source), first))):
        source = f"{source[:at]} {SEEN}[{number}] = 1;{source[at:]}"
    head = re.match(r"(?:[ \t]*(?:/\*.*?\*/|#define \w+(?: \w+)?)?\n)*", source, re.DOTALL)
    at = head.end() if head else 0
    return source[:at] + f"#define MARKS_SIZE {size}\n" + MARKS_IN_C + source[at:]


def _blocks_in_c(source: str) -> Iterator[tuple[Block, int]]:
    """Each block with the place behind its brace."""
    for head in HEAD.finditer(source):
        end = source.find("\n}", head.end())
        opened = [one.end() for one in OPENED.finditer(source, head.end(), end)]
        for number, at in enumerate([head.end(), *opened]):
            yield Block(head[1], number, source.count("\n", 0, at) + 2, _closed(source, at)), at


def _closed(source: str, at: int) -> int:
    """The line in which a brace is closed that is opened before a place."""
    depth = 1
    for place in range(at, len(source)):
        depth += {"{": 1, "}": -1}.get(source[place], 0)
        if not depth:
            return source.count("\n", 0, place) + 1
    return source.count("\n") + 1


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
