"""Equations in the order in which a processor is done with them first.

A step of the solver is one long chain: each stage waits for the one before. So what inputs and parameters alone decide
is divided by once, as a reciprocal, and sums take their slowest term last. Both change a result by rounding only.
"""

from collections import Counter
from dataclasses import dataclass
from typing import Any

import casadi as ca

_SLOW = {ca.OP_DIV: 4, ca.OP_INV: 4, ca.OP_SQRT: 5}
_FUNCTIONS = (ca.OP_EXP, ca.OP_LOG, ca.OP_POW, ca.OP_SIN, ca.OP_COS, ca.OP_TANH)
_DELAY = dict.fromkeys(_FUNCTIONS, 15) | _SLOW
"""How long an operation takes, in additions; 1 where not listed."""


@dataclass(frozen=True)
class _Value:
    """An expression, when it is ready after the states are (0: before them), and what it is a sum of."""

    expression: Any
    ready: int
    terms: tuple["tuple[_Value, int]", ...] = ()


def arranged(rates: ca.Function) -> tuple[ca.Function, ca.Function]:
    """Arrange scalar `rates`, (t, x, u, p) -> dx/dt.

    Return (t, x, u, p) -> c, the reciprocals, and (t, x, u, p, c) -> dx/dt.
    """
    point = {name: ca.SX.sym(name, rates.size1_in(i)) for i, name in enumerate("txup")}
    arranger = _Arranger(rates, list(point.values()))
    results = arranger.results()
    values, c = (ca.vertcat(*part) for part in (arranger.reciprocals, arranger.symbols))
    given = list(point.values())
    return (
        ca.Function("constants", given, [values], [*point], ["c"], {"cse": True}),
        ca.Function("rates", [*given, c], [results], [*point, "c"], ["rates"], {"cse": True}),
    )


class _Arranger:
    """Rebuilds the results of a function from its operations."""

    def __init__(self, function: ca.Function, point: list[Any]) -> None:
        self.function, self.point = function, point
        self.reciprocals: list[Any] = []
        self.symbols: list[Any] = []
        self.work: dict[int, _Value] = {}

    def results(self) -> Any:
        column, once = ca.SX(self.function.size1_out(0), 1), _used_once(self.function)
        for k in range(self.function.n_instructions()):
            code, places, (to, *entry) = _instruction(self.function, k)
            if code == ca.OP_OUTPUT:
                column[entry[0]] = self.work[places[0]].expression
            else:
                value = self._value(k, code, places)
                self.work[to] = value if k in once else _Value(value.expression, value.ready)
        return column

    def _value(self, k: int, code: int, places: list[int]) -> _Value:
        if code == ca.OP_INPUT:
            return _Value(self.point[places[0]][places[1]], int(places[0] < 2))
        if code == ca.OP_CONST:
            return _Value(ca.SX(self.function.instruction_constant(k)), 0)
        operands = [self.work[place] for place in places]
        if code in _SIGNS:
            return _sum([term for one, sign in zip(operands, _SIGNS[code], strict=True) for term in _terms(one, sign)])
        ready = max(one.ready for one in operands)
        if code == ca.OP_DIV and operands[1].ready == 0 < ready:
            return _Value(operands[0].expression * self._reciprocal(operands[1].expression), ready + 1)
        make = ca.SX.unary if len(operands) == 1 else ca.SX.binary
        return _Value(make(code, *(one.expression for one in operands)), ready and ready + _DELAY.get(code, 1))

    def _reciprocal(self, divisor: Any) -> Any:
        if divisor.is_constant():
            return 1 / divisor
        self.reciprocals.append(1 / divisor)
        self.symbols.append(ca.SX.sym(f"c{len(self.symbols)}"))
        return self.symbols[-1]


_SIGNS = {ca.OP_ADD: (1, 1), ca.OP_SUB: (1, -1), ca.OP_NEG: (-1,)}


def _terms(value: _Value, sign: int) -> list[tuple[_Value, int]]:
    return [(one, sign * its) for one, its in value.terms] or [(value, sign)]


def _sum(terms: list[tuple[_Value, int]]) -> _Value:
    """Add up, slowest last; of equally fast ones a positive one first."""
    ordered = sorted(terms, key=lambda term: (term[0].ready, -term[1]))
    (first, sign), *others = ordered
    total, ready = first.expression if sign > 0 else -first.expression, first.ready
    for one, sign in others:
        total = total + one.expression if sign > 0 else total - one.expression
        ready = max(ready, one.ready) and max(ready, one.ready) + 1
    return _Value(total, ready, tuple(ordered))


def _used_once(function: ca.Function) -> set[int]:
    """Operations whose result is used by one other operation only."""
    made: dict[int, int] = {}
    uses: Counter[int] = Counter()
    for k in range(function.n_instructions()):
        code, places, (to, *_) = _instruction(function, k)
        if code != ca.OP_INPUT:
            uses.update(made[place] for place in places)
        if code != ca.OP_OUTPUT:
            made[to] = k
    return {k for k, count in uses.items() if count == 1}


def _instruction(function: ca.Function, k: int) -> tuple[int, list[int], list[int]]:
    return function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
