"""What our FMUs announce, and what a user may rely on beside: memory, time, threads, bounded work."""

import ctypes
import json
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import export_models as models
import numpy as np
import pytest
from fuzz_rules import sealed

from pyfmi_models.export import build_library
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.codegen import SHIM
from pyfmi_models.export.platforms import PLATFORMS, host

both = pytest.mark.parametrize("fmi", [2, 3])
library = cache(lambda make: build_library(make()))


def instance(make, fmi, kind="CS", **start):
    return models.Driver(make(), library(make), fmi, kind).start(**start)


def everything(driver):
    return driver.get(*driver.references).tobytes()


CONTINUE = """
import json, sys
from pathlib import Path
import export_models as models
for name, library, fmi, content in json.load(sys.stdin):
    driver = models.Driver(getattr(models, name)(), Path(library), fmi)
    assert driver.restore(driver.deserialize(bytes.fromhex(content))) == "ok"
    print(driver.run(0.1, 50, 1e-3).get(*driver.references).tobytes().hex())
"""


def test_a_serialized_state_continues_in_another_process():
    """Plant and controller, FMI 2 and 3, saved in the middle of a run: bit for bit what goes on here."""
    cases, here = [], []
    for make in (models.lugre, models.controller):
        for fmi in (2, 3):
            driver = instance(make, fmi, **({"drive": 4.0} if make is models.lugre else {"wanted": 1.0}))
            content = driver.run(0, 100, 1e-3).serialize(driver.save())
            cases.append((make.__name__, str(library(make)), fmi, content.hex()))
            here.append(everything(driver.run(0.1, 50, 1e-3)).hex())
    paths = ":".join([*sys.path, str(Path(__file__).parent)])
    done = subprocess.run([sys.executable, "-c", CONTINUE], input=json.dumps(cases), text=True, capture_output=True,
                          check=False, env={"PYTHONPATH": paths})  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == here


def test_a_state_serialized_in_one_version_of_fmi_goes_on_in_the_other():
    """One archive binary serves both; the same bits."""
    two, three = (instance(models.lugre, fmi, drive=4.0) for fmi in (2, 3))
    content = two.run(0, 100, 1e-3).serialize(two.save())
    assert three.restore(three.deserialize(content)) == "ok"
    assert everything(three.run(0.1, 50, 1e-3)) == everything(two.run(0.1, 50, 1e-3))


@both
def test_an_instance_goes_on_from_a_state_of_another_however_far_it_went_itself(fmi):
    first, second = instance(models.lugre, fmi, drive=5.0), instance(models.lugre, fmi, drive=-3.0)
    first.run(0, 20, 1e-3)
    state = first.save()
    second.run(0, 333, 3e-4)
    assert second.restore(state) == "ok"
    assert everything(second.run(0.02, 20, 1e-3)) == everything(first.run(0.02, 20, 1e-3))


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
    assert library(models.lugre)  # what is asked of libc besides is in the table of its symbols
    listing = subprocess.run(
        ["nm", "-Du", str(library(models.lugre))], capture_output=True, text=True, check=True
    ).stdout
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
def test_a_step_that_would_take_minutes_fails_in_seconds_and_names_the_culprit(fmi):
    driver = instance(models.oscillator, fmi, tolerance=1e-13)
    before, started = everything(driver), time.process_time()
    assert driver.step(0, 1e7) == "error"
    assert time.process_time() - started < 10  # about 1 s on a machine of its own
    message = driver.messages[-1][2]
    assert "solver steps reach t = " in message
    assert 'because of "position"' in message or 'because of "velocity"' in message
    assert everything(driver) == before
    assert driver.step(0, 0.1) == "ok"


@both
def test_more_ticks_than_a_second_can_hold_are_refused_at_once(fmi):
    driver = instance(models.controller, fmi)
    before = everything(driver)
    assert driver.step(0, 1e9) == "error"
    assert "1e+12 ticks of 0.001 s are due at t = 1000000000 s; one call executes at most " in driver.messages[-1][2]
    assert everything(driver) == before
    assert driver.step(0, 1e-3) == "ok"


def test_a_master_of_model_exchange_that_skips_events_is_told():
    driver = instance(models.controller, 3, "ME")
    driver.call("SetTime", 1e9)
    flags = [ctypes.byref(ctypes.c_bool()) for _ in range(5)]
    assert driver.call("UpdateDiscreteStates", *flags, ctypes.byref(ctypes.c_double())) == "error"
    assert "ticks of 0.001 s are due" in driver.messages[-1][2]


@both
def test_a_start_time_that_swallows_the_period_is_refused(fmi):
    driver = models.Driver(models.controller(), library(models.controller), fmi)
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


# call: in which modes of model exchange and of co-simulation it is allowed, as the standards' tables say
MODES = {
    "instantiated": set(),
    "initialization": {"get", "derivative"},
    "event": {"get", "derivative", "time", "continuous"},
    "continuous": {"get", "derivative", "time", "states", "completed", "event"},
    "step": {"get", "derivative", "step"},
    "terminated": {"get", "derivative"},
}


def in_mode(mode, fmi):
    driver = models.Driver(models.lugre(), library(models.lugre), fmi, "CS" if mode == "step" else "ME")
    start = (False, 0.0, 0.0, False, 0.0)
    if mode == "instantiated":
        return driver
    if fmi == 2:
        driver.call("SetupExperiment", *start)
    driver.call("EnterInitializationMode", *(start if fmi == 3 else ()))
    if mode == "initialization":
        return driver
    driver.call("ExitInitializationMode")
    if mode == "continuous":
        driver.call("EnterContinuousTimeMode")
    if mode == "terminated":
        driver.call("Terminate")
    return driver


def attempts(driver):
    one, number = ctypes.c_size_t(1), ctypes.byref(ctypes.c_double(1.0))
    torque, speed = (ctypes.byref(ctypes.c_uint(driver.references[name])) for name in ("torque", "speed"))
    lengths = (one,) if driver.fmi == 3 else ()
    flags = ctypes.byref(ctypes.c_int()), ctypes.byref(ctypes.c_int())
    three = (ctypes.c_double * 3)()
    return {
        "get": lambda: driver.get("torque"),
        "derivative": lambda: driver.call(
            "GetDirectionalDerivative", torque, one, speed, one, number, *lengths, number, *lengths
        ),
        "time": lambda: driver.call("SetTime", 0.0),
        "states": lambda: driver.call("SetContinuousStates", three, ctypes.c_size_t(3)),
        "completed": lambda: driver.call("CompletedIntegratorStep", 1, *flags),
        "step": lambda: driver.step(0, 1e-3),
        "event": lambda: driver.call("EnterEventMode"),
        "continuous": lambda: driver.call("EnterContinuousTimeMode"),
    }


@both
@pytest.mark.parametrize("mode", MODES)
def test_a_call_is_allowed_in_the_modes_of_the_standard(mode, fmi):
    answers = {}
    for name in attempts(in_mode(mode, fmi)):
        driver = in_mode(mode, fmi)
        answer = attempts(driver)[name]()
        answers[name] = not isinstance(answer, str) or answer == "ok"
        assert answers[name] or driver.messages, f"{name} is refused in silence"
    allowed = {name for name, is_allowed in answers.items() if is_allowed}
    assert allowed - ({"event"} if mode == "event" else set()) == MODES[mode]


@both
@pytest.mark.parametrize("make", [models.lugre, models.controller])
def test_a_saved_state_is_that_of_its_point_whatever_was_asked_before(make, fmi):
    driver = instance(make, fmi).run(0, 10, 1e-3)
    before = driver.serialize(driver.save())
    everything(driver)
    assert driver.serialize(driver.save()) == before


@both
def test_a_refused_state_leaves_the_saved_one_in_whose_place_it_was_to_go(fmi):
    driver = instance(models.lugre, fmi, drive=4.0).run(0, 10, 1e-3)
    state = driver.save()
    content = driver.serialize(state)
    forged = bytearray(content[:-8])
    forged[52:56] = (63).to_bytes(4, "little")  # a mode that there is not
    forged = sealed(bytes(forged))
    name = "DeSerializeFMUstate" if fmi == 2 else "DeserializeFMUState"
    assert driver.call(name, forged, ctypes.c_size_t(len(forged)), ctypes.byref(state)) == "error"
    assert "no run ends in such a state" in driver.messages[-1][2]
    assert driver.serialize(state) == content


@both
@pytest.mark.parametrize("kind", ["CS", "ME"])
def test_a_tick_that_fails_takes_those_before_it_back(fmi, kind):
    """Root of 4 - count: five ticks have one, the sixth has none."""
    driver = instance(models.root_of_a_count, fmi, kind)
    before = driver.serialize(driver.save())
    if kind == "CS":
        assert driver.step(0, 8e-3) == "error"
    else:
        driver.call("SetTime", 8e-3)
        before = driver.serialize(driver.save())
        room = ctypes.create_string_buffer(64)
        flags = [ctypes.byref(ctypes.c_bool()) for _ in range(5)]
        arguments = (room,) if fmi == 2 else (*flags, ctypes.byref(ctypes.c_double()))
        assert driver.call("NewDiscreteStates" if fmi == 2 else "UpdateDiscreteStates", *arguments) == "error"
    assert '"root" is not finite after the tick at t = 0.005' in driver.messages[-1][2]
    assert driver.serialize(driver.save()) == before
    assert list(driver.get("count")) == [0.0]


@both
def test_a_seed_that_is_not_finite_is_refused_by_name(fmi):
    driver = instance(models.lugre, fmi)
    names = ("torque", "speed")
    torque, speed = (ctypes.byref(ctypes.c_uint(driver.references[name])) for name in names)
    one, seed, result = ctypes.c_size_t(1), ctypes.byref(ctypes.c_double(float("nan"))), (ctypes.c_double * 1)()
    lengths = (one,) if fmi == 3 else ()
    arguments = (torque, one, speed, one, seed, *lengths, result, *lengths)
    assert driver.call("GetDirectionalDerivative", *arguments) == "error"
    assert driver.messages[-1][2] == 'the seed nan of "speed" is not finite'


def test_an_importer_that_asks_for_event_mode_in_co_simulation_gets_a_sentence():
    said, logger = [], models.LOGGER3(lambda e, status, category, message: said.append(message.decode()))
    create = ctypes.CDLL(str(library(models.lugre))).fmi3InstantiateCoSimulation
    create.restype = ctypes.c_void_p
    token = models.generate(models.lugre()).token.encode()
    none = (None, ctypes.c_size_t(0), None)
    assert create(b"it", token, None, False, False, True, False, *none, logger, None) is None
    assert said == ["event mode is not available in co-simulation"]


def test_scheduled_execution_is_refused_with_a_sentence():
    said, logger = [], models.LOGGER3(lambda e, status, category, message: said.append(message.decode()))
    create = ctypes.CDLL(str(library(models.lugre))).fmi3InstantiateScheduledExecution
    create.restype = ctypes.c_void_p
    token = models.generate(models.lugre()).token.encode()
    assert create(b"it", token, None, False, False, None, logger, None, None, None) is None
    assert said == ["the model has no scheduled execution"]


@both
def test_nothing_is_read_from_the_folder_of_resources(fmi, monkeypatch):
    """There is none to miss: the same bits with a folder that does not exist, and without one."""
    found = []
    for folder in (b"file:///there/is/nothing", None):
        monkeypatch.setattr(models, "RESOURCES", folder)
        found.append(everything(instance(models.lugre, fmi, drive=5.0).run(0, 20, 1e-3)))
    assert found[0] == found[1]


@both
def test_where_the_equations_have_no_value_model_exchange_may_try_a_smaller_step(fmi):
    driver = instance(models.undefined_below_zero, fmi, "ME")
    driver.call("EnterContinuousTimeMode")
    assert driver.call("SetContinuousStates", ctypes.byref(ctypes.c_double(-1.0)), ctypes.c_size_t(1)) == "ok"
    assert driver.get("flow") == "discard"
    assert driver.call("SetContinuousStates", ctypes.byref(ctypes.c_double(4.0)), ctypes.c_size_t(1)) == "ok"
    assert driver.get("flow") == 2.0


@both
def test_an_input_beyond_its_bounds_is_taken(fmi):
    driver = instance(models.lugre, fmi)
    assert driver.set("drive", 1000.0) == "ok"
    assert driver.get("drive") == 1000.0
