"""The bristle equation as an FMU: co-simulation through the compiled loop, model exchange through FMPy's CVode."""

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

from cosim.master.simulate import simulate
from cosim.system.system import System
from cosim.system.wire import Record
from cosim_studies.stiffness.methods import Floats
from cosim_studies.stiffness.motion import MOTION, Regime, speed
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Model, Variable, parameters_of, symbols_of, with_symbols

BRISTLE = "out.bristle"
CVODE_TOLERANCE = 1e-10

Solver = Callable[[Path, Regime, float], Floats]
"""Of an archive, a motion and a step: the bristle torque [N m] at the end of each step."""


def bristle_model(law: LuGre) -> Model:
    """Write the law alone as a `Model` without inputs: the motion is a function of time, so nothing is held."""
    parameters = (*MOTION, *parameters_of(law, "friction"))
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x"), ca.SX.sym("u", 0)
    p, symbols = symbols_of(parameters)
    v = speed(t, *(symbols[variable.name] for variable in MOTION))
    this = with_symbols(law, symbols, v, "friction")
    outputs = (
        Variable(name=BRISTLE, unit="N.m", description="Bristle torque sigma0 z"),
        Variable(name="out.torque", unit="N.m", description="Friction torque, resists"),
        Variable(name="out.v", unit="rad/s", description="Prescribed speed"),
    )
    level = this.level(v)
    y = ca.vertcat(x, this.contact(x, v, level) + this.viscous(v), v)
    return Model(
        name="bristle",
        description="LuGre friction under a prescribed motion",
        inputs=(),
        parameters=parameters,
        states=law.states(),
        outputs=outputs,
        equations=ca.Function(
            "equations", [t, x, u, p], [this.rate(x, v, level), y], ["t", "x", "u", "p"], ["next", "y"]
        ),
    )


def co_simulation(path: Path, regime: Regime, step: float) -> Floats:
    """Run the archive in the compiled loop, at its own default tolerance."""
    system = System(
        components={"friction": path},
        records={"bristle": Record(f"friction.{BRISTLE}")},
        step=step,
        ticks=regime.ticks(step) + 1,
        parameters={"friction": regime.motion()},
    )
    return np.asarray(simulate(system).recording["bristle"], dtype=np.float64)[1:]


def model_exchange(path: Path, regime: Regime, step: float) -> Floats:
    """Let another team's tool integrate the archive's rates: FMPy with SUNDIALS' CVode."""
    from fmpy import simulate_fmu

    result = simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=regime.seconds,
        output_interval=step,
        output=[BRISTLE],
        start_values=regime.motion(),
        relative_tolerance=CVODE_TOLERANCE,
    )
    return np.asarray(result[BRISTLE], dtype=np.float64)[1:]
