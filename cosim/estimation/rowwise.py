"""Evaluate a CasADi expression at every row of long signals, or carry a state along them, fast."""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg.lapack import dtbtrs

from cosim.estimation.prepare import Array

CHUNK = 8192
"""Rows evaluated at once: an intermediate result of so many stays in the cache."""
STRIDE = 64
"""Steps written out one after the other: calling a step takes longer than doing it."""
OPERATIONS: dict[int, Callable[..., Any]] = {
    ca.OP_ASSIGN: lambda x: x,
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_LOG1P: np.log1p,
    ca.OP_EXPM1: np.expm1,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_SQRT: np.sqrt,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda x: 2 * x,
    ca.OP_INV: np.reciprocal,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin,
    ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_SINH: np.sinh,
    ca.OP_COSH: np.cosh,
    ca.OP_TANH: np.tanh,
    ca.OP_HYPOT: np.hypot,
    ca.OP_LT: lambda x, y: 1.0 * (x < y),
    ca.OP_LE: lambda x, y: 1.0 * (x <= y),
    ca.OP_EQ: lambda x, y: 1.0 * (x == y),
    ca.OP_NE: lambda x, y: 1.0 * (x != y),
    ca.OP_NOT: lambda x: 1.0 * (x == 0),
    ca.OP_AND: lambda x, y: 1.0 * ((x != 0) & (y != 0)),
    ca.OP_OR: lambda x, y: 1.0 * ((x != 0) | (y != 0)),
    ca.OP_IF_ELSE_ZERO: lambda x, y: np.where(x != 0, y, 0.0),
    ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil,
    ca.OP_FMOD: np.fmod,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: np.sign,
    ca.OP_COPYSIGN: np.copysign,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
}
"""What each operation of a CasADi expression is on whole rows."""


class Rowwise:
    """A function of (column, parameters), given as CasADi expressions, evaluated at every column of a matrix.

    The expression is walked once for `CHUNK` columns: one operation on many columns costs a fifth of many on one.
    Raises KeyError for an operation that is not in `OPERATIONS`.
    """

    def __init__(self, column: Any, parameters: Any, result: Any) -> None:
        function = ca.Function("row", [column, parameters], [ca.cse(ca.densify(result))])
        self._size, self._outputs = function.sz_w(), function.size1_out(0)
        self._program = [_instruction(function, k) for k in range(function.n_instructions())]

    def __call__(self, columns: Sequence[Array] | Array, parameters: Array) -> Array:
        """Evaluate: inputs of shape (rows,) each and (parameters,) -> (outputs, rows)."""
        rows = len(columns[0])
        out, numbers = np.empty((self._outputs, rows)), [np.float64(one) for one in parameters]
        with np.errstate(all="ignore"):  # both sides of a choice are evaluated, whatever the other one is
            for first in range(0, rows, CHUNK):
                part = slice(first, first + CHUNK)
                self._walk(([one[part] for one in columns], numbers), out[:, part])
        return out

    def _walk(self, given: tuple[list[Array], list[np.float64]], out: Array) -> None:
        work: list[Any] = [None] * self._size
        for code, target, sources, operation in self._program:
            if operation:
                work[target] = operation(*[work[source] for source in sources])
            elif code == ca.OP_INPUT:
                work[target] = given[sources[0]][sources[1]]
            elif code == ca.OP_OUTPUT:
                out[target] = work[sources[0]]
            else:
                work[target] = sources[0]


def _instruction(function: ca.Function, k: int) -> tuple[int, int, list[Any], Callable[..., Any] | None]:
    """Code, target, sources and operation of an instruction; the source of a constant is the constant."""
    code, target, sources = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
    if code == ca.OP_CONST:
        return code, target[0], [np.float64(function.instruction_constant(k))], None
    if code == ca.OP_INPUT:
        return code, target[0], list(sources), None
    if code == ca.OP_OUTPUT:
        return code, target[1], list(sources), None
    return code, target[0], list(sources), OPERATIONS[code]


class Stepwise:
    """A step, next state from (state, column, parameters), given as CasADi expressions, carried along a matrix."""

    def __init__(self, state: Any, column: Any, parameters: Any, following: Any) -> None:
        step = ca.Function("step", [state, column, parameters], [ca.densify(following)])
        columns, last, states = ca.SX.sym("columns", column.numel(), STRIDE), state, []
        for one in ca.horzsplit(columns):
            last = step(last, one, parameters)
            states.append(last)
        strides = ca.Function("steps", [state, columns, parameters], [ca.horzcat(*states)])
        self._start, self._parameters = np.zeros(state.numel()), np.zeros(parameters.numel())
        self._given, self._out = np.zeros((STRIDE, column.numel())), np.zeros((STRIDE, state.numel()))
        self._buffer, self._evaluate = _bound(strides, (self._start, self._given, self._parameters), self._out)

    def __call__(self, columns: Array, parameters: Array) -> Array:
        """Walk from zero: (inputs, rows) and (parameters,) -> states (states, rows + 1), the start among them."""
        self._parameters[:], self._start[:] = parameters, 0.0
        rows, strides = columns.shape[1], -(-columns.shape[1] // STRIDE)
        given, out = np.zeros((strides * STRIDE, len(columns))), np.zeros((strides * STRIDE + 1, len(self._start)))
        given[:rows] = columns.T
        befores, afters = given.reshape(strides, *self._given.shape), out[1:].reshape(strides, *self._out.shape)
        for before, after in zip(befores, afters, strict=True):
            self._given[:] = before
            self._evaluate()
            after[:], self._start[:] = self._out, self._out[-1]
        return out[: rows + 1].T


def _bound(function: ca.Function, given: tuple[Array, ...], out: Array) -> tuple[Any, Callable[[], Any]]:
    """Bind a function to NumPy's own memory; passing arrays costs more than evaluating them. Keep the buffer alive."""
    buffer, evaluate = function.buffer()
    for index, array in enumerate(given):
        buffer.set_arg(index, memoryview(array))  # type: ignore[call-arg, arg-type]
    buffer.set_res(0, memoryview(out))  # type: ignore[call-arg, arg-type]
    return buffer, evaluate


def recurrence(decay: Array, drift: Array) -> Array:
    """Solve y[k+1] = decay[k] y[k] + drift[k], y[0] = 0, for every column of drift."""
    rows = len(decay) + 1
    band, right = np.ones((2, rows), order="F"), np.zeros((rows, drift.shape[1]), order="F")
    band[1, :-1], right[1:] = -decay, drift
    if not right.size:  # LAPACK's wrapper is not safe with nothing to solve for
        return right
    solution: Array = dtbtrs(band, right, uplo="L", diag="U", overwrite_b=True)[0]
    return solution
