"""One step of RODAS4, written out for a model: what the co-simulation solver of an FMU executes.

RODAS4 is the six-stage, stiffly accurate, L-stable Rosenbrock method of order 4(3) of Hairer and Wanner, Solving
Ordinary Differential Equations II, section IV.7, in the form without matrix products:

    (1/(h gamma) I - J) U_i = f(t + alpha_i h, x + sum_j a_ij U_j) + sum_j c_ij U_j / h + h gamma_i df/dt

Written out, a zero of J costs nothing, whatever stays the same over the step is computed once, and a compiler sees the
whole step at once. The matrix is eliminated without exchange of rows: its pivots tend to 1/(h gamma) with h, so the
solver refuses a step with a small pivot and repeats it with a smaller h.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from pyfmi_models.export.arrange import arranged
from pyfmi_models.model import Scalar

GAMMA = 0.25
ALPHA = (0, 0.386, 0.21, 0.63, 1, 1)
GAMMA_TIME = (0.25, -0.1043, 0.1035, -0.03620000000000023, 0, 0)
A: tuple[tuple[float, ...], ...] = (
    (),
    (1.544,),
    (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1),
)
C: tuple[tuple[float, ...], ...] = (
    (),
    (-5.6688,),
    (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616),
    (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
)


@dataclass(frozen=True)
class _Kept:
    """Numbers that are computed once a step, and the symbols that stand for them in its stages."""

    values: list[Any] = field(default_factory=list)
    symbols: list[Any] = field(default_factory=list)

    def __call__(self, value: Any) -> Any:
        if value.is_constant():
            return value
        self.values.append(value)
        self.symbols.append(ca.SX.sym(f"k{len(self.symbols)}"))
        return self.symbols[-1]

    def each(self, column: Any) -> list[Any]:
        return [self(value) for value in _list(column)]


@dataclass(frozen=True)
class _Factors:
    """A matrix after elimination without exchange of rows; `reciprocals` are those of its pivots."""

    order: Sequence[int]
    entries: dict[tuple[int, int], Any]
    reciprocals: Any

    def solve(self, right: Sequence[Any]) -> list[Any]:
        """Substitute forwards and backwards."""
        result = list(right)
        for k, i in self._pairs():
            result[i] -= self.entries.get((i, k), 0) * result[k]
        result = [self.reciprocals[k] * value for k, value in enumerate(result)]
        for k, i in reversed(self._pairs()):
            result[k] -= self.entries.get((k, i), 0) * result[i]
        return result

    def _pairs(self) -> list[tuple[int, int]]:
        return [(k, i) for place, k in enumerate(self.order) for i in self.order[place + 1 :]]


def step_functions(rates: ca.Function, nominals: Sequence[float]) -> tuple[ca.Function, ...]:
    """Write one step from (t, x) over h as functions of which the later use what the earlier make.

    constants: t, x, u, p -> c, reciprocals of what inputs and parameters alone decide
    prepare:   t, x, u, p, c, h -> reciprocals of the pivots [s], kept numbers
    stages:    all these -> x at t + h, relative error of each state, sum of their squares, the pivots' reciprocals

    `rates` are scalar, (t, x, u, p) -> dx/dt. The error is the difference to the embedded third order, relative to the
    mean of |x| before and after plus one hundredth of the nominal value.
    """
    constants, rates = arranged(rates)
    given = {name: ca.SX.sym(name, rates.numel_in(name)) for name in rates.name_in()} | {"h": ca.SX.sym("h")}
    x, h, keep = given["x"], given["h"], _Kept()
    start = rates(*(given[name] for name in "txupc"))
    matrix, order = _eliminated(ca.SX.eye(x.numel()) / (h * GAMMA) - ca.jacobian(start, x))
    pivots, reciprocals = ca.vertcat(*(matrix.pop((k, k)) for k in range(x.numel()))), ca.SX.sym("r", x.numel())
    factors = _Factors(order, {place: keep(entry) for place, entry in matrix.items()}, reciprocals)
    last, correction = _stages(rates, given, start, factors, keep)
    end = last + correction
    error = correction / (0.5 * (ca.fabs(x) + ca.fabs(end)) + 0.01 * ca.DM(nominals))
    made = {"reciprocals": 1 / pivots, "kept": ca.vertcat(*keep.values)}
    known = {"reciprocals": reciprocals, "kept": ca.vertcat(*keep.symbols)}
    result = {"end": end, "error": error, "square": ca.sumsqr(error), "pivots": reciprocals}
    return (
        constants,
        ca.Function("prepare", given | made, [*given], [*made], {"cse": True}),
        ca.Function("stages", given | known | result, [*given, *known], [*result], {"cse": True}),
    )


def _stages(
    rates: ca.Function, given: dict[str, Scalar], start: Any, factors: _Factors, keep: _Kept
) -> tuple[Any, Any]:
    """Return the point of the last stage and the last U, whose sum is the result."""
    t, x, u, p, c, h = (given[name] for name in "txupch")
    per_h, first, by_time = keep(1 / h), keep.each(start), keep.each(h * ca.jacobian(start, t))
    stages: list[list[Any]] = []
    place = x
    for s, alpha in enumerate(ALPHA):
        place = ca.vertcat(*(_combined(state, A[s], stages, i) for i, state in enumerate(_list(x))))
        slope = _list(rates(t + alpha * h, place, u, p, c)) if s else first
        past = [per_h * _combined(0, C[s], stages, i) + GAMMA_TIME[s] * by_time[i] for i in range(len(slope))]
        stages.append(factors.solve([f + other for f, other in zip(slope, past, strict=True)]))
    return place, ca.vertcat(*stages[-1])


def _combined(start: Any, weights: Sequence[float], stages: Sequence[Sequence[Any]], i: int) -> Any:
    # The newest stage is added last: all else is ready before it.
    for weight, stage in zip(weights, stages, strict=True):
        start = start + weight * stage[i]
    return start


def _eliminated(matrix: Any) -> tuple[dict[tuple[int, int], Any], list[int]]:
    """Eliminate in an order that keeps zeros (Markowitz); rows are scaled, so that products remain for the stages.

    Of equals the later state goes first: inner states before the axis that they act on.
    """
    places = zip(*matrix.sparsity().get_triplet(), strict=True)
    entries = {place: matrix[place] for place in places}
    left, order = set(range(matrix.size1())), list[int]()
    while left:
        rows, columns = _neighbours(entries, left)
        k = min(left, key=lambda k: (len(rows[k]) * len(columns[k]), len(rows[k]) + len(columns[k]), -k))
        order.append(k)
        left.remove(k)
        for i in rows[k]:
            entries[i, k] /= entries[k, k]
            for j in columns[k]:
                entries[i, j] = entries.get((i, j), 0) - entries[i, k] * entries[k, j]
        for j in columns[k]:
            entries[k, j] /= entries[k, k]
    return entries, order


def _neighbours(entries: dict[tuple[int, int], Any], left: set[int]) -> tuple[dict[int, list[int]], ...]:
    """For each k that is left: the other rows with an entry in column k, the other columns with one in row k."""
    rows = {k: [i for i in left if i != k and (i, k) in entries] for k in left}
    columns = {k: [j for j in left if j != k and (k, j) in entries] for k in left}
    return rows, columns


def _list(column: Any) -> list[Any]:
    return [column[i] for i in range(column.numel())]
