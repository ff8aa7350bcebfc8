"""What our FMUs announce: derivatives; what a user may rely on beside: memory, time, threads, bounded work."""

import ctypes
import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path

import export_models as models
import numpy as np
import pytest
from effect_examples import EXAMPLES, mount, simulate, slopes
from export_models import Driver, everything, instance, library
from fmpy import read_model_description
from friction_laws import EXAMPLES as LAWS

from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.codegen import SHIM, generate
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.friction import LuGre

both = pytest.mark.parametrize("fmi", [2, 3])

CONTINUE = """
import json, sys
from pathlib import Path
import export_models as models
for name, library, fmi, content in json.load(sys.stdin):
    driver = models.Driver(getattr(models, name)(), Path(library), fmi)
    assert driver.restore(driver.deserialize(bytes.fromhex(content))) == "ok"
    print(driver.run(0.1, 50, 1e-3).get(*driver.references).tobytes().hex())
"""


def test_a_serialized_state_continues_in_another_process_and_another_version_of_fmi():
    """Plant and controller, saved in the middle of a run: bit for bit what goes on here."""
    cases, here = [], []
    for make, saved, later in product((models.lugre, models.controller), (2, 3), (2, 3)):
        driver = instance(make, saved, **({"drive": 4.0} if make is models.lugre else {"wanted": 1.0}))
        content = driver.run(0, 100, 1e-3).serialize(driver.save())
        cases.append((make.__name__, str(library(make)), later, content.hex()))
        here.append(everything(driver.run(0.1, 50, 1e-3)).hex())
    paths = ":".join([*sys.path, str(Path(models.__file__).parent)])
    done = subprocess.run([sys.executable, "-c", CONTINUE], input=json.dumps(cases), text=True, capture_output=True,
                          check=False, env={"PYTHONPATH": paths})  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == here


def test_instances_in_threads_give_the_bits_that_they_give_alone():
    """Eight at once, plants and controllers, FMI 2 and 3; Python lets go of its lock inside each call."""

    def run(case):
        make, fmi, start = case
        return everything(instance(make, fmi, **start).run(0, 400, 0.01))

    cases = [(models.lugre, fmi, {"drive": drive}) for fmi in (2, 3) for drive in (5.0, -3.5, 1.0)]
    cases += [(models.controller, fmi, {"wanted": 2.0}) for fmi in (2, 3)]
    alone = [run(case) for case in cases]
    with ThreadPoolExecutor(len(cases)) as pool:
        assert list(pool.map(run, cases)) == alone


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="readelf reads Linux libraries")
@pytest.mark.parametrize("make", [models.lugre, models.controller])
def test_there_is_no_global_state(make):
    """No section that a running program could write to, beside the loader's own tables."""
    listing = subprocess.run(["readelf", "-SW", str(library(make))], capture_output=True, text=True, check=True).stdout
    sections = {line.split("]")[1].split()[0] for line in listing.splitlines() if "]" in line and "Nr]" not in line}
    assert ".text" in sections
    assert sections & {".data", ".bss", ".tdata", ".tbss"} == set()


def test_only_instantiation_and_saving_a_state_allocate():
    calls = {path.name: re.findall(r"\b(?:m|c|re)alloc\(", path.read_text()) for path in SHIM.glob("*.[ch]")}
    assert {name: found for name, found in calls.items() if found} == {
        "instance.c": ["calloc("],
        "memory.c": ["malloc("],
    }
    symbols = ["nm", "-Du", str(library(models.lugre))]  # what is asked of libc besides
    listing = subprocess.run(symbols, capture_output=True, text=True, check=True).stdout
    assert not {line.split()[-1].split("@")[0] for line in listing.splitlines()} & {"exit", "abort", "printf", "fopen"}


DRIVE = b"""
typedef int Step2(void *, double, double, int);
typedef int Step3(void *, double, double, _Bool, _Bool *, _Bool *, _Bool *, double *);
double drive(void *instance, void *step, int fmi, double start, double length, long count, int summed) {
    _Bool flags[3];
    double time = start, last;
    for (long k = 0; k < count; k++) {
        int status = fmi == 2 ? ((Step2 *)step)(instance, time, length, 1)
                              : ((Step3 *)step)(instance, time, length, 1, flags, flags + 1, flags + 2, &last);
        if (status) return -1;
        time = summed ? time + length : start + (k + 1) * length;
    }
    return time;
}
"""


@pytest.mark.parametrize("summed", [False, True], ids=["time counted", "time summed up"])
@both
def test_ten_million_ticks_do_not_drift(fmi, summed):
    """Each step of one period executes one tick, at k times the period, whatever the master's own time has lost."""
    machine, flags = PLATFORMS[host()], ("-std=c11", "-O2", "-shared", "-fPIC")
    drive = ctypes.CDLL(str(compile_shared({"drive.c": DRIVE}, f"drive{machine.suffix}", machine.target, flags))).drive
    drive.restype = ctypes.c_double
    driver, count = instance(models.controller, fmi), 10_000_000
    arguments = [ctypes.c_double(0), ctypes.c_double(1e-3), ctypes.c_long(count), int(summed)]
    time = drive(ctypes.c_void_p(driver.instance), driver.library[f"fmi{fmi}DoStep"], fmi, *arguments)
    assert (time == 10_000.0) != summed  # a summed time has drifted itself by now
    assert list(driver.get("count", "moment")) == [count, (count - 1) * 1e-3]


@both
@pytest.mark.parametrize(
    ("make", "length", "said"),
    [
        (models.oscillator, 1e7, f"{generate(models.oscillator()).most_steps} solver steps reach t = "),
        (models.oscillator, 1e7, 'because of "'),
        (models.controller, 1e9, "1e+12 ticks of 0.001 s are due at t = 1000000000 s; one call executes at most "),
    ],
    ids=["steps of the solver", "the culprit", "ticks"],
)
def test_a_step_that_would_take_minutes_fails_and_leaves_all_as_it_was(make, length, said, fmi):
    driver = instance(make, fmi, tolerance=1e-13)
    before = everything(driver)
    assert driver.step(0, length) == "error"
    assert said in driver.messages[-1][2]
    assert everything(driver) == before
    assert driver.step(0, 1e-3) == "ok"


def test_a_master_of_model_exchange_that_skips_events_is_told():
    driver = instance(models.controller, 3, "ME")
    driver.call("SetTime", 1e9)
    assert driver.update() == "error"
    assert "ticks of 0.001 s are due" in driver.messages[-1][2]


@pytest.mark.parametrize(
    ("kind", "arguments", "said"),
    [
        ("CoSimulation", (True, False, None, ctypes.c_size_t(0), None), "event mode is not available in co-simulation"),
        ("ScheduledExecution", (None,), "the model has no scheduled execution"),
    ],
)
def test_what_a_model_does_not_offer_is_refused_with_a_sentence(kind, arguments, said):
    heard, logger = [], models.LOGGER3(lambda e, status, category, message: heard.append(message.decode()))
    create = getattr(ctypes.CDLL(str(library(models.lugre))), f"fmi3Instantiate{kind}")
    create.restype = ctypes.c_void_p
    token = models.generate(models.lugre()).token.encode()
    assert create(b"it", token, None, False, False, *arguments, logger, None, None, None) is None
    assert heard == [said]


@both
def test_a_start_time_that_swallows_the_period_is_refused(fmi):
    driver = Driver(models.controller(), library(models.controller), fmi)
    arguments = (False, 0.0, 1e12, False, 0.0)
    name = "SetupExperiment" if fmi == 2 else "EnterInitializationMode"
    assert driver.call(name, *arguments) == "error"
    assert "near the start time 1000000000000 s a number cannot tell one tick from the next" in driver.messages[-1][2]


@both
def test_steps_of_any_length_follow_each_other(fmi):
    """One solution, whatever the master's steps: random ones, very short ones, one long one."""
    lengths = np.random.default_rng(3).uniform(1e-6, 0.02, 60)
    driver = instance(models.lugre, fmi, drive=5.0)
    time = 0.0
    for length in lengths:
        assert driver.step(time, length) == "ok"
        time += length
    other = instance(models.lugre, fmi, drive=5.0)
    assert other.step(0, time) == "ok"
    names = ("angle", "speed", "z")
    assert driver.get(*names) == pytest.approx(other.get(*names), rel=2e-7)


# Partial derivatives: directional and adjoint ones are the matrix of the equations.

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
