"""Every friction law as an FMU: co-simulation and model exchange find what a tight solver finds."""

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from fmpy import simulate_fmu
from friction_laws import EXAMPLES
from scipy.integrate import solve_ivp

from pyfmi_models.export import export_fmu
from pyfmi_models.friction import FrictionLaw
from pyfmi_models.model import Model
from pyfmi_models.mount import Axis, Mount

PUSHED, TIMES = (4.0, -0.01), (0.02, 0.05, 0.06, 0.1)
"""Pushed back (torque, speed) from a slow motion: sliding, about to stop, just turned and bending, sliding again."""
EACH = pytest.mark.parametrize("law", EXAMPLES.values(), ids=EXAMPLES.keys())
Archive = Callable[[FrictionLaw], Path]
Times = tuple[float, ...]


@cache
def plant(law: FrictionLaw) -> Model:
    return Mount(name=f"{law.key}_mount", axis=Axis(inertia=30.0), friction=law).model()


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    folder = tmp_path_factory.mktemp("laws")
    return cache(lambda law: export_fmu(plant(law), folder / f"{law.key}.fmu"))


@cache
def tight(law: FrictionLaw, tau: float, speed: float, times: Times) -> np.ndarray:
    """States at some times, a row each."""
    model, x = plant(law), ca.SX.sym("x", len(plant(law).states))
    rates = model.equations(0, x, [tau, 0.0], [variable.start for variable in model.parameters])[0]
    both = [ca.Function("f", [x], [ca.densify(one)]) for one in (rates, ca.jacobian(rates, x))]
    found = [np.array([speed if state.name == "speed" else 0.0 for state in model.states])]
    rate, slope = (lambda t, x, f=f: f(x).full() for f in both)
    for ends in pairwise((0.0, *times)):
        exact = solve_ivp(lambda t, x: rate(t, x)[:, 0], ends, found[-1], "Radau", rtol=1e-12, atol=1e-14, jac=slope)
        found.append(exact.y[:, -1])
    return np.array(found[1:])


def moved(path: Path, law: FrictionLaw, kind: str, step: float, start: tuple[float, float], times: Times) -> np.ndarray:
    """States of the FMU at some times, a row each."""
    names = [state.name for state in plant(law).states]
    result = simulate_fmu(
        str(path), fmi_type=kind, stop_time=times[-1], output_interval=step, output=names,
        start_values={"tau": start[0], "speed": start[1]}, relative_tolerance=1e-9,
    )  # fmt: skip
    rows = np.searchsorted(result["time"], np.array(times) - 1e-9)
    return np.column_stack([result[name][rows] for name in names])


@EACH
@pytest.mark.parametrize(("kind", "tolerance"), [("CoSimulation", 1e-9), ("ModelExchange", 1e-7)])
def test_the_plant_of_every_law_moves_as_a_tight_solver_says(
    archive: Archive, law: FrictionLaw, kind: str, tolerance: float
) -> None:
    """Both ask for 1e-9 a step, relative to the state and 0.01 of its nominal; CVode lets its errors add up."""
    exact, nominals = tight(law, *PUSHED, TIMES), np.array([state.nominal for state in plant(law).states])
    size = np.abs(exact).max(axis=0) + 0.01 * nominals
    assert (np.abs(moved(archive(law), law, kind, 1e-4, PUSHED, TIMES) - exact) / size).max() < tolerance


@EACH
def test_every_law_coasts_from_3_rad_a_second_in_steps_of_1_ms(archive: Archive, law: FrictionLaw) -> None:
    """Where Runge-Kutta 4 is unstable from 0.07 rad/s on."""
    exact = tight(law, 0.0, 3.0, (0.1,))
    found = moved(archive(law), law, "CoSimulation", 1e-3, (0.0, 3.0), (0.1,))
    np.testing.assert_allclose(found, exact, rtol=1e-8)


@pytest.mark.parametrize("motion", ["rotary", "linear"])
@pytest.mark.parametrize("law", [law for law in EXAMPLES.values() if law.states()], ids=lambda law: law.key)
def test_the_contact_keeps_its_torques_as_states_of_the_plant(law: FrictionLaw, motion: str) -> None:
    model = Mount(name="m", axis=Axis(inertia=30.0), friction=law, motion=motion).model()
    found = [state for state in model.states if state.name.startswith("friction.")]
    assert [state.name for state in found] == [f"friction.{state.name}" for state in law.states()]
    assert {state.unit for state in found} == {"N.m" if motion == "rotary" else "N"}
