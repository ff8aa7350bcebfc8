"""Partial derivatives that an FMU tells: directional and adjoint ones agree with differences and with each other."""

import ctypes
from dataclasses import replace
from functools import cache

import export_models as models
import numpy as np
import pytest
from effect_examples import EXAMPLES, mount, simulate, slopes
from export_models import Driver
from fmpy import read_model_description
from hypothesis import given, settings
from hypothesis import strategies as st

from pyfmi_models.card import read_card
from pyfmi_models.effects import ActuatorLag, Cogging
from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Model


@cache
def rich():
    """The paper's plant with a broken exponent, a load that depends on position and a state in the drive."""
    card = read_card("paper_mount")
    effects = Cogging(cycles_per_rev=20, amplitude=0.5, phase=0.3), ActuatorLag(time_constant_ms=2.0)
    return replace(card.plant(), name="rich", friction=replace(card.friction, delta=1.7), effects=effects).model()


# A point to differentiate at, away from the corners of the equations.
POINTS = {
    models.lugre: {"speed": 0.02, "z": 1.5e-5, "drive": 4.0},
    models.oscillator: {"position": 0.7, "velocity": -0.4, "force": 0.2, "stiffness": 3.0},
    rich: {"position": 0.3, "speed": 0.02, "friction.bristle": 1.1, "tau": 4.0, "disturbance": 0.3},
}
both = pytest.mark.parametrize("make", POINTS, ids=lambda make: make.__name__)
library = cache(lambda make: build_library(make()))


def initializing(make, fmi):
    """An instance in initialization mode, where everything may be set and asked."""
    driver = models.Driver(make(), library(make), fmi, "ME")
    start = (False, 0.0, 0.0, False, 0.0)
    assert fmi == 3 or driver.call("SetupExperiment", *start) == "ok"
    assert driver.call("EnterInitializationMode", *(start if fmi == 3 else ())) == "ok"
    assert {driver.set(name, value) for name, value in POINTS[make].items()} == {"ok"}
    return driver


def names_of(make):
    model = make()
    knowns = [variable.name for group in (model.states, model.inputs, model.parameters) for variable in group]
    unknowns = [f"der({state.name})" for state in model.states] + [variable.name for variable in model.outputs]
    return unknowns, knowns


def ask(driver, which, unknowns, knowns, seed, more=0):
    """Directional: seed of the knowns -> change of the unknowns; adjoint: the other way; room for `more` results."""
    references = [(ctypes.c_uint * len(part))(*(driver.references[one] for one in part)) for part in (unknowns, knowns)]
    count = len(knowns if which == "Adjoint" else unknowns) + more
    result = (ctypes.c_double * count)()
    sizes = [ctypes.c_size_t(len(part)) for part in (unknowns, knowns, seed)] + [ctypes.c_size_t(count)]
    lengths = (sizes[2:3], sizes[3:]) if driver.fmi == 3 else ((), ())
    seeds = (ctypes.c_double * len(seed))(*seed)
    arguments = references[0], sizes[0], references[1], sizes[1], seeds, *lengths[0], result, *lengths[1]
    return driver.call(f"Get{which}Derivative", *arguments), np.array(result)


@both
@pytest.mark.parametrize("fmi", [2, 3])
def test_directional_derivatives_are_finite_differences(make, fmi):
    driver = initializing(make, fmi)
    unknowns, knowns = names_of(make)
    for name in knowns:
        here = driver.get(name)[0]
        width = 1e-5 * max(abs(here), 1e-3 if name != "z" else 1e-5)
        ends = []
        for sign in (1, -1):
            assert driver.set(name, here + sign * width) == "ok", driver.messages
            ends.append(driver.get(*unknowns))
        driver.set(name, here)
        status, found = ask(driver, "Directional", unknowns, [name], [1.0])
        rounding = 1e-13 * (np.abs(driver.get(*unknowns)) + 1e-3)
        assert status == "ok"
        assert (np.abs((ends[0] - ends[1]) / 2 - found * width) <= 1e-6 * np.abs(found * width) + rounding).all(), name


@both
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_adjoint_and_directional_derivatives_are_one_matrix(make, data):
    """For every seed: weights . (J seed) = (weights J) . seed."""
    driver, (unknowns, knowns) = initializing(make, 3), names_of(make)
    numbers = st.floats(-2, 2)
    seed = np.array(data.draw(st.lists(numbers, min_size=len(knowns), max_size=len(knowns))))
    weights = np.array(data.draw(st.lists(numbers, min_size=len(unknowns), max_size=len(unknowns))))
    (forward_status, forward), (back_status, back) = (
        ask(driver, "Directional", unknowns, knowns, seed),
        ask(driver, "Adjoint", unknowns, knowns, weights),
    )
    assert (forward_status, back_status) == ("ok", "ok")
    size = np.abs(weights) @ np.abs(forward) + np.abs(back) @ np.abs(seed)
    assert abs(weights @ forward - back @ seed) <= 1e-12 * size + 1e-300


@pytest.mark.parametrize("fmi", [2, 3])
def test_at_a_corner_a_derivative_is_of_one_side_or_between_both(fmi):
    """The bristles' rate w - sigma0 |w| z / g(w) bends at w = 0."""
    driver = initializing(models.lugre, fmi)
    assert driver.set("speed", 0.0) == "ok"
    found = ask(driver, "Directional", ["der(z)"], ["speed"], [1.0])[1][0]
    sides, width = [], 1e-9
    for side in (-width, width):
        driver.set("speed", side)
        sides.append(driver.get("der(z)")[0] / side)
    assert sides[0] - sides[1] > 0.5
    assert sides[1] - 1e-6 <= found <= sides[0] + 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_with_every_effect_the_binary_tells_the_matrix_of_the_equations(seed):
    """All rates and outputs by all states, inputs and parameters of a plant with all effects, column by column."""
    model, random = plant("all"), np.random.default_rng(seed)
    driver = models.Driver(model, build_library(model), 3, "ME")
    assert driver.call("EnterInitializationMode", False, 0.0, 0.0, False, 0.0) == "ok"
    moving = (*model.states, *model.inputs)
    point = {one.name: one.start + 0.3 * one.nominal * random.standard_normal() for one in moving}
    point["dwell_breakaway.age"] = abs(point["dwell_breakaway.age"])  # no contact is younger than new
    assert {driver.set(name, value) for name, value in point.items()} == {"ok"}, driver.messages
    knowns = [one.name for group in (model.states, model.inputs, model.parameters) for one in group]
    unknowns = [f"der({state.name})" for state in model.states] + [one.name for one in model.outputs]
    exact = slopes(model)([0.0, *driver.get(*knowns)])[1].full()[:, 1:]
    forward = np.array([ask(driver, "Directional", unknowns, [name], [1.0])[1] for name in knowns]).T
    back = np.array([ask(driver, "Adjoint", [name], knowns, [1.0])[1] for name in unknowns])
    size = np.abs(exact).max(axis=1, keepdims=True)
    np.testing.assert_allclose(forward / size, exact / size, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(back / size, exact / size, rtol=1e-9, atol=1e-13)


def test_a_subset_in_any_order_gives_the_same_entries():
    driver = initializing(rich, 3)
    unknowns, knowns = names_of(rich)
    weights = np.arange(1.0, len(unknowns) + 1)
    whole = ask(driver, "Adjoint", unknowns, knowns, weights)[1]
    chosen = [knowns[i] for i in (4, 0, 2)]
    order = list(reversed(range(len(unknowns))))
    part = ask(driver, "Adjoint", [unknowns[i] for i in order], chosen, weights[order])[1]
    assert list(part) == [whole[4], whole[0], whole[2]]


@pytest.mark.parametrize(("which", "fmi"), [("Directional", 2), ("Directional", 3), ("Adjoint", 3)])
def test_a_derivative_is_of_what_is_calculated_by_what_is_not(which, fmi):
    driver = initializing(models.lugre, fmi)
    assert ask(driver, which, ["drive"], ["speed"], [1.0])[0] == "error"
    assert driver.messages[-1][2] == '"drive" is not calculated: it has no derivative'
    assert ask(driver, which, ["torque"], ["reading"], [1.0])[0] == "error"
    assert driver.messages[-1][2] == '"reading" is calculated: no derivative with respect to it'
    controller = models.Driver(models.controller(), library(models.controller), fmi).start()
    assert ask(controller, which, ["command"], ["wanted"], [1.0])[0] == "error"
    assert "a sampled model has no partial derivatives" in controller.messages[-1][2]


@pytest.mark.parametrize("which", ["Directional", "Adjoint"])
def test_derivatives_take_and_give_as_many_numbers_as_there_are_variables(which):
    driver = initializing(models.lugre, 3)
    unknowns, knowns = names_of(models.lugre)
    many = len(unknowns if which == "Adjoint" else knowns)
    for seeds, more in ((many + 1, 0), (many, 1), (many, -1)):
        assert ask(driver, which, unknowns, knowns, [1.0] * seeds, more)[0] == "error"
        assert driver.messages[-1][2].endswith("scalar variables")
    assert ask(driver, which, unknowns, knowns, [1.0] * many)[0] == "ok"


@pytest.mark.parametrize(("fmi", "flag"), [(2, "providesDirectionalDerivative"), (3, "providesAdjointDerivatives")])
@pytest.mark.parametrize(("make", "promised"), [(models.oscillator, True), (models.controller, False)])
def test_a_description_says_whether_there_are_derivatives(make, promised, fmi, flag, tmp_path):
    description = read_model_description(str(export_fmu(make(), tmp_path / "one.fmu", fmi=fmi)))
    assert getattr(description.modelExchange, flag) == getattr(description.coSimulation, flag) == promised


# Plants with every effect of the catalogue, as FMUs: their steps are the equations, solved.

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
