"""One small error in the text of a module: an operator, a number or a truth value changed, a call left out.

What is only said is left as it is: docstrings, texts, annotations, what is raised, decorators.
"""

import ast
from collections.abc import Callable, Iterator

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
SAID = ("say", "told", "put")
"""Calls that only tell people something."""
Site = tuple[ast.AST, Callable[[], None], str]


def sites(source: str) -> list[Site]:
    """Every place of a module where an error can be planted, in the order of the text."""
    return list(_sites(ast.parse(source)))


def mutated(source: str, site: int) -> tuple[int, str, str]:
    """Return the line of a site, what is changed there, and the text of the module with that error."""
    tree = ast.parse(source)
    node, plant, change = list(_sites(tree))[site]
    plant()
    return node.lineno, change, ast.unparse(ast.fix_missing_locations(tree))  # type: ignore[attr-defined]


def _sites(node: ast.AST) -> Iterator[Site]:
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list") or isinstance(node, ast.Raise | ast.JoinedStr):
            continue
        children = value if isinstance(value, list) else [value]
        for child in children:
            if isinstance(child, ast.AST):
                yield from _here(child)
                yield from _sites(child)
        if name == "body" and isinstance(value, list):
            yield from _left_out(value)


def _here(node: ast.AST) -> Iterator[Site]:
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        for other in COMPARED[type(node.ops[0])]:
            yield node, _setting(node, "ops", [other()]), f"{_shown(node)} -> {other.__name__}"
    elif isinstance(node, ast.BinOp) and type(node.op) in COMPUTED and not _is_text(node):
        other_op = COMPUTED[type(node.op)]
        yield node, _setting(node, "op", other_op()), f"{_shown(node)} -> {other_op.__name__}"
    elif isinstance(node, ast.BoolOp):
        opposite = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield node, _setting(node, "op", opposite), f"{_shown(node)} -> {type(opposite).__name__}"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield node, _setting(node, "op", ast.UAdd()), f"{_shown(node)} -> without minus"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        twice = ast.UnaryOp(ast.Not(), node.operand)
        yield node, _setting(node, "operand", twice), f"{_shown(node)} -> without not"
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield node, _setting(node, "value", not node.value), f"{node.value} -> {not node.value}"
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield node, _setting(node, "value", node.value + 1), f"{node.value} -> {node.value + 1}"


def _left_out(body: list[ast.stmt]) -> Iterator[Site]:
    """Statements that are a call alone, which may be left out."""
    for place, one in enumerate(body):
        call = one.value if isinstance(one, ast.Expr) else None
        if isinstance(call, ast.Call) and not ast.unparse(call.func).split(".")[-1].startswith(SAID):
            yield one, _placing(body, place), f"{_shown(one)} -> left out"


def _setting(node: ast.AST, name: str, value: object) -> Callable[[], None]:
    return lambda: setattr(node, name, value)


def _placing(body: list[ast.stmt], place: int) -> Callable[[], None]:
    return lambda: body.__setitem__(place, ast.Pass())


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
