"""Simulate a plant under a recorded reference, with exact derivatives by its parameters, in compiled C.

    closed loop   the recorded set point drives plant and controller, with the tick of delay of the co-simulation
    open loop     the recorded torque drives the plant: for moves that friction holds, where replay does not diverge

The plant's equations advance by ROS3P, a third-order, A-stable Rosenbrock method; what is differentiated is the
discrete step itself, so the derivatives are those of the simulation. Reference: Lang and Verwer, BIT 41 (2001) 731.
"""

import ctypes
from dataclasses import dataclass
from functools import cached_property
from math import ceil, sqrt
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from pyfmi_models.export.build import FLAGS, compile_shared
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.model import Model

Array = npt.NDArray[np.float64]
OUTPUTS = ("q", "tau")
LONGEST_SUBSTEP = 1e-4
"""The plant is stepped at least this often [s]; 1e-3 of the error that encoder noise makes, at 40 deg/s."""


@dataclass(frozen=True)
class Machine:
    """A plant, a controller or none, and the names of the plant parameters that are free; `tick` in s."""

    plant: Model
    controller: Model | None
    free: tuple[str, ...]
    tick: float

    @property
    def references(self) -> tuple[str, ...]:
        """What `run` is fed in every tick: the set point and its derivatives, or the torque."""
        return ("q_d", "v_d", "a_d") if self.controller else ("tau",)

    @cached_property
    def numbers(self) -> Array:
        """Present values of all plant parameters."""
        return np.array([variable.start for variable in self.plant.parameters])

    @cached_property
    def places(self) -> list[int]:
        """Where the free parameters are among all of the plant."""
        names = [variable.name for variable in self.plant.parameters]
        return [names.index(name) for name in self.free]

    def run(self, values: Array, reference: Array, start: dict[str, float]) -> tuple[Array, Array]:
        """Simulate from a start; arguments as of `simulate`.

        Returns:
            Position at the start of each tick [rad] and torque that acts during it [N m], shape (ticks, 2), and their
            derivatives, shape (ticks, 2, free).
        """
        both = self.simulate(values, reference, start)
        return both[:, 0], both[:, 1:].transpose(0, 2, 1)

    def simulate(self, values: Array, reference: Array, start: dict[str, float]) -> Array:
        """Simulate from a start.

        Args:
            values: the free parameters, shape (free,).
            reference: one row a tick, columns as in `references`.
            start: states of the plant by name; the others start as the model says.

        Returns:
            Shape (ticks, 1 + free, 2): position and torque of each tick as in `run`, then their derivatives by each
            free parameter, in one piece of memory.
        """
        p = self.numbers.copy()
        p[self.places] = values
        ticks, r = len(reference), np.ascontiguousarray(reference, np.float64)
        y = np.empty((ticks, 1 + len(self.free), len(OUTPUTS)))
        first = self._first(start)
        substeps = max(1, ceil(self.tick / LONGEST_SUBSTEP - 1e-9))
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (first, r, p, y)]
        self._library.run(ctypes.c_longlong(ticks), ctypes.c_longlong(substeps), *pointers)
        return y

    def _first(self, start: dict[str, float]) -> Array:
        plant = [start.get(state.name, state.start) for state in self.plant.states]
        memory = [state.start for state in self.controller.states] if self.controller else []
        return np.array([0.0, *plant, 0.0, 0.0, *memory])

    @cached_property
    def _library(self) -> ctypes.CDLL:
        functions = _functions(self)
        sources = {"loop.c": Path(__file__).with_name("loop.c").read_bytes()}
        generator = ca.CodeGenerator("functions", {"with_header": False})
        for function in functions:
            generator.add(function)
        sources["functions.h"] = str(generator.dump()).encode()
        sources["sizes.h"] = _sizes(self, functions).encode()
        platform = PLATFORMS[host()]
        return ctypes.CDLL(str(compile_shared(sources, f"identify{platform.suffix}", platform.target, (*FLAGS, "-lm"))))


def _functions(machine: Machine) -> tuple[ca.Function, ca.Function]:
    """State: time, plant, acting torque, pending torque, controller memory."""
    plant, controller = machine.plant, machine.controller
    count, memory = len(plant.states), len(controller.states) if controller else 0
    s, p = ca.SX.sym("s", 3 + count + memory), ca.SX.sym("p", len(plant.parameters))
    slopes, r = ca.SX.sym("S", s.numel(), len(machine.free)), ca.SX.sym("r", len(machine.references))
    parts = ca.vertsplit(s, [0, 1, 1 + count, 2 + count, 3 + count, s.numel()])
    time, x, acting = parts[0], parts[1], parts[2]
    size = machine.tick / max(1, ceil(machine.tick / LONGEST_SUBSTEP - 1e-9))
    x_next = _ros3p(lambda state: _rates(plant, time, state, acting, p), x, size)
    after = ca.vertcat(time + size, x_next, *parts[2:])
    controlled, y = _controlled(machine, parts, r, p)
    grown = [_with_slopes(machine, part, s, slopes, p) for part in (controlled, y, after)]
    control = ca.Function("identify_control", [s, slopes, r, p], [*grown[0], *grown[1]], {"cse": True})
    return control, ca.Function("identify_plant", [s, slopes, p], [*grown[2]], {"cse": True})


def _controlled(machine: Machine, parts: list[Any], r: Any, p: Any) -> tuple[Any, Any]:
    """State after the controller's tick, and (q, torque that acts now)."""
    time, x, _, pending, memory = parts
    outputs = machine.plant.equations(time, x, _inputs(machine.plant, 0), p)[1]
    q = outputs[[variable.name for variable in machine.plant.outputs].index("q")]
    if machine.controller is None:
        return ca.vertcat(time, x, r, r), ca.vertcat(q, r)
    numbers = ca.DM([variable.start for variable in machine.controller.parameters])
    following, commands = machine.controller.equations(time, memory, ca.vertcat(q, r), numbers)
    return ca.vertcat(time, x, pending, commands[0], following), ca.vertcat(q, pending)


def _rates(plant: Model, time: Any, x: Any, torque: Any, p: Any) -> Any:
    return plant.equations(time, x, _inputs(plant, torque), p)[0]


def _inputs(plant: Model, torque: Any) -> Any:
    """The torque, which comes first, and the other inputs at their start: no disturbance, 20 degC."""
    return ca.vertcat(torque, *(variable.start for variable in plant.inputs[1:]))


def _with_slopes(machine: Machine, result: Any, s: Any, slopes: Any, p: Any) -> tuple[Any, Any]:
    """A result and its derivatives by the free parameters, given those of the state."""
    chosen = ca.DM.zeros(p.numel(), len(machine.free))
    for column, place in enumerate(machine.places):
        chosen[place, column] = 1
    return ca.densify(result), ca.densify(ca.jtimes(result, s, slopes) + ca.jtimes(result, p, chosen))


def _ros3p(rates: Any, x: Any, h: float) -> Any:
    """One step of ROS3P: gamma is (3 + root) / 6, of which all its numbers are made; two stages are at one place."""
    root, here = sqrt(3.0), rates(x)
    matrix = ca.SX.eye(x.numel()) * 6 / (h * (3 + root)) - ca.jacobian(here, x)
    first = _solved(matrix, here)
    there = rates(x + (3 - root) * first)
    second = _solved(matrix, there - (3 - root) ** 2 / h * first)
    third = _solved(matrix, there - (2 * root * first + root * second) / h)
    return x + 2 * first + second / root + (1 - 1 / root) * third


def _solved(matrix: Any, right: Any) -> Any:
    """Gaussian elimination; 1/(h gamma) on the diagonal outweighs the Jacobian, so rows need not be exchanged."""
    m, b, n = ca.SX(matrix), ca.SX(right), right.numel()
    for k in range(n):
        for i in range(k + 1, n):
            factor = m[i, k] / m[k, k]
            m[i, :] = m[i, :] - factor * m[k, :]
            b[i] = b[i] - factor * b[k]
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            b[k] = b[k] - m[k, j] * b[j]
        b[k] = b[k] / m[k, k]
    return b


def _sizes(machine: Machine, functions: tuple[ca.Function, ca.Function]) -> str:
    controller = machine.controller
    sizes = {
        "STATES": 3 + len(machine.plant.states) + (len(controller.states) if controller else 0),
        "FREE": len(machine.free),
        "REFERENCES": len(machine.references),
        "OUTPUTS": len(OUTPUTS),
        "ARGUMENTS": max(function.sz_arg() for function in functions),
        "RESULTS": max(function.sz_res() for function in functions),
        "WORK": max(1, *(function.sz_w() for function in functions)),
        "INT_WORK": max(1, *(function.sz_iw() for function in functions)),
    }
    return "".join(f"#define {name} {size}\n" for name, size in sizes.items())
