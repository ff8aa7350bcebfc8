"""Evaluate a CasADi expression at every row of long signals, or carry a state along them, fast."""

from collections.abc import Callable, Sequence
from ctypes import byref, c_void_p
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dtbtrs

from cosim.estimation.kernels import CTape, done, library
from cosim.estimation.prepare import Array

CHUNK = 8192
"""Rows evaluated at once by NumPy: an intermediate result of so many stays in the cache."""
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
"""What each operation of a CasADi expression is on whole rows; `tape.c` has them in this order."""
CODES = {operation: code for code, operation in enumerate(OPERATIONS)}
CODES[ca.OP_CONSTPOW] = CODES[ca.OP_POW]
ON_ROWS = tuple(OPERATIONS.values())
Operations = npt.NDArray[np.int32]
"""Code, target and two operands of each operation: registers, or below zero numbers that all rows share (~index)."""


class Tape(NamedTuple):
    """An expression as operations on registers: the inputs, so many slots for work, the outputs, in this order."""

    shared: Operations
    """Operations on what all rows share."""
    rowwise: Operations
    numbers: Array
    """What all rows share: constants, parameters, and what follows from both."""
    parameters: npt.NDArray[np.int64]
    """Which parameter goes where among the numbers: (2, places)."""
    inputs: int
    slots: int
    outputs: int

    @classmethod
    def of(cls, column: Any, parameters: Any, result: Any) -> "Tape":
        """The tape of a result in terms of a column and parameters, given as CasADi expressions.

        Raises KeyError for an operation that is not in `OPERATIONS`.
        """
        function = ca.Function("row", [column, parameters], [ca.cse(ca.densify(result))])
        inputs, slots = function.size1_in(0), function.sz_w()
        at, numbers, places = dict[int, int](), list[float](), list[tuple[int, int]]()
        shared, rowwise = list[tuple[int, ...]](), list[tuple[int, ...]]()
        for k in range(function.n_instructions()):
            code, sources = function.instruction_id(k), function.instruction_input(k)
            target = function.instruction_output(k)
            if code == ca.OP_INPUT and sources[0] == 0:
                at[target[0]] = sources[1]
                continue
            operands = [] if code in (ca.OP_INPUT, ca.OP_CONST) else [at[one] for one in sources]
            ends = [CODES.get(code, 0), *operands[:1], *operands[-1:]]
            if code == ca.OP_OUTPUT:
                rowwise.append((CODES[ca.OP_ASSIGN], inputs + slots + target[1], *ends[1:]))
            elif any(one >= 0 for one in operands):
                at[target[0]] = inputs + target[0]
                rowwise.append((CODES[code], at[target[0]], *ends[1:]))
            else:
                at[target[0]] = ~len(numbers)
                numbers.append(function.instruction_constant(k) if code == ca.OP_CONST else 0.0)
                if code == ca.OP_INPUT:
                    places.append((len(numbers) - 1, sources[1]))
                elif operands:
                    shared.append((CODES[code], at[target[0]], *ends[1:]))
        return cls(
            np.array(shared, np.int32).reshape(-1, 4),
            np.array(rowwise, np.int32).reshape(-1, 4),
            np.array(numbers),
            np.array(places, np.int64).reshape(-1, 2).T,
            inputs,
            slots,
            function.size1_out(0),
        )

    def dumped(self) -> tuple[Any, ...]:
        """Bytes and whole numbers."""
        return (*(one.tobytes() for one in self[:4]), *self[4:])

    @classmethod
    def loaded(cls, dumped: Sequence[Any]) -> "Tape":
        """What was dumped."""
        shared, rowwise = (np.frombuffer(one, np.int32).reshape(-1, 4) for one in dumped[:2])
        places = np.frombuffer(dumped[3], np.int64).reshape(2, -1)
        return cls(shared, rowwise, np.frombuffer(dumped[2]), places, *dumped[4:])


class Rowwise:
    """A function of (column, parameters), evaluated at every column of a matrix.

    One operation on many columns costs a fifth of many on one, and in C a third of that in NumPy.
    """

    def __init__(self, tape: Tape) -> None:
        counts = len(tape.shared), len(tape.rowwise), tape.inputs, tape.slots, tape.outputs
        addresses = tape.shared.ctypes.data, tape.rowwise.ctypes.data
        self._tape, self._as_c = tape, CTape(*addresses, *counts, tape.inputs + tape.slots + tape.outputs)

    def __call__(self, columns: Sequence[Array] | Array, parameters: Array) -> Array:
        """Evaluate: inputs of shape (rows,) each and (parameters,) -> (outputs, rows)."""
        numbers, rows = self._tape.numbers.copy(), len(columns[0])
        if len(columns) != self._tape.inputs or any(len(one) != rows for one in columns):
            lengths = ", ".join(str(len(one)) for one in columns)
            raise ValueError(f"a tape of {self._tape.inputs} columns was given columns of {lengths} rows")
        places, which = self._tape.parameters
        numbers[places] = np.asarray(parameters, float)[which]
        out, kernels = np.empty((self._tape.outputs, rows)), library()
        if kernels is None:
            _on_rows(self._tape, numbers, [*columns], out)
            return out
        given = [np.ascontiguousarray(one, float) for one in columns]
        at = (c_void_p * len(given))(*(one.__array_interface__["data"][0] for one in given))
        done(kernels.tape_run(byref(self._as_c), numbers.ctypes.data, at, rows, out.ctypes.data))
        return out


def _on_rows(tape: Tape, numbers: Array, columns: Sequence[Array], out: Array) -> None:
    """What `tape_run` does, by NumPy."""
    with np.errstate(all="ignore"):  # both sides of a choice are evaluated, whatever the other one is
        for code, target, *operands in tape.shared.tolist():
            numbers[~target] = _operated(code, [numbers[~one] for one in operands])
        work: list[Any] = [None] * (tape.inputs + tape.slots + tape.outputs)
        for first in range(0, out.shape[1], CHUNK):
            part = slice(first, first + CHUNK)
            work[: tape.inputs] = [one[part] for one in columns]
            work[tape.inputs + tape.slots :] = out[:, part]
            for code, target, *operands in tape.rowwise.tolist():
                found = _operated(code, [work[one] if one >= 0 else numbers[~one] for one in operands])
                if target >= tape.inputs + tape.slots:
                    work[target][:] = found
                else:
                    work[target] = found


def _operated(code: int, operands: list[Any]) -> Any:
    operation = ON_ROWS[code]
    many = operation.nin if isinstance(operation, np.ufunc) else operation.__code__.co_argcount
    return operation(*operands[:many])


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


def recurrence(keeps: Array, adds: Array) -> Array:
    """Solve y[k + 1] = keeps[k] y[k] + adds[k], y[0] = 0: (rows,) and (signals, rows) -> (signals, rows + 1)."""
    signals, rows = adds.shape
    kernels = library()
    if kernels is not None:
        out = np.empty((signals, rows + 1))
        keeps, adds = np.ascontiguousarray(keeps), np.ascontiguousarray(adds)
        done(kernels.recurrence_run(keeps.ctypes.data, adds.ctypes.data, signals, rows, out.ctypes.data))
        return out
    band, right = np.ones((2, rows + 1), order="F"), np.zeros((rows + 1, signals), order="F")
    band[1, :-1], right[1:] = -keeps, adds.T
    if not right.size:  # LAPACK's wrapper is not safe with nothing to solve for
        return right.T
    return np.asarray(dtbtrs(band, right, uplo="L", diag="U", overwrite_b=True)[0].T)
