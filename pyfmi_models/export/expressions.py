"""Equations as text: a CasADi function as a graph of operations, and its parts as expressions that a person reads."""

import re
from collections.abc import Container, Iterable
from dataclasses import dataclass
from math import pi
from typing import Protocol

import casadi as ca

from pyfmi_models.errors import ExportError

OPEN, LOGIC, NOT, RELATION, SUM, PRODUCT, POWER, ATOM = range(8)
"""How tightly an expression holds together, from `if` to a name."""


@dataclass(frozen=True, eq=False)
class Node:
    """One operation; `place` is (argument, entry) of an input, `value` that of a constant."""

    operation: int
    arguments: tuple["Node", ...] = ()
    value: float = 0.0
    place: tuple[int, int] = (-1, -1)

    @property
    def constant(self) -> bool:
        """A number, whatever it is called."""
        return self.operation == ca.OP_CONST


def graph_of(function: ca.Function) -> list[list[Node]]:
    """Return the entries of each result of a function; equal expressions are one node."""
    point = function.sx_in()
    plain = ca.Function("plain", point, [ca.densify(result) for result in function.call(point)])
    known: dict[tuple[object, ...], Node] = {}
    work: dict[int, Node] = {}
    results: list[dict[int, Node]] = [{} for _ in range(plain.n_out())]
    for index in range(plain.n_instructions()):
        operation, given = plain.instruction_id(index), plain.instruction_input(index)
        target = plain.instruction_output(index)
        if operation == ca.OP_OUTPUT:
            results[target[0]][target[1]] = work[given[0]]
            continue
        place = (given[0], given[1]) if operation == ca.OP_INPUT else (-1, -1)
        value = plain.instruction_constant(index) if operation == ca.OP_CONST else 0.0
        parts = () if operation in (ca.OP_INPUT, ca.OP_CONST) else tuple(work[one] for one in given)
        key = (operation, *map(id, parts), value, place)
        work[target[0]] = known.setdefault(key, Node(operation, parts, value, place))
    return [[entries[k] for k in sorted(entries)] for entries in results]


def under(nodes: Iterable[Node], stop: Container[Node] = ()) -> list[Node]:
    """List nodes and all that they are made of, each once, parts before wholes; not beyond those in `stop`."""
    found: dict[Node, None] = {}
    waiting = [(node, False) for node in reversed(list(nodes))]
    while waiting:
        node, done = waiting.pop()
        if done:
            found[node] = None
        elif node not in found and node not in stop:
            waiting.append((node, True))
            waiting += [(one, False) for one in reversed(node.arguments)]
    return list(found)


class Names(Protocol):
    """Which nodes have a name, and what it is."""

    def __contains__(self, node: object) -> bool:
        """Say whether a node has a name."""

    def __getitem__(self, node: Node) -> str:
        """Return the name of a node."""


class Writer:
    """Writes nodes as Modelica expressions; `names` are the nodes that have one.

    Rounding may differ in the last bit from the C of an FMU, because sums and products lose their brackets.
    """

    def __init__(self, names: Names) -> None:
        self.names = names

    def text(self, node: Node) -> str:
        """Write what a node is, even where it has a name."""
        return self._written(node)[0]

    def part(self, node: Node, level: int) -> str:
        """Write a node as part of an expression that holds together at `level`."""
        text, own = (self.names[node], ATOM) if node in self.names else self._written(node)
        return text if own >= level else f"({text})"

    def _written(self, node: Node) -> tuple[str, int]:
        if node.constant:
            return _number(node.value)
        for rule in (self._choice, self._power, self._function, self._infix, self._special):
            found = rule(node)
            if found is not None:
                return found
        raise ExportError(f"{_operation(node)} cannot be written in Modelica")

    def _choice(self, node: Node) -> tuple[str, int] | None:
        """CasADi writes `if c then a else b` as two products with a truth value that add up."""
        if node.operation == ca.OP_IF_ELSE_ZERO:
            return self._if(node, _ZERO), OPEN
        if node.operation == ca.OP_ADD and all(one.operation == ca.OP_IF_ELSE_ZERO for one in node.arguments):
            yes, no = node.arguments
            other = no.arguments[0]
            if other.operation == ca.OP_NOT and other.arguments[0] is yes.arguments[0]:
                return self._if(yes, no.arguments[1]), OPEN
        return None

    def _if(self, yes: Node, no: Node) -> str:
        condition, value = yes.arguments
        return f"if {self.part(condition, LOGIC)} then {self.part(value, LOGIC)} else {self.part(no, LOGIC)}"

    def _power(self, node: Node) -> tuple[str, int] | None:
        base, exponent = self._raised(node)
        return None if base is None else (f"{self.part(base, ATOM)}^{self.part(exponent, ATOM)}", POWER)

    def _raised(self, node: Node) -> tuple[Node | None, Node]:
        """Base and exponent of a power: also x x^2, and exp(y log x), which keeps derivatives finite in C."""
        parts = node.arguments
        if node.operation in (ca.OP_POW, ca.OP_CONSTPOW):
            return parts[0], parts[1]
        if node.operation == ca.OP_SQ:
            return parts[0], _TWO
        if node.operation == ca.OP_MUL:
            for one, square in (parts, parts[::-1]):
                if square.operation == ca.OP_SQ and square.arguments[0] is one and square not in self.names:
                    return one, _THREE
        if (
            node.operation == ca.OP_EXP
            and parts[0].operation in (ca.OP_MUL, ca.OP_TWICE)
            and parts[0] not in self.names
        ):
            factors = (_TWO, *parts[0].arguments)[-2:]
            for exponent, logarithm in (factors, factors[::-1]):
                if logarithm.operation == ca.OP_LOG and logarithm not in self.names:
                    return logarithm.arguments[0], exponent
        return None, node

    def _function(self, node: Node) -> tuple[str, int] | None:
        name = _FUNCTIONS.get(node.operation)
        return None if name is None else (f"{name}({', '.join(self.part(one, OPEN) for one in node.arguments)})", ATOM)

    def _infix(self, node: Node) -> tuple[str, int] | None:
        if node.operation not in _INFIX:
            return None
        sign, level, left, right = _INFIX[node.operation]
        one, other = node.arguments
        if level == RELATION and one.constant and not other.constant:
            one, other, sign = other, one, _TURNED[sign]
        if node.operation == ca.OP_ADD and other not in self.names:
            without = _without_minus(other)
            sign, other, right = ("-", without, PRODUCT) if without else (sign, other, right)
        gap = "" if level == PRODUCT else " "
        return f"{self.part(one, left)}{gap}{sign}{gap}{self.part(other, right)}", level

    def _special(self, node: Node) -> tuple[str, int] | None:
        rule = _SPECIAL.get(node.operation)
        if rule is None:
            return None
        shape, level, inner = rule
        return shape.format(self.part(node.arguments[0], inner)), level


def _without_minus(node: Node) -> Node | None:
    """Return what a node is the negative of, where that can be seen."""
    if node.operation == ca.OP_NEG:
        return node.arguments[0]
    first = node.arguments[0] if node.operation == ca.OP_MUL else node
    if not first.constant or first.value >= 0:
        return None
    positive = Node(ca.OP_CONST, value=-first.value)
    return positive if first is node else Node(ca.OP_MUL, (positive, node.arguments[1]))


def number_text(value: float) -> str:
    """Write a number so that it is read back exactly, as short as that goes."""
    if value == int(value) and abs(value) < 1e5:
        return str(int(value))
    return re.sub(r"(\.0)?e([+-])0?", lambda found: "e" + found[2].strip("+"), repr(float(value)))


def _number(value: float) -> tuple[str, int]:
    """Write a number, simple multiples of pi by that name."""
    if value < 0:
        return f"-{_number(-value)[0]}", SUM
    for factor, name in ((1, "pi"), (2, "2*pi"), (4, "4*pi"), (0.5, "pi/2")):
        if value == factor * pi:
            return name, ATOM if factor == 1 else PRODUCT
    return number_text(value), ATOM


def _operation(node: Node) -> str:
    return next((name for name in dir(ca) if name.startswith("OP_") and getattr(ca, name) == node.operation), "?")


_ZERO, _TWO, _THREE = (Node(ca.OP_CONST, value=value) for value in (0.0, 2.0, 3.0))
_NAMED = "sin cos tan asin acos atan atan2 sinh cosh tanh exp log sqrt sign floor ceil"
_FUNCTIONS = {getattr(ca, f"OP_{name.upper()}"): name for name in _NAMED.split()}
_FUNCTIONS |= {ca.OP_FABS: "abs", ca.OP_FMIN: "min", ca.OP_FMAX: "max"}
_INFIX = {
    ca.OP_ADD: ("+", SUM, SUM, SUM),
    ca.OP_SUB: ("-", SUM, SUM, PRODUCT),
    ca.OP_MUL: ("*", PRODUCT, PRODUCT, PRODUCT),
    ca.OP_DIV: ("/", PRODUCT, PRODUCT, POWER),
    ca.OP_LT: ("<", RELATION, SUM, SUM),
    ca.OP_LE: ("<=", RELATION, SUM, SUM),
    ca.OP_EQ: ("==", RELATION, SUM, SUM),
    ca.OP_NE: ("<>", RELATION, SUM, SUM),
    ca.OP_AND: ("and", LOGIC, NOT, NOT),
    ca.OP_OR: ("or", LOGIC, NOT, NOT),
}
"""Sign, and how tightly the whole, its left and its right part hold together."""
_TURNED = {"<": ">", "<=": ">=", "==": "==", "<>": "<>"}
_SPECIAL = {
    ca.OP_NEG: ("-{}", SUM, PRODUCT),
    ca.OP_TWICE: ("2*{}", PRODUCT, PRODUCT),
    ca.OP_INV: ("1/{}", PRODUCT, POWER),
    ca.OP_NOT: ("not {}", NOT, RELATION),
    ca.OP_LOG1P: ("log(1 + {})", ATOM, SUM),
    ca.OP_EXPM1: ("exp({}) - 1", SUM, OPEN),
}
"""Shape, how tightly it holds together, and how tightly its part must."""
