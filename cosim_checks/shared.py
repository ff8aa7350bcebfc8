"""What laws and effects owe alike: units, finite equations, true derivatives, bounds that hold, an FMU that agrees."""

import tempfile
from dataclasses import replace
from itertools import pairwise
from math import inf, isfinite, isnan
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from cosim.master.simulate import simulate
from cosim.system.system import System
from cosim.system.wire import Record, Wire
from cosim_checks.plant import INERTIA, Array, Equations, mount_of
from cosim_checks.suite import NotApplicable, require
from pyfmi_models import plugins
from pyfmi_models.card import Card, MountSection, parse_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects import Effect
from pyfmi_models.errors import CardError, ExportError
from pyfmi_models.export import export_fmu
from pyfmi_models.export.units import parse_unit
from pyfmi_models.friction import FrictionLaw
from pyfmi_models.model import Variable, parameters_of

Part = Effect | FrictionLaw
POINTS = 40
"""Columns that are tried."""
DIRECTIONS, ALLOWED, BETWEEN = 20, 0.8, 1e-4
"""Points where derivatives are compared, the share of them that must agree (others may be at a kink), and how far
exact derivatives and differences may be apart, relative."""
LEAST_FIELD, BESIDE = 0.3, 1e-6
"""Share of a variable's size by which points lie around its start; step of a difference, relative."""
PUSH, LASTS, STEP = 6.0, 0.4, 1e-3
"""Torque [N m], time and step [s] of the run that compares FMU and Python: a start from rest, a reversal, a stop."""
ALIKE = 2e-5
"""Difference between FMU and Python, relative to the largest value of a state."""


def units(part: Part) -> None:
    """Each parameter, state and input has a unit that the exporter knows, words, and a start within its bounds."""
    given = (*parameters_of(part), *part.states(), *(part.inputs() if isinstance(part, Effect) else ()))
    for one in given:
        try:
            parse_unit(one.unit)
        except ExportError as error:
            require(False, f'{one.name}: {error} Write it as "N.m.s/rad".')
        require(one.description.strip(), f"{one.name} has no description; it is the help text of card and FMU.")
        require(one.low <= one.start <= one.high, f"{one.name} = {one.start:g} is outside {one.low:g} .. {one.high:g}.")
        require(isfinite(one.nominal) and one.nominal > 0, f"{one.name}: nominal = {one.nominal:g} must be positive.")


def finite(part: Part) -> None:
    """Equations and derivatives are finite at rest and at any speed, and with each parameter at either bound."""
    shapes = [("its numbers", part)]
    for one in parameters_of(part):
        name = one.name.partition(".")[0]
        ends = [end for end in (one.low, one.high) if isfinite(end)]
        shapes += [(f"{name} = {end:g}", replace(part, **{name: end})) for end in ends]
    for said, shape in shapes:
        if isinstance(shape, Effect) and shape.broken_rule():
            continue
        equations = Equations(mount_of(shape).model())
        for column in equations.points(POINTS if shape is part else POINTS // 4):
            values, slopes = equations.at(column)
            where = f"with {said} at t, states, inputs = {_short(column, equations)}"
            require(np.all(np.isfinite(values)), f"not finite {where}.")
            require(np.all(np.isfinite(slopes)), f"a derivative is not finite {where}; avoid sqrt(0), pow(0, n), 0/0.")


def _short(column: Array, equations: Equations) -> str:
    shown = 1 + len(equations.model.states) + len(equations.model.inputs)
    return ", ".join(f"{value:.3g}" for value in column[:shown])


def derivatives(part: Part) -> None:
    """Exact derivatives are those of the equations: they agree with differences away from rest."""
    equations, rng = Equations(mount_of(part).model()), np.random.default_rng(1)
    variables = equations.variables
    sizes = np.array([1.0, *(abs(one.start) or one.nominal for one in variables)])
    starts = np.array([1.0, *(one.start for one in variables)])
    low, high = np.array([(-inf, inf), *((one.low, one.high) for one in variables)]).T
    free = np.array([True, *(one.tunable for one in variables)])
    apart = []
    for _ in range(DIRECTIONS):
        column = starts + LEAST_FIELD * sizes * rng.standard_normal(len(sizes)) * (rng.random(len(sizes)) < 0.7) * free
        column = np.clip(column, low + 2 * BESIDE * sizes, high - 2 * BESIDE * sizes)
        way, h = sizes * rng.standard_normal(len(sizes)) * free, BESIDE
        (ahead, _), (behind, _), (_, slopes) = (equations.at(one) for one in _neighbours(column, h * way))
        scale = np.abs(slopes) @ np.abs(way) + 1e-9
        apart.append(float(np.max(np.abs((ahead - behind) / (2 * h) - slopes @ way) / scale)))
    worst = sorted(inf if isnan(one) else one for one in apart)[round(ALLOWED * DIRECTIONS) - 1]
    require(worst < BETWEEN, f"derivatives differ from differences by {worst:.1g}, relative; do the equations step?")


def _neighbours(column: Array, step: Array) -> tuple[Array, Array, Array]:
    return column + step, column - step, column


def bounds(part: Part) -> None:
    """A card with these numbers is read back as written; one with a number beyond a bound is refused by its name."""
    text = card_text(card_of(part))
    again = parse_card(text, "check.toml")
    found = again.friction if isinstance(part, FrictionLaw) else again.effects[0]
    require(found == part, f"a card with {part} is read back as {found}.")
    limited = [(one, end) for one in parameters_of(part) for end in (one.low, one.high) if isfinite(end)]
    if not limited:
        raise NotApplicable("no parameter has a bound")
    for one, end in limited:
        name = one.name.partition(".")[0]
        beyond = end - _beyond(one, end) if end == one.low else end + _beyond(one, end)
        _refused(replace(part, **{name: beyond}), name, beyond)


def _beyond(one: Variable, end: float) -> float:
    return 0.1 * (abs(end) or one.nominal)


def _refused(part: Part, name: str, value: float) -> None:
    try:
        parse_card(card_text(card_of(part)), "check.toml")
    except CardError as error:
        require(name in str(error), f"{name} = {value:g} is refused without its name: {error}")
        return
    require(False, f"{name} = {value:g} is beyond its bound, and a card with it is read.")


def card_of(part: Part, **more: Any) -> Card:
    """A card with the axis, a law or an effect on Coulomb friction, and whatever else is given."""
    plugins.register(type(part))
    mount = mount_of(part)
    section = MountSection(name="checked", inertia=INERTIA)
    return Card(path="check.toml", mount=section, friction=mount.friction, effects=mount.effects, **more)


def fmu(part: Part) -> None:
    """The exported FMU moves as the equations in Python do under an implicit solver."""
    model = mount_of(part).model()
    ticks = round(LASTS / STEP)
    times = STEP * np.arange(ticks)
    tau = np.where(times < LASTS / 2, PUSH, -PUSH)
    names = [state.name for state in model.states]
    with tempfile.TemporaryDirectory() as folder:
        path = export_fmu(replace(model, name="plant"), Path(folder) / "plant.fmu")
        system = System(
            components={"plant": path.absolute()},
            wires=[Wire("tau", "plant.tau")],
            records={"tau": Record("tau"), "q": Record("plant.q"), "v": Record("plant.v")},
            step=STEP,
            ticks=ticks,
            signals={"tau": tau},
            name="check",
        )
        found = simulate(system).recording
    exact = _solved(model, tau)
    for name, column in (("q", "position"), ("v", "speed")):
        if name == "q" and "q_true" in [one.name for one in model.outputs]:
            continue  # the reading is not the position
        ours = np.asarray(found[name])
        theirs = exact[names.index(column)][: len(ours)]
        apart = float(np.max(np.abs(ours - theirs)) / max(float(np.max(np.abs(theirs))), 1e-12))
        require(apart < ALIKE, f"{name} of the FMU and of the equations in Python differ by {apart:.1g} of its size.")


def _solved(model: Any, tau: Array) -> Array:
    """States (states, ticks) at each tick, the torque held in between."""
    x, t, u = ca.SX.sym("x", len(model.states)), ca.SX.sym("t"), ca.SX.sym("u")
    inputs = ca.vertcat(*[u if one.name == "tau" else one.start for one in model.inputs])
    rates = ca.densify(model.equations(t, x, inputs, [one.start for one in model.parameters])[0])
    f, slope = (ca.Function("f", [t, x, u], [one]) for one in (rates, ca.densify(ca.jacobian(rates, x))))
    state, parts = np.array([one.start for one in model.states]), []
    edges = [0, *(1 + np.flatnonzero(np.diff(tau))), len(tau)]
    for first, last in pairwise(edges):
        span = STEP * np.arange(first, last + 1)
        found: Any = solve_ivp(
            _held(f, tau[first]),
            (span[0], span[-1]),
            state,
            "Radau",
            span,
            jac=_held(slope, tau[first]),
            rtol=1e-9,
            atol=[1e-10 * one.nominal for one in model.states],
        )
        require(found.success, f"an implicit solver cannot follow the equations: {found.message}")
        parts.append(found.y[:, :-1])
        state = found.y[:, -1]
    return np.column_stack(parts)


def _held(function: Any, tau: float) -> Any:
    """A function of (t, x) with the torque held; a row or a matrix as the solver wants it."""

    def at(t: float, x: Array) -> Array:
        found: Array = function(t, x, tau).full()
        return found[:, 0] if found.shape[1] == 1 and len(x) > 1 else found

    return at
