"""One small error in the text of a module, of ten kinds: `KINDS` names them. Of C files: mutations_c.py.

What is planted is an error. What nobody can see, or what is only said, is left as it is, by rules and not by choice:
docstrings, texts, annotations, what is raised, decorators, `__all__` (they are said or declared for tools); calls that
only tell something (`SAID`); how a picture looks (`DRAWN`, `LOOKS`: a person sees it, a test does not; what is
computed for a picture is not left out); keywords that change no result (`NO_RESULT`); interfaces (a function whose
body is a docstring alone: its implementers have their own defaults); branches of other systems, which never run here.
"""

import ast
import os
import platform
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

KINDS = ("comparison", "number", "operator", "truth", "call", "sign", "index", "unit", "swap", "default")
"""A comparison turned, a number changed, an operator, a truth value or and/or, a call left out, a minus or `not` left
out, an index off by one, a factor of a thousand, two arguments swapped, a default changed."""
COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.LShift: ast.RShift,
}
SAID = ("say", "told", "put", "print", "echo", "debug", "info")
"""Calls that only tell people something."""
DRAWN = re.compile(
    r"plot|legend|grid|bar|barh|stairs|imshow|errorbar|fill_between|pcolormesh|ax[hv](line|span)|annotate|text|suptitle|"
    r"set_(title|[xy](label|lim|ticks|scale|ticklabels)|m..or_(formatter|locator)|visible)|tick_params|locator_params|"
    r"minorticks_off|invert_yaxis|margins|colorbar"
)
"""Calls that put something into a picture."""
LOOKS = re.compile(r"colou?r|alpha|lw|linewidth|fontsize|size|marker|markersize|zorder|ls|style|pad|dpi")
"""Keywords that say how something in a picture looks."""
NO_RESULT = re.compile(r"strict|indent|stacklevel|repr|maxsize|daemon|timeout|markup|highlight|show_default|help")
"""Keywords that change no result: checks of `zip` for whoever reads, shapes of texts, sizes of caches, time limits."""
COMMUTING = ("max", "min", "maximum", "minimum", "fmax", "fmin", "hypot", "gcd", "isclose", "array_equal")
"""Calls to which the order of two arguments means nothing."""
SCALES = frozenset(10.0**power for power in (-9, -6, -3, 3, 6, 9)) | {60.0, 3600.0, 180.0}
"""Numbers that turn one unit into another."""
LARGER = 1.2
"""By which a number that is no whole one is changed: a test whose tolerance hides this factor hides an error."""
Plant = Callable[[], None]


@dataclass(frozen=True)
class Site:
    """A place where an error can be planted: its line, the kind of error, and what is changed."""

    line: int
    kind: str
    change: str


def sites(source: str) -> list[Site]:
    """Every place of a module where an error can be planted, in the order of the text."""
    return [site for site, _ in _sites(ast.parse(source))]


def mutated(source: str, number: int) -> tuple[Site, str]:
    """Return a site by its number, and the text of the module with that error."""
    tree = ast.parse(source)
    site, plant = list(_sites(tree))[number]
    plant()
    return site, ast.unparse(ast.fix_missing_locations(tree))


def _sites(node: ast.AST, default: bool = False) -> Iterator[tuple[Site, Plant]]:
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list") or _is_unseen(node, name):
            continue
        children = value if isinstance(value, list) else [value]
        given = name in ("defaults", "kw_defaults") or (isinstance(node, ast.AnnAssign) and name == "value")
        for child in children:
            if isinstance(child, ast.AST):
                for kind, plant, change in _here(child, default or given, isinstance(node, ast.Subscript | ast.Slice)):
                    yield Site(child.lineno, kind, change), plant  # type: ignore[attr-defined]
                yield from _sites(child, default or given)
        if name == "body" and isinstance(value, list):
            yield from _left_out(value)


def _is_unseen(node: Any, name: str) -> bool:
    """Whether a part of the code is only said, or changes nothing that can be seen here."""
    if isinstance(node, ast.Raise | ast.JoinedStr):
        return True
    if isinstance(node, ast.keyword):
        return bool(node.arg and (LOOKS.fullmatch(node.arg) or NO_RESULT.fullmatch(node.arg)))
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        called = _called(node.value)
        in_picture = DRAWN.fullmatch(called) or (called == "set" and node.value.keywords)
        return called.startswith(SAID) or bool(in_picture)
    if isinstance(node, ast.Assign):
        return ast.unparse(node.targets[0]) == "__all__"
    if isinstance(node, ast.FunctionDef):
        return all(isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) for one in node.body)
    return isinstance(node, ast.If) and name == {True: "orelse", False: "body"}.get(_holds_here(node.test))  # type: ignore[arg-type]


def _holds_here(test: ast.expr) -> bool | None:
    """What a condition on the system or the checker of types is here; None for any other."""
    text = ast.unparse(test)
    if text == "TYPE_CHECKING":
        return False
    names = {ast.unparse(one) for one in ast.walk(test) if isinstance(one, ast.Attribute | ast.Name)}
    if not names <= {"sys", "os", "platform", "sys.platform", "os.name", "platform.machine", "platform.system"}:
        return None
    return bool(eval(text, {"sys": sys, "os": os, "platform": platform})) if names else None


def _called(call: ast.Call) -> str:
    """The last name of what is called."""
    return ast.unparse(call.func).split(".")[-1]


def _here(node: Any, default: bool, index: bool) -> Iterator[tuple[str, Plant, str]]:
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        for other in COMPARED[type(node.ops[0])]:
            yield "comparison", _setting(node, "ops", [other()]), f"{_shown(node)} -> {other.__name__}"
    elif isinstance(node, ast.BinOp) and type(node.op) in COMPUTED and not _is_text(node):
        other_op = COMPUTED[type(node.op)]
        yield "operator", _setting(node, "op", other_op()), f"{_shown(node)} -> {other_op.__name__}"
    elif isinstance(node, ast.BoolOp):
        opposite = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield "truth", _setting(node, "op", opposite), f"{_shown(node)} -> {type(opposite).__name__}"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "sign", _setting(node, "op", ast.UAdd()), f"{_shown(node)} -> without minus"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        twice = ast.UnaryOp(ast.Not(), node.operand)
        yield "sign", _setting(node, "operand", twice), f"{_shown(node)} -> without not"
    elif isinstance(node, ast.Call) and len(node.args) >= 2 and not _is_alike(node):
        yield "swap", _setting(node, "args", [node.args[1], node.args[0], *node.args[2:]]), f"{_shown(node)} -> swapped"
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        kind = "default" if default else "truth"
        yield kind, _setting(node, "value", not node.value), f"{node.value} -> {not node.value}"
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        kind = "default" if default else "index" if index else "number"
        other = changed(node.value)
        yield kind, _setting(node, "value", other), f"{node.value} -> {other}"
        if node.value in SCALES:
            yield "unit", _setting(node, "value", node.value * 1000), f"{node.value} -> {node.value * 1000}"


def changed(value: float) -> float:
    """Another number: a whole one and one more, any other and a fifth more."""
    return value + 1 if isinstance(value, int) or value == 0 else float(f"{value * LARGER:.12g}")


def _left_out(body: list[ast.stmt]) -> Iterator[tuple[Site, Plant]]:
    """Statements that are a call alone, which may be left out."""
    for place, one in enumerate(body):
        call = one.value if isinstance(one, ast.Expr) else None
        if isinstance(call, ast.Call) and not _is_unseen(one, ""):
            yield Site(one.lineno, "call", f"{_shown(one)} -> left out"), _placing(body, place)


def _setting(node: ast.AST, name: str, value: object) -> Plant:
    return lambda: setattr(node, name, value)


def _placing(body: list[ast.stmt], place: int) -> Plant:
    return lambda: body.__setitem__(place, ast.Pass())


def _is_alike(call: ast.Call) -> bool:
    """Whether the first two arguments cannot be swapped, or to no effect: the same, spread, a text or a function."""
    first, second = call.args[:2]
    if _called(call) in COMMUTING:
        return True
    no = (ast.Starred, ast.JoinedStr, ast.Lambda, ast.GeneratorExp)
    text = any(isinstance(one, ast.Constant) and isinstance(one.value, str) for one in (first, second))
    return text or isinstance(first, no) or isinstance(second, no) or ast.unparse(first) == ast.unparse(second)


def _is_text(node: ast.BinOp) -> bool:
    """Whether an operator joins texts, lists or tuples, or formats a text: with another it would not even run."""
    kinds = (ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp)
    sides = (node.left, node.right)
    return any(
        isinstance(one, kinds) or (isinstance(one, ast.Constant) and isinstance(one.value, str)) for one in sides
    )


def _shown(node: ast.AST) -> str:
    text = ast.unparse(node).replace("|", "\\|").replace("\n", " ")
    return text if len(text) <= 70 else f"{text[:67]}..."
