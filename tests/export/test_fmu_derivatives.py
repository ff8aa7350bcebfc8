"""Partial derivatives that an FMU tells: directional and adjoint ones agree with differences and with each other."""

from functools import cache

import export_models as models
import numpy as np
import pytest
from effect_examples import EXAMPLES, mount, simulate, slopes
from export_models import Driver, library
from fmpy import read_model_description
from friction_laws import EXAMPLES as LAWS

from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.friction import LuGre

POINT = {"speed": 0.02, "z": 1.5e-5, "drive": 4.0}
"""Of the LuGre model: away from the corners of its equations."""


def initializing(fmi):
    """An instance of the LuGre model in initialization mode, where everything may be set and asked."""
    return Driver(models.lugre(), library(models.lugre), fmi, "ME").initialize(**POINT)


def names_of(model):
    knowns = [variable.name for group in (model.states, model.inputs, model.parameters) for variable in group]
    unknowns = [f"der({state.name})" for state in model.states] + [variable.name for variable in model.outputs]
    return unknowns, knowns


@pytest.mark.parametrize("fmi", [2, 3])
def test_at_a_corner_a_derivative_is_of_one_side_or_between_both(fmi):
    """The bristles' rate w - sigma0 |w| z / g(w) bends at w = 0."""
    driver = initializing(fmi)
    assert driver.set("speed", 0.0) == "ok"
    found = driver.derivative("Directional", ["der(z)"], ["speed"], [1.0])[1][0]
    sides, width = [], 1e-9
    for side in (-width, width):
        driver.set("speed", side)
        sides.append(driver.get("der(z)")[0] / side)
    assert sides[0] - sides[1] > 0.5
    assert sides[1] - 1e-6 <= found <= sides[0] + 1e-6


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("fmi", [2, 3])
def test_with_every_effect_the_binary_tells_the_matrix_of_the_equations(fmi, seed):
    """All rates and outputs by all states, inputs and parameters of a plant with all effects: columns, rows, sums."""
    model, random = plant("all"), np.random.default_rng(seed)
    driver = Driver(model, build_library(model), fmi, "ME").initialize()
    moving = (*model.states, *model.inputs)
    point = {one.name: one.start + 0.3 * one.nominal * random.standard_normal() for one in moving}
    point["dwell_breakaway.age"] = abs(point["dwell_breakaway.age"])  # no contact is younger than new
    assert {driver.set(name, value) for name, value in point.items()} == {"ok"}, driver.messages
    unknowns, knowns = names_of(model)
    exact = slopes(model)([0.0, *driver.get(*knowns)])[1].full()[:, 1:]
    forward = np.array([driver.derivative("Directional", unknowns, [name], [1.0])[1] for name in knowns]).T
    size = np.abs(exact).max(axis=1, keepdims=True)
    np.testing.assert_allclose(forward / size, exact / size, rtol=1e-9, atol=1e-13)
    way, weights = random.uniform(-2, 2, len(knowns)), random.uniform(-2, 2, len(unknowns))
    found, scale = driver.derivative("Directional", unknowns, knowns, way)[1], np.abs(exact) @ np.abs(way)
    np.testing.assert_allclose(found / scale, exact @ way / scale, atol=1e-12)
    if fmi == 3:
        back = np.array([driver.derivative("Adjoint", [name], knowns, [1.0])[1] for name in unknowns])
        np.testing.assert_allclose(back / size, exact / size, rtol=1e-9, atol=1e-13)
        found, scale = driver.derivative("Adjoint", unknowns, knowns, weights)[1], np.abs(weights) @ np.abs(exact)
        np.testing.assert_allclose(found, weights @ exact, atol=1e-12 * scale.max())


def test_a_subset_in_any_order_gives_the_same_entries():
    driver, (unknowns, knowns) = initializing(3), names_of(models.lugre())
    weights = np.arange(1.0, len(unknowns) + 1)
    whole = driver.derivative("Adjoint", unknowns, knowns, weights)[1]
    chosen = [knowns[i] for i in (4, 0, 2)]
    part = driver.derivative("Adjoint", unknowns[::-1], chosen, weights[::-1])[1]
    assert list(part) == [whole[4], whole[0], whole[2]]


@pytest.mark.parametrize(("which", "fmi"), [("Directional", 2), ("Directional", 3), ("Adjoint", 3)])
def test_a_derivative_is_of_what_is_calculated_by_what_is_not(which, fmi):
    driver = initializing(fmi)
    assert driver.derivative(which, ["drive"], ["speed"], [1.0])[0] == "error"
    assert driver.messages[-1][2] == '"drive" is not calculated: it has no derivative'
    assert driver.derivative(which, ["torque"], ["reading"], [1.0])[0] == "error"
    assert driver.messages[-1][2] == '"reading" is calculated: no derivative with respect to it'
    controller = Driver(models.controller(), library(models.controller), fmi).start()
    assert controller.derivative(which, ["command"], ["wanted"], [1.0])[0] == "error"
    assert "a sampled model has no partial derivatives" in controller.messages[-1][2]


@pytest.mark.parametrize("which", ["Directional", "Adjoint"])
def test_derivatives_take_and_give_as_many_numbers_as_there_are_variables(which):
    driver = initializing(3)
    unknowns, knowns = names_of(models.lugre())
    many = len(unknowns if which == "Adjoint" else knowns)
    for seeds, more in ((many + 1, 0), (many, 1), (many, -1)):
        assert driver.derivative(which, unknowns, knowns, [1.0] * seeds, more)[0] == "error"
        assert driver.messages[-1][2].endswith("scalar variables")
    assert driver.derivative(which, unknowns, knowns, [1.0] * many)[0] == "ok"


@pytest.mark.parametrize(("fmi", "flag"), [(2, "providesDirectionalDerivative"), (3, "providesAdjointDerivatives")])
@pytest.mark.parametrize(("make", "promised"), [(models.oscillator, True), (models.controller, False)])
def test_a_description_says_whether_there_are_derivatives(make, promised, fmi, flag, tmp_path):
    description = read_model_description(str(export_fmu(make(), tmp_path / "one.fmu", fmi=fmi)))
    assert getattr(description.modelExchange, flag) == getattr(description.coSimulation, flag) == promised


# Plants with every effect of the catalogue, as FMUs: their steps are the equations, solved.

LAW = LuGre(sigma0=2e4, sigma1=200.0, sigma2=3.0, Fc=1.0, Fs=1.5, Vs=0.05)
PLANTS = {
    "all": mount(*[one for one in EXAMPLES if one.id != "presliding"], friction=LAW),
    "presliding": mount(*[one for one in EXAMPLES if one.id in ("presliding", "delay")], friction=LAW),
    **{f"{key} friction": mount(friction=law) for key, law in LAWS.items()},
}
"""Presliding would replace the bristles of the law, so it comes by itself."""
plant = cache(lambda chosen: PLANTS[chosen].model())


@pytest.mark.parametrize("chosen", PLANTS)
def test_an_fmu_steps_as_its_equations_say(chosen):
    """Values at the end of each span of a torque, with reversals: a tight implicit method and the FMU."""
    model, span = plant(chosen), 0.03 if "friction" in chosen else 0.1
    given = {"disturbance": 0.4, "temperature": 33.0}
    inputs = {one.name: given[one.name] for one in model.inputs if one.name in given}
    shown = tuple(one.name for one in (*model.outputs, *model.states))
    driver, start, expected, found = Driver(model, build_library(model), 3).start(tolerance=1e-9, **inputs), {}, [], []
    for now, torque in ((0.0, 6.0), (span, -9.0), (2 * span, 9.0)):
        run = simulate(model, np.array([now, now + span]), lambda t, torque=torque: torque, start, **inputs)
        start = {state.name: run[state.name][-1] for state in model.states}
        expected.append([run[name][-1] for name in shown])
        driver.set("tau", torque)
        found.append(driver.run(now, round(span / 1e-3), 1e-3).get(*shown))
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-6)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-6)
    assert np.all(np.abs(expected)[:, :2].max(axis=0) > 1e-4)  # it moved
