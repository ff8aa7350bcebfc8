"""Plants with every effect of the catalogue, as FMUs: their steps are the equations, solved."""

import numpy as np
import pytest
from effect_examples import EXAMPLES, mount, simulate
from export_models import Driver

from pyfmi_models.export import build_library
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Model

STEP = 1e-3
LAW = LuGre(sigma0=2e4, sigma1=200.0, sigma2=3.0, Fc=1.0, Fs=1.5, Vs=0.05)
SETS = {
    "all": [one for one in EXAMPLES if one.id != "presliding"],
    "presliding": [one for one in EXAMPLES if one.id in ("presliding", "delay")],
}
"""Presliding would replace the bristles of the law, so it comes by itself."""
INPUTS = {"disturbance": 0.4, "temperature": 33.0}


def plant(chosen: str) -> Model:
    """A plant with one of the sets of effects."""
    return mount(*SETS[chosen], friction=LAW).model()


def by_equations(model: Model, torques: dict[float, float], shown: tuple[str, ...], **inputs: float) -> np.ndarray:
    """Values at the end of each span: torques by the time up to which they act; a tight implicit method."""
    now, start, rows = 0.0, {}, []
    for until, torque in torques.items():
        run = simulate(model, np.array([now, until]), lambda t, torque=torque: torque, start, **inputs)
        now, start = until, {state.name: run[state.name][-1] for state in model.states}
        rows.append([run[name][-1] for name in shown])
    return np.array(rows)


def by_fmu(
    driver: Driver, torques: dict[float, float], shown: tuple[str, ...], tolerance: float, **inputs: float
) -> np.ndarray:
    now, rows = 0, []
    driver.start(tolerance=tolerance, **inputs)
    for until, torque in torques.items():
        driver.set("tau", torque)
        driver.run(now * STEP, round(until / STEP) - now, STEP)
        now = round(until / STEP)
        rows.append(driver.get(*shown))
    return np.array(rows)


@pytest.mark.parametrize("chosen", SETS)
def test_an_fmu_with_many_effects_steps_as_its_equations_say(chosen: str) -> None:
    model = plant(chosen)
    torques = {0.1: 6.0, 0.2: -5.0, 0.3: 9.0}
    inputs = {name: value for name, value in INPUTS.items() if name in {one.name for one in model.inputs}}
    shown = tuple(one.name for one in (*model.outputs, *model.states))
    expected = by_equations(model, torques, shown, **inputs)
    found = by_fmu(Driver(model, build_library(model), 3), torques, shown, 1e-9, **inputs)
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-6)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-6)
    assert np.all(np.abs(expected[:, :2]).max(axis=0) > 1e-4)  # it moved
