"""Evaluate a CasADi expression at every row of long signals, fast."""

from typing import Any

import casadi as ca
import numpy as np

from cosim.diagnosis.prepare import Array

CHUNK = 512
"""Rows evaluated at once: keeps memory flat, and one mapped function serves every length."""


class Rowwise:
    """A function of (column, parameters), given as CasADi expressions, evaluated at every column of a matrix."""

    def __init__(self, column: Any, parameters: Any, result: Any) -> None:
        # The buffer interface reads and writes NumPy's own memory; passing arrays costs more than evaluating them.
        function = ca.Function("row", [column, parameters], [ca.densify(result)])
        self._map = function.map("rows", "serial", CHUNK, [1], [])
        self._buffer, self._evaluate = self._map.buffer()
        self._given = np.zeros((CHUNK, function.size1_in(0)))
        self._parameters = np.zeros(function.size1_in(1))
        self._out = np.zeros((CHUNK, function.size1_out(0)))
        self._buffer.set_arg(0, memoryview(self._given))  # type: ignore[call-arg, arg-type]
        self._buffer.set_arg(1, memoryview(self._parameters))  # type: ignore[call-arg, arg-type]
        self._buffer.set_res(0, memoryview(self._out))  # type: ignore[call-arg, arg-type]

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
