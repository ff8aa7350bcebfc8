"""How well the stiff friction state is integrated: the FMU beside the paper's analytic update and textbook methods.

The bristle equation of a card's LuGre law is driven by prescribed motions and solved at steps of 0.1 ms,

    dz/dt = v(t) - sigma0 |v| z / g(v).

With v given it is linear in z, so the truth comes from 5-stage Radau collocation (order 9) on every step. `z` is kept
as the bristle torque sigma0 z. Torques take dz/dt from the equation at the new z, not from a difference.
`python -m cosim.stiffness --out DIR` rebuilds the tables.
"""

import csv
import json
import tempfile
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from math import degrees, inf, pi, radians
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

import cosim
from cosim.errors import CosimError, InputError
from cosim.files import replacing
from cosim.master import simulate
from pyfmi_models.card import Card, read_card
from pyfmi_models.errors import ModelError
from pyfmi_models.export import export_fmu
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Model, Variable, parameters_of, symbols_of, with_symbols

Floats = npt.NDArray[np.float64]
Speed = Callable[[Any], Any]
STEP = 1e-4
"""The paper's sampling time [s]."""
DIVERGED = 10.0
"""A method whose z leaves this many times the largest true |z| is called unstable."""
FMU = "FMU"
EXPLICIT = {"explicit Euler": 2.0, "Runge-Kutta 4": 2.785293563405282}
"""Where the real axis leaves the stability region of an explicit method."""


@dataclass(frozen=True, kw_only=True)
class Regime:
    """A prescribed speed v(t) = offset + peak sin(2 pi frequency t + phase) over some seconds."""

    name: str
    seconds: float
    peak: float = 0.0
    frequency: float = 0.2
    phase: float = 0.0
    offset: float = 0.0

    def speed(self, t: Any) -> Any:
        """Speed [rad/s] at time t [s]: a number, an array or a symbol."""
        return _speed(t, *self.motion().values())

    def motion(self) -> dict[str, float]:
        """Return the numbers of the motion, by the name of the FMU's parameter."""
        return {variable.name: getattr(self, variable.name) for variable in MOTION}

    @property
    def ticks(self) -> int:
        """Number of steps."""
        return round(self.seconds / STEP)


MOTION = (
    Variable(name="peak", unit="rad/s", description="Largest speed of the sine"),
    Variable(name="frequency", unit="Hz", description="Frequency of the sine"),
    Variable(name="phase", unit="rad", description="Phase of the sine at the start"),
    Variable(name="offset", unit="rad/s", description="Constant part of the speed"),
)
# A step of 20 urad, less than the bristles bend before they break away; its speed is one full raised cosine.
_STEP_SPEED = 20e-6 / 0.05
REGIMES = (
    Regime(name="reference", seconds=5, peak=5 * 7.268e-5),
    Regime(name="5 deg/s", seconds=5, peak=radians(5)),
    Regime(name="40 deg/s", seconds=5, peak=radians(40)),
    Regime(name="reversals at 2 Hz", seconds=1, peak=radians(5), frequency=2),
    Regime(name="presliding step", seconds=0.1, offset=_STEP_SPEED, peak=-_STEP_SPEED, frequency=20, phase=pi / 2),
)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One method in one regime; errors are the largest over the whole motion, infinite where it diverges."""

    regime: str
    method: str
    z_error: float
    """Error of z relative to the largest |z|."""
    torque_error: float
    """Error of the friction torque [N m]."""
    stable: bool


def compare(card: Card) -> list[Row]:
    """Run all methods in all regimes on the friction law of a card.

    Raises:
        InputError: the card's friction has no bristles.
        ModelError: the law cannot be exported.
    """
    law = _law(card)
    solved = _by_fmu(law)
    rows = []
    for regime in REGIMES:
        t: Floats = STEP * np.arange(1, regime.ticks + 1, dtype=np.float64)
        truth, torque = exact(law, regime), _torque_function(law, regime)
        states = {FMU: solved[regime.name]} | {name: _iterate(step(law, regime), t) for name, step in METHODS.items()}
        rows += [_row(regime, method, z, truth, torque(z, t) - torque(truth, t)) for method, z in states.items()]
    return rows


def exact(law: LuGre, regime: Regime) -> Floats:
    """Bristle torque [N m] at the end of each step, by collocation: order 9, correct to rounding (tested)."""
    nodes = np.array(ca.collocation_points(5, "radau"))
    powers = np.arange(len(nodes))
    A = (nodes[:, None] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(nodes[:, None] ** powers)
    v = regime.speed(STEP * (np.arange(regime.ticks)[:, None] + nodes)).ravel()
    free, held = (_rates(law, state, v).reshape(-1, len(nodes)) for state in (0.0, 1.0))
    slope = held - free
    # The rate is free + slope F, so the stages K solve K = free + slope (F + STEP A K) and are linear in F, too.
    system = np.eye(len(nodes)) - STEP * slope[:, :, None] * A
    stages = np.linalg.solve(system, np.stack([free, slope], axis=-1))
    push, gain = STEP * stages[..., 0] @ A[-1], 1 + STEP * stages[..., 1] @ A[-1]
    found = [0.0]
    for a, b in zip(gain.tolist(), push.tolist(), strict=True):
        found.append(a * found[-1] + b)
    return np.array(found[1:])


def stability_limit(law: LuGre, bound: float, step: float = STEP) -> float:
    """Steady speed [rad/s] above which an explicit method is unstable; `bound` is its limit of |step d(rate)/dz|."""

    def excess(v: float) -> float:
        speed = np.array([v])
        return step * float((_rates(law, 0.0, speed) - _rates(law, 1.0, speed))[0]) - bound

    return float(brentq(excess, 1e-6, 1e3))


def table_text(rows: Sequence[Row]) -> str:
    """Write the rows as a plain table of at most 80 columns."""
    lines = [f"{'motion':<18} {'method':<26} {'error of z':>11} {'of torque [N m]':>16}"]
    last = ""
    for row in rows:
        numbers = f"{row.z_error:>11.1e} {row.torque_error:>16.1e}" if row.stable else f"{'diverges':>11}"
        lines.append(f"{row.regime if row.regime != last else '':<18} {row.method:<26} {numbers}")
        last = row.regime
    return "\n".join(lines) + "\n"


def write(rows: Sequence[Row], directory: Path, force: bool = False) -> list[Path]:
    """Write stiffness.csv, stiffness.json and stiffness.txt; return their paths.

    Raises:
        OutputError: a file exists and `force` is not given.
    """
    names = [item.name for item in fields(Row)]
    paths = [directory / f"stiffness.{kind}" for kind in ("csv", "json", "txt")]
    with replacing(paths[0], force) as partial, partial.open("w", newline="") as file:
        table = csv.DictWriter(file, names, lineterminator="\n")
        table.writeheader()
        table.writerows(asdict(row) for row in rows)
    # JSON has no infinity: an error that diverges is null.
    plain = [{key: None if value == inf else value for key, value in asdict(row).items()} for row in rows]
    story = {"version": f"mount-cosim {cosim.__version__}", "step": STEP, "rows": plain}
    with replacing(paths[1], force) as partial:
        partial.write_text(json.dumps(story, indent=2) + "\n", "utf-8")
    with replacing(paths[2], force) as partial:
        partial.write_text(table_text(rows), "utf-8")
    return paths


def bristle_model(law: LuGre) -> Model:
    """Write the law alone as a `Model` without inputs: the motion is a function of time, so nothing is held."""
    parameters = (*MOTION, *parameters_of(law, "friction"))
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x"), ca.SX.sym("u", 0)
    p, symbols = symbols_of(parameters)
    v = _speed(t, *(symbols[variable.name] for variable in MOTION))
    this = with_symbols(law, symbols, v, "friction")
    outputs = (
        Variable(name="bristle", unit="N.m", description="Bristle torque sigma0 z"),
        Variable(name="torque", unit="N.m", description="Friction torque, resists"),
        Variable(name="v", unit="rad/s", description="Prescribed speed"),
    )
    level = this.level(v)
    y = ca.vertcat(x, this.contact(x, v, level) + this.viscous(v), v)
    return Model(
        name="bristle",
        description="LuGre friction under a prescribed motion",
        inputs=(),
        parameters=parameters,
        states=law.states(),
        outputs=tuple(Variable(name=f"out.{one.name}", unit=one.unit, description=one.description) for one in outputs),
        equations=ca.Function(
            "equations", [t, x, u, p], [this.rate(x, v, level), y], ["t", "x", "u", "p"], ["next", "y"]
        ),
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare on one card, print the table and write it."""
    parser = ArgumentParser(prog="python -m cosim.stiffness", description=main.__doc__)
    parser.add_argument("--card", default="paper_mount", help="a card (.toml) or the name of a shipped one")
    parser.add_argument("--out", type=Path, required=True, help="directory for stiffness.csv, .json and .txt")
    parser.add_argument("--force", action="store_true", help="overwrite what is there")
    given = parser.parse_args(arguments)
    try:
        _report(read_card(given.card), given.out, given.force)
    except (CosimError, ModelError) as error:
        parser.exit(2, f"{error}\n")


def _report(card: Card, directory: Path, force: bool) -> None:
    rows = compare(card)
    print(table_text(rows), end="")
    limits = (f"{name} {degrees(stability_limit(_law(card), bound)):.3g} deg/s" for name, bound in EXPLICIT.items())
    print(f"stable at {1e3 * STEP:g} ms up to a steady speed of: {', '.join(limits)}")
    for path in write(rows, directory, force):
        print(path)


def _speed(t: Any, peak: Any, frequency: Any, phase: Any, offset: Any) -> Any:
    sine = ca.sin if isinstance(t, ca.SX) else np.sin
    return offset + peak * sine(2 * pi * frequency * t + phase)


def _law(card: Card) -> LuGre:
    if not isinstance(card.friction, LuGre):
        message = f'{card.path}: [friction] model is "{card.friction.key}"; only "lugre" has a stiff state to compare.'
        raise InputError(message, culprit=card.path, value=card.friction.key, choices=("lugre",))
    return card.friction


def _at(law: LuGre, v: Any) -> LuGre:
    """Return the law with its pairs resolved for the direction of v."""
    symbols = {variable.name: ca.SX(variable.start) for variable in parameters_of(law)}
    return with_symbols(law, symbols, v)


def _function(law: LuGre, formula: Callable[[LuGre, Any, Any], Any]) -> ca.Function:
    state, v = ca.SX.sym("state"), ca.SX.sym("v")
    return ca.Function("formula", [state, v], [formula(_at(law, v), state, v)])


def _rates(law: LuGre, state: float, v: Floats) -> Floats:
    rate = _function(law, lambda this, x, speed: this.rate(x, speed, this.level(speed)))
    return _each(rate, np.full_like(v, state), v)


def _torque_function(law: LuGre, regime: Regime) -> Callable[[Floats, Floats], Floats]:
    torque = _function(law, lambda this, x, v: this.contact(x, v, this.level(v)) + this.viscous(v))
    return lambda z, t: _each(torque, z, regime.speed(t))


def _each(function: ca.Function, state: Floats, v: Floats) -> Floats:
    """Evaluate a function of state and speed at each pair; calling it on rows directly takes four times as long."""
    row = ca.DM(state).T, ca.DM(v).T
    return np.asarray(function.map(len(v))(*row).full()).ravel()


def _iterate(step: ca.Function, t: Floats) -> Floats:
    """Apply a one-step map, (state, time at the start of the step) to state, from rest."""
    return np.asarray(step.mapaccum(len(t))(0, ca.DM(t - STEP).T).full()).ravel()


def _analytic(where: float) -> Callable[[LuGre, Regime], ca.Function]:
    """Equation (17) with the speed at a fraction of the step."""

    def step(law: LuGre, regime: Regime) -> ca.Function:
        z, t = ca.SX.sym("z"), ca.SX.sym("t")
        v = regime.speed(t + where * STEP)
        this = _at(law, v)
        return ca.Function("analytic", [z, t], [this.advance(z, v, this.level(v), STEP)])

    return step


def _explicit(tableau: Sequence[tuple[float, float]]) -> Callable[[LuGre, Regime], ca.Function]:
    """Explicit Runge-Kutta method where stage i starts from stage i-1: (fraction of the step, weight)."""

    def step(law: LuGre, regime: Regime) -> ca.Function:
        rate = _function(law, lambda this, x, v: this.rate(x, v, this.level(v)))
        z, t = ca.SX.sym("z"), ca.SX.sym("t")
        slope, total = ca.SX(0), z
        for fraction, weight in tableau:
            slope = rate(z + fraction * STEP * slope, regime.speed(t + fraction * STEP))
            total += weight * STEP * slope
        return ca.Function("explicit", [z, t], [total])

    return step


METHODS: dict[str, Callable[[LuGre, Regime], ca.Function]] = {
    "(17), speed at start": _analytic(0.0),
    "(17), speed at midpoint": _analytic(0.5),
    "explicit Euler": _explicit([(0, 1)]),
    "Runge-Kutta 4": _explicit([(0, 1 / 6), (1 / 2, 1 / 3), (1 / 2, 1 / 3), (1, 1 / 6)]),
}


def _by_fmu(law: LuGre) -> dict[str, Floats]:
    """Bristle torque at the end of each step of each regime, from one FMU through the compiled loop."""
    with tempfile.TemporaryDirectory() as folder:
        path = export_fmu(bristle_model(law), Path(folder) / "bristle.fmu")
        return {regime.name: _run(path, regime) for regime in REGIMES}


def _run(path: Path, regime: Regime) -> Floats:
    run = simulate(
        {"friction": path},
        [],
        record={"bristle": "friction.out.bristle"},
        step=STEP,
        ticks=regime.ticks + 1,
        parameters={"friction": regime.motion()},
    )
    return np.asarray(run.recording["bristle"], dtype=np.float64)[1:]


def _row(regime: Regime, method: str, z: Floats, truth: Floats, torque_error: Floats) -> Row:
    scale = float(np.abs(truth).max())
    stable = bool(np.all(np.isfinite(z)) and np.abs(z).max() <= DIVERGED * scale)
    worst = [float(np.abs(error).max()) if stable else inf for error in ((z - truth) / scale, torque_error)]
    return Row(regime=regime.name, method=method, z_error=worst[0], torque_error=worst[1], stable=stable)


if __name__ == "__main__":
    main()
