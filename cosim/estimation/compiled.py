"""Carry a state along long signals by compiled code: the bits of `Stepwise` in a tenth of its time."""

import ctypes
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from cosim.estimation.prepare import Array
from cosim.estimation.rowwise import Stepwise
from pyfmi_models.errors import ExportError
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.platforms import host, known

WALK = """\
#include "step.h"

__attribute__((visibility("default")))
void walk(const double *columns, const double *parameters, long long rows, long long sets, double *states)
{
    double column[INPUTS], after[STATES], work[WORK];
    const double *arg[ARGUMENTS];
    double *res[RESULTS] = {after}, before[sets][STATES];
    long long integers[INTEGERS];
    for (long long n = 0; n < sets; n++)
        for (int j = 0; j < STATES; j++)
            before[n][j] = states[(n * STATES + j) * (rows + 1)] = 0.0;
    for (long long k = 0; k < rows; k++) {
        for (int i = 0; i < INPUTS; i++)
            column[i] = columns[i * rows + k];
        for (long long n = 0; n < sets; n++) {  /* none waits for another: a processor does several at once */
            arg[0] = before[n], arg[1] = column, arg[2] = parameters + n * PARAMETERS;
            step(arg, res, integers, work, 0);
            for (int j = 0; j < STATES; j++)
                before[n][j] = states[(n * STATES + j) * (rows + 1) + k + 1] = after[j];
        }
    }
}
"""
"""The loop around the step that CasADi generates; sizes come before it as macros."""


class CompiledWalk:
    """A step, next state from (state, column, parameters), given as CasADi expressions, carried along a matrix.

    It is compiled when it is first called, and found in the compiler's cache from then on. Where there is no compiler,
    or no folder for what it makes, `Stepwise` does the same.
    """

    def __init__(self, state: Any, column: Any, parameters: Any, following: Any) -> None:
        self._expressions = (state, column, parameters, following)

    def __call__(self, columns: Array, parameters: Array) -> Array:
        """Walk from zero: (inputs, rows), (sets, parameters) -> states (sets, states, rows + 1), the start included."""
        if self._compiled is None:
            return np.stack([self._interpreted(columns, one) for one in parameters])
        rows, sets = columns.shape[1], len(parameters)
        given, numbers = np.ascontiguousarray(columns, float), np.ascontiguousarray(parameters, float)
        states = np.empty((sets, self._expressions[0].numel(), rows + 1))
        self._compiled(given.ctypes.data, numbers.ctypes.data, rows, sets, states.ctypes.data)
        return states

    @cached_property
    def _interpreted(self) -> Stepwise:
        return Stepwise(*self._expressions)

    @cached_property
    def _compiled(self) -> Any:
        """The function of the library, or nothing."""
        try:
            platform = known(host())
            library = compile_shared(self._sources(), f"walk{platform.suffix}", platform.target)
            walk = ctypes.CDLL(str(library)).walk
        except (ExportError, OSError):
            return None
        walk.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_longlong, ctypes.c_longlong, ctypes.c_void_p]
        walk.restype = None
        return walk

    def _sources(self) -> dict[str, bytes]:
        state, column, parameters, following = self._expressions
        step = ca.Function("step", [state, column, parameters], [ca.cse(ca.densify(following))])
        code = ca.CodeGenerator("step.c")
        code.add(step)
        sizes = {"INPUTS": column.numel(), "STATES": state.numel(), "PARAMETERS": parameters.numel()}
        sizes |= {
            "ARGUMENTS": step.sz_arg(),
            "RESULTS": step.sz_res(),
            "INTEGERS": step.sz_iw() + 1,
            "WORK": step.sz_w() + 1,
        }
        macros = "".join(f"#define {name} {size}\n" for name, size in sizes.items())
        return {"step.h": code.dump().encode(), "walk.c": (macros + WALK).encode()}
