"""Every form of effect of the catalogue with numbers, and small tools to ask a plant with it.

A new effect is met by all property tests at once: what `NUMBERS` does not say is taken from inside its bounds.
"""

from dataclasses import MISSING, fields
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from pyfmi_models.effects import FORMS, Effect
from pyfmi_models.friction import Coulomb, FrictionLaw
from pyfmi_models.model import Model, Variable
from pyfmi_models.mount import Axis, Mount

NUMBERS: dict[str, dict[str, Any]] = {
    "FrictionAsymmetry": {"level_asymmetry": 0.1, "viscous_asymmetry": -0.2},
    "StribeckEffect": {"Fs": 4.0, "Vs": 0.02},
    "Presliding": {"sigma0": 2e4, "sigma1": 90.0},
    "Cogging": {"cycles_per_rev": 24, "amplitude": 0.5, "phase": 0.3, "harmonics": (0.4, -0.2)},
    "PeriodicFriction": {"cycles_per_rev": 3, "relative_amplitude": 0.2, "phase": 0.4},
    "LoadScaledFriction": {"coulomb_per_Nm": 0.1, "at_level": 2.0},
    "LocalFriction": {"q_center": 1.0, "width": 0.05, "relative_amplitude": 0.3},
    "GravityUnbalance": {"mgl": 1.5, "phase": 0.2},
    "TorqueOffset": {"torque": 0.7},
    "ConstantForce": {"force": 0.7},
    "AxisCoupling": {"inertia": 0.4},
    "DampedCoupling": {"inertia": 0.4, "damping": 0.3},
    "WeightCoupling": {"inertia": 0.4, "weight": 1.5, "phase": 0.2},
    "ChainCoupling": {"weight": 1.5, "phase": 0.2, "follows_second": -1.0, "neighbour": "q2 + q3"},
    "SpaceCoupling": {"ssc": 0.7, "ccc": -1.5, "neighbour": "q2 + q3"},
    "ThermalViscosity": {"viscous_per_degC": -0.04, "coulomb_per_degC": -0.02},
    "WarmingViscosity": {"viscous_per_degC": -0.04, "warm_up_degC": 15.0, "warm_up_s": 30.0},
    "RubbedViscosity": {"viscous_per_degC": -0.04, "heat_degC_per_rad": 8.0, "cooling_s": 30.0},
    "DwellBreakaway": {"torque_per_efold": 0.3},
    "Compliance": {"antiresonance_hz": 20.0, "resonance_hz": 25.0},
    "LoadSideCompliance": {"resonance_hz": 60.0, "encoder_share": 0.6},
    "ActuatorLag": {"time_constant_ms": 4.0},
    "Delay": {"delay_ms": 4.0},
    "Backlash": {"gap_rad": 1e-2, "load_friction": 0.1, "load_deflection": 1e-3},
    "EncoderEccentricity": {"cycles_per_rev": 8, "amplitude_rad": 1e-3, "phase": 0.3, "second": 0.2},
    "QuadraticDrag": {"coefficient": 2.0},
    "CableWrap": {"stiffness": 3.0, "home": 0.2, "hardening": 0.5},
    "InertiaVariation": {"relative_amplitude": 0.3, "cycles_per_rev": 2, "phase": 0.4},
    "AltitudeInertia": {"tube_inertia": 3.0},
    "AzimuthCentrifugal": {"tube_inertia": 3.0},
    "LoadDependentFriction": {"coulomb_per_Nm": 0.2},
    "GearLoadFriction": {"coulomb_per_Nm": 0.2, "at_level": 2.0, "inertia_share": 0.7, "friction_share": 0.4},
    "GearFriction": {"driving": 0.3, "driven": 0.1},
    "TorqueSaturation": {"knee_torque": 5.0, "slope": 0.4},
    "DeadBand": {"band": 0.5},
    "TorqueDroop": {"droop": 0.2, "rated_torque": 8.0},
    "WarmTorqueDroop": {"droop": 0.2, "rated_torque": 8.0, "per_degC": -0.002},
    "BoucWen": {"torque": 0.8, "stroke": 0.05, "beta": 0.6, "gamma": -0.3, "n": 1.5},
    "RoughSpot": {"q_center": 0.3, "width": 0.1, "forward": 0.8, "backward": -0.3},
    "ConcaveViscous": {"thinning_speed": 0.3, "exponent": -0.4},
    "PeriodicDisturbance": {"frequency_hz": 3.0, "amplitude": 0.6, "phase": 0.2},
    "LearnedTorque": {"over": "position", "seen": (-1.0, 1.2), "torque": (0.3, 0.5, -0.2, 0.1)},
    "LearnedFriction": {
        "over": "position",
        "seen": (-1.0, 1.2),
        "by": "temperature",
        "by_seen": (15.0, 35.0),
        "waves": (2, 1),
        "level_change": (0.1, 0.2, -0.1, 0.05, 0.1, -0.2),
    },
    "LearnedViscous": {"over": "acceleration", "seen": (-2, 2), "viscous_torque": (0.0, 0.3, -0.2), "at_speed": 0.5},
    "LearnedGain": {"over": "position", "seen": (-1.0, 1.2), "more_command": (0.0, 0.05, 0.02, -0.01)},
    "LearnedDrive": {"command_seen": (-20.0, 20.0), "missing": (0.0, 0.1, 0.0, -0.2)},
    "LearnedHysteresis": {"strokes": (0.1, 0.4), "torque": (0.2, 0.3)},
    "LearnedAfterReversal": {"times": (0.1, 0.4), "level_change": (0.2, -0.1)},
    "ClockSkew": {"drift_ppm": 100.0, "offset_ms": 4.0},
}
LAW = Coulomb(Fc=1.0, sigma2=3.0)
INERTIA = 2.0


def inside(variable: Variable) -> float:
    """A number that a parameter may have: its nominal, or one between its bounds."""
    if variable.low < variable.nominal < variable.high:
        return variable.nominal
    return (variable.low + variable.high) / 2 if np.isfinite(variable.high) else variable.low + variable.nominal


def example(form: type[Effect]) -> Effect:
    """Return an effect with the numbers above where there are any."""
    required = {item.name: item for item in fields(form) if item.default is MISSING}
    guessed = {
        name: inside(item.metadata["variable"]) for name, item in required.items() if "variable" in item.metadata
    }
    return form(**(guessed | NUMBERS.get(form.__name__, {})))


EXAMPLES: tuple[Effect, ...] = tuple(example(form) for form in FORMS)
FORM: dict[str, Any] = {form.__name__: form for form in FORMS}


def mount(*effects: Effect, friction: FrictionLaw = LAW, **changes: Any) -> Mount:
    """An axis of 2 kg m2 with Coulomb friction of 1 N m and 3 N m s/rad."""
    return Mount(**({"name": "m", "axis": Axis(inertia=INERTIA), "friction": friction, "effects": effects} | changes))


def evaluate(model: Model, t: float = 0.0, **values: float) -> dict[str, float]:
    """Rates `der(state)` and outputs at values of states, inputs and parameters; others are at their start."""
    columns = [model.states, model.inputs, model.parameters]
    unknown = set(values) - {variable.name for column in columns for variable in column}
    assert not unknown, unknown
    x, u, p = ([values.get(variable.name, variable.start) for variable in column] for column in columns)
    rates, outputs = (part.full().ravel().tolist() for part in model.equations(t, x, u, p))
    names = [f"der({state.name})" for state in model.states]
    return dict(zip(names, rates, strict=True)) | dict(zip((o.name for o in model.outputs), outputs, strict=True))


def slopes(model: Model) -> ca.Function:
    """Rates and outputs, and their derivatives by (t, x, u, p), from one column of all of these."""
    sizes = [1, len(model.states), len(model.inputs), len(model.parameters)]
    z = ca.SX.sym("z", sum(sizes))
    ends = np.cumsum([0, *sizes])
    parts = [z[first:last] for first, last in pairwise(ends)]
    values = ca.densify(ca.vertcat(*model.equations(*parts)))
    return ca.Function("slopes", [z], [values, ca.densify(ca.jacobian(values, z))])


def linear(model: Model, output: str = "q", **at: float) -> tuple[np.ndarray, ...]:
    """Matrices (A, B, C, D) from tau to an output around a point, from the exact derivatives."""
    states, inputs = [s.name for s in model.states], [u.name for u in model.inputs]
    variables = (*model.states, *model.inputs, *model.parameters)
    z = [0.0, *(at.get(variable.name, variable.start) for variable in variables)]
    jacobian = slopes(model)(z)[1].full()
    n, tau = len(states), 1 + len(states) + inputs.index("tau")
    row = n + [o.name for o in model.outputs].index(output)
    return jacobian[:n, 1 : 1 + n], jacobian[:n, tau], jacobian[row, 1 : 1 + n], jacobian[row, tau]


def response(model: Model, hertz: float, output: str = "q", **at: float) -> complex:
    """Frequency response from tau to an output."""
    A, B, C, D = linear(model, output, **at)
    return complex(C @ np.linalg.solve(2j * np.pi * hertz * np.eye(len(A)) - A, B) + D)


def simulate(
    model: Model, times: Any, tau: Any = lambda t: 0.0, start: dict[str, float] | None = None, **inputs: float
) -> dict[str, np.ndarray]:
    """States and outputs by name at these times, by an implicit method at a tight tolerance with the exact Jacobian."""
    given, start = {variable.name: variable.start for variable in model.inputs} | inputs, start or {}
    x, t, torque = ca.SX.sym("x", len(model.states)), ca.SX.sym("t"), ca.SX.sym("tau")
    u = ca.vertcat(*[torque if name == "tau" else value for name, value in given.items()])
    rates, outputs = model.equations(t, x, u, [p.start for p in model.parameters])
    f, jacobian, shown = (
        ca.Function("f", [t, x, torque], [ca.densify(part)]) for part in (rates, ca.jacobian(rates, x), outputs)
    )
    found = solve_ivp(
        lambda t, x: f(t, x, tau(t)).full().ravel(),
        (times[0], times[-1]),
        [start.get(state.name, state.start) for state in model.states],
        "Radau",
        times,
        jac=lambda t, x: jacobian(t, x, tau(t)).full(),
        rtol=1e-9,
        atol=[1e-10 * state.nominal for state in model.states],
    )
    assert found.success, found.message
    rows = [shown(t, x, tau(t)).full().ravel() for t, x in zip(found.t, found.y.T, strict=True)]
    columns = dict(zip((o.name for o in model.outputs), np.array(rows).T, strict=True))
    return {"t": found.t} | {state.name: row for state, row in zip(model.states, found.y, strict=True)} | columns
