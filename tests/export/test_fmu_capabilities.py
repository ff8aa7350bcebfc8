"""What our FMUs announce, and what a user may rely on beside: memory, time, threads, bounded work."""

import ctypes
import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import export_models as models
import numpy as np
import pytest
from export_models import everything, instance, library

from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.codegen import SHIM, generate
from pyfmi_models.export.platforms import PLATFORMS, host

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


def test_a_serialized_state_continues_in_another_process():
    """Plant and controller, FMI 2 and 3, saved in the middle of a run: bit for bit what goes on here."""
    cases, here = [], []
    for make in (models.lugre, models.controller):
        for fmi in (2, 3):
            driver = instance(make, fmi, **({"drive": 4.0} if make is models.lugre else {"wanted": 1.0}))
            content = driver.run(0, 100, 1e-3).serialize(driver.save())
            cases.append((make.__name__, str(library(make)), fmi, content.hex()))
            here.append(everything(driver.run(0.1, 50, 1e-3)).hex())
    paths = ":".join([*sys.path, str(Path(models.__file__).parent)])
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
