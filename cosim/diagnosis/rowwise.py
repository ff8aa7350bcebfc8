"""Evaluate a CasADi expression at every row of long signals, or carry a state along them, fast."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from cosim.diagnosis.prepare import Array

CHUNK = 512
"""Rows evaluated at once: keeps memory flat, and one mapped function serves every length."""
STRIDE = 64
"""Steps written out one after the other: calling a step takes longer than doing it."""


class Rowwise:
    """A function of (column, parameters), given as CasADi expressions, evaluated at every column of a matrix."""

    def __init__(self, column: Any, parameters: Any, result: Any) -> None:
        function = ca.Function("row", [column, parameters], [ca.densify(result)])
        self._given = np.zeros((CHUNK, function.size1_in(0)))
        self._parameters = np.zeros(function.size1_in(1))
        self._out = np.zeros((CHUNK, function.size1_out(0)))
        mapped = function.map("rows", "serial", CHUNK, [1], [])
        self._buffer, self._evaluate = _bound(mapped, (self._given, self._parameters), self._out)

    def __call__(self, columns: Array, parameters: Array) -> Array:
        """Evaluate: (inputs, rows) and (parameters,) -> (outputs, rows)."""
        self._parameters[:] = parameters
        out = np.empty((columns.shape[1], self._out.shape[1]))
        for first in range(0, len(out), CHUNK):
            count = min(CHUNK, len(out) - first)
            self._given[:count] = columns[:, first : first + count].T
            self._evaluate()
            out[first : first + count] = self._out[:count]
        return out.T


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
        out = np.zeros((columns.shape[1] + 1, len(self._start)))
        for first in range(0, columns.shape[1], STRIDE):
            count = min(STRIDE, columns.shape[1] - first)
            self._given[:count] = columns[:, first : first + count].T
            self._evaluate()
            out[first + 1 : first + count + 1] = self._out[:count]
            self._start[:] = self._out[-1]
        return out.T


def _bound(function: ca.Function, given: tuple[Array, ...], out: Array) -> tuple[Any, Callable[[], Any]]:
    """Bind a function to NumPy's own memory; passing arrays costs more than evaluating them. Keep the buffer alive."""
    buffer, evaluate = function.buffer()
    for index, array in enumerate(given):
        buffer.set_arg(index, memoryview(array))  # type: ignore[call-arg, arg-type]
    buffer.set_res(0, memoryview(out))  # type: ignore[call-arg, arg-type]
    return buffer, evaluate
