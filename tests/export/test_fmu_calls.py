"""The binary behind the archive: exact memory, counted time, honest errors, and what is allowed in which mode."""

import ctypes
from math import inf, nan

import export_models as models
import fuzz_models
import numpy as np
import pytest
from export_models import everything, instance, library
from fuzz_calls import functions
from fuzz_rules import sealed

from pyfmi_models.export.build import compile_shared, sources_of
from pyfmi_models.export.platforms import PLATFORMS, host

pytestmark = pytest.mark.parametrize("fmi", [2, 3])


# Memory


@pytest.mark.parametrize("make", [models.lugre, models.controller, models.oscillator])
def test_a_saved_state_is_that_of_its_point_and_a_restored_run_repeats_its_bits(make, fmi):
    driver = instance(make, fmi)
    step, name = 1e-3, {"lugre": "drive", "controller": "wanted", "oscillator": "force"}[make.__name__]
    driver.set(name, 4.0)
    driver.run(0, 100, step)
    state = driver.save()
    everything(driver)
    assert driver.serialize(driver.save()) == driver.serialize(state), "whatever was asked before"
    driver.set(name, -3.0)
    once = everything(driver.run(100 * step, 100, step))
    assert driver.restore(state) == "ok"
    driver.set(name, -3.0)
    assert everything(driver.run(100 * step, 100, step)) == once
    assert driver.call("FreeFMUstate" if fmi == 2 else "FreeFMUState", ctypes.byref(state)) == "ok"
    assert state.value is None


def test_a_damaged_or_foreign_state_is_refused_and_leaves_the_one_in_whose_place_it_was_to_go(fmi):
    driver = instance(models.lugre, fmi, drive=4.0).run(0, 10, 1e-3)
    state = driver.save()
    content = driver.serialize(state)
    damaged = bytes([*content[:60], content[60] ^ 1, *content[61:]])
    assert driver.deserialize(damaged) == "error"
    assert "corrupted" in driver.messages[-1][2]
    assert driver.deserialize(content[:-1]) == "error"
    assert f"this model's has {len(content)}" in driver.messages[-1][2]
    assert driver.restore(instance(models.oscillator, fmi).save()) == "error"
    assert "another model" in driver.messages[-1][2]
    assert instance(models.lugre, fmi, "ME").restore(driver.save()) == "error"
    forged = bytearray(content[:-8])
    forged[52:56] = (63).to_bytes(4, "little")  # a mode that there is not
    forged = sealed(bytes(forged))
    name = "DeSerializeFMUstate" if fmi == 2 else "DeserializeFMUState"
    assert driver.call(name, forged, ctypes.c_size_t(len(forged)), ctypes.byref(state)) == "error"
    assert "no run ends in such a state" in driver.messages[-1][2]
    assert driver.serialize(state) == content


def test_reset_returns_to_the_start(fmi):
    driver = instance(models.lugre, fmi)
    fresh = everything(driver)
    driver.set("drive", 5.0)
    driver.run(0, 10, 1e-3)
    assert driver.call("Reset") == "ok"
    assert everything(driver.start()) == fresh


# Ticks


def test_the_tick_at_the_start_of_a_step_belongs_to_it_that_at_its_end_does_not(fmi):
    driver = instance(models.controller, fmi)
    counts = []
    for time, length in [(0, 4e-4), (4e-4, 6e-4), (1e-3, 1e-5), (1.01e-3, 1.99e-3), (3e-3, 2.5e-3)]:
        assert driver.step(time, length) == "ok"
        counts.append(driver.get("count")[0])
    assert counts == [1, 1, 2, 3, 6]


def test_outputs_hold_their_start_value_until_the_first_tick(fmi):
    driver = instance(models.controller, fmi, wanted=1.0)
    assert driver.get("command") == 0.25
    driver.step(0, 1e-3)
    assert driver.get("command") == 10.0 + 0.5 / 1e-3
    assert instance(models.controller, fmi, command=7.0).get("command") == 7.0


def test_in_event_mode_a_due_tick_shows_its_outputs_before_the_memory_moves(fmi):
    driver = instance(models.controller, fmi, "ME")
    for wanted in (1.0, 2.0):
        assert driver.set("wanted", wanted) == "ok"
        assert driver.get("command") == 10 * wanted + 0.5 * wanted / 1e-3
        assert driver.get("count") == 0
    driver.update()
    assert list(driver.get("count", "last")) == [1, 2.0]


def test_the_next_event_is_a_multiple_of_the_period_and_due_though_a_master_rounds_it_down(fmi):
    driver = instance(models.controller, fmi, "ME", start=5.0)
    assert [driver.update(), driver.update()] == [5.0 + 1e-3, 5.0 + 1e-3]
    for time, before, count in ((5.0 + 1e-3, 1, 2), (5.0 + 3e-3 - 1e-10, 2, 4)):
        assert driver.call("EnterContinuousTimeMode") == "ok"
        assert driver.call("SetTime", time) == "ok"
        assert driver.get("count") == before
        assert driver.call("EnterEventMode") == "ok"
        assert driver.update() == 5.0 + count * 1e-3
        assert driver.get("count") == count, "the ticks at 0, 1, 2 and 3 ms"


@pytest.mark.parametrize("kind", ["CS", "ME"])
def test_a_tick_that_fails_takes_those_before_it_back(fmi, kind):
    """Root of 4 - count: five ticks have one, the sixth has none."""
    driver = instance(models.root_of_a_count, fmi, kind)
    if kind == "ME":
        driver.call("SetTime", 8e-3)
    before = driver.serialize(driver.save())
    assert (driver.step(0, 8e-3) if kind == "CS" else driver.update()) == "error"
    assert '"root" is not finite after the tick at t = 0.005' in driver.messages[-1][2]
    assert driver.serialize(driver.save()) == before
    assert list(driver.get("count")) == [0.0]


# what is wrong: how it is done, part of the message
WRONG = {
    "not a number": (lambda d: d.set("drive", nan), '"drive" = nan is not finite'),
    "infinite": (lambda d: d.set("friction.Fc", inf), '"friction.Fc" = inf is not finite'),
    "calculated": (lambda d: d.set("torque", 1.0), '"torque" is calculated and cannot be set'),
    "state after the start": (lambda d: d.set("z", 1.0), '"z" can be set before the end of initialization only'),
    "below the bound": (lambda d: d.set("friction.Fs", -1.0), '"friction.Fs" = -1 is below its least value 1e-09'),
    "unknown to get": (lambda d: d.get(999), "no variable with the value reference 999; they go from 0 to 16"),
    "unknown to set": (lambda d: d.set(17, 0.0), "no variable with the value reference 17"),
    "backwards": (lambda d: d.step(-1e-3, 1e-3), "goes backwards: the model is at t = 0.01"),
    "gap": (lambda d: d.step(0.5, 1e-3), "leaves a gap: the model is at t = 0.01"),
    "no length": (lambda d: d.step(0.01, 0.0), "must be positive and finite"),
    "negative length": (lambda d: d.step(0.01, -1.0), "must be positive and finite"),
    "lost in rounding": (lambda d: d.step(0.01, 1e-19), "is lost in rounding"),
    "length nan": (lambda d: d.step(0.01, nan), "must be positive and finite"),
    "time nan": (lambda d: d.step(nan, 0.1), "must be positive and finite"),
    "past the stop time": (lambda d: d.step(0.01, 5.0), "passes the stop time 1"),
    "initialize again": (lambda d: d.call("ExitInitializationMode"), "not allowed in the step mode"),
    "event mode": (lambda d: d.call("EnterContinuousTimeMode"), "not allowed in the step mode"),
    "time": (lambda d: d.call("SetTime", 1.0), "not allowed in the step mode"),
    "seed nan": (
        lambda d: d.derivative("Directional", ["torque"], ["speed"], [nan])[0],
        'the seed nan of "speed" is not finite',
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_call_is_refused_with_a_sentence_and_changes_nothing(what, fmi):
    driver = instance(models.lugre, fmi, stop=1.0, drive=3.0).run(0, 10, 1e-3)
    before = everything(driver)
    act, message = WRONG[what]
    assert act(driver) == "error"
    assert driver.messages[-1][:2] == ("error", "logStatusError")
    assert message in driver.messages[-1][2]
    assert everything(driver) == before
    assert driver.step(0.01, 1e-3) == "ok"


def test_calls_without_an_instance_are_errors_not_crashes(fmi):
    driver = instance(models.lugre, fmi)
    driver.instance = None
    assert {driver.step(0, 1.0), driver.set("drive", 1.0), driver.get("angle"), driver.call("Terminate")} == {"error"}


def test_the_binary_of_another_description_is_refused(fmi):
    driver = models.Driver(models.lugre(), library(models.lugre), fmi, token="{0}")
    assert driver.instance is None
    assert "do not belong together" in driver.messages[-1][2]


def test_equations_that_leave_their_domain_stop_a_run_and_let_model_exchange_try_a_smaller_step(fmi):
    driver = instance(models.undefined_below_zero, fmi, sink=1.0)
    assert driver.step(0, 2.0) == "ok"
    assert driver.get("flow") == "error"
    assert '"flow" is not finite at t = 2 s' in driver.messages[-1][2]
    assert driver.get("level")[0] == pytest.approx(-1.0)
    driver = instance(models.undefined_below_zero, fmi, "ME")
    driver.call("EnterContinuousTimeMode")
    for level, flow in ((-1.0, "discard"), (4.0, 2.0)):
        assert driver.call("SetContinuousStates", ctypes.byref(ctypes.c_double(level)), ctypes.c_size_t(1)) == "ok"
        assert driver.get("flow") == flow


def test_parameters_can_be_tuned_between_steps_and_inputs_may_be_beyond_their_bounds(fmi):
    driver = instance(models.oscillator, fmi)
    assert driver.set("stiffness", 4.0) == "ok"
    assert driver.get("der(velocity)")[0] == -4.0
    driver = instance(models.lugre, fmi)
    assert driver.set("drive", 1000.0) == "ok"
    assert driver.get("drive") == 1000.0


def test_a_tighter_tolerance_gives_a_smaller_error(fmi):
    def end(tolerance):
        return instance(models.lugre, fmi, tolerance=tolerance, drive=5.0).run(0, 10, 0.05).get("angle", "speed")

    exact = end(1e-12)
    errors = [np.abs(end(tolerance) / exact - 1).max() for tolerance in (1e-3, 1e-5, 1e-7, 1e-9)]
    assert errors[0] > 10 * errors[1] > 100 * errors[2] > 1000 * errors[3]
    assert errors[2] < 1e-6


def test_log_categories_can_be_chosen_and_changes_of_mode_are_told_from_the_start(fmi):
    driver = instance(models.lugre, fmi)
    on = True if fmi == 3 else 1
    names = (ctypes.c_char_p * 1)(b"logEvents")
    assert driver.call("SetDebugLogging", on, ctypes.c_size_t(1), names) == "ok"
    assert driver.call("Terminate") == "ok"
    assert driver.messages == [("ok", "logEvents", "terminated mode at t = 0 s")]
    assert driver.call("SetDebugLogging", on, ctypes.c_size_t(1), (ctypes.c_char_p * 1)(b"gossip")) == "error"
    driver = models.Driver(models.lugre(), library(models.lugre), fmi, logging=True).start()
    assert [message[:2] for message in driver.messages] == [("ok", "logEvents")] * 2
    assert driver.messages[-1][2] == "step mode at t = 0 s"
    driver.call("SetDebugLogging", False, ctypes.c_size_t(0), None)
    assert [driver.set("drive", nan), len(driver.messages)] == ["error", 2]


# call: in which modes of model exchange and of co-simulation it is allowed, as the standards' tables say
READ = ("rates", "indicators", "nominals", "states read")
MODES = {
    "instantiated": set(),
    "initialization": {"get", "derivative", *READ},
    "event": {"get", "derivative", "time", "continuous", *READ},
    "continuous": {"get", "derivative", "time", "states", "completed", "event", *READ},
    "step": {"get", "derivative", "step"},
    "terminated": {"get", "derivative", *READ},
}


def in_mode(mode, fmi):
    driver = models.Driver(models.lugre(), library(models.lugre), fmi, "CS" if mode == "step" else "ME")
    if mode == "instantiated":
        return driver
    driver.initialize()
    calls = {"initialization": (), "continuous": ("EnterContinuousTimeMode",), "terminated": ("Terminate",)}
    for name in calls.get(mode, ()) if mode == "initialization" else ("ExitInitializationMode", *calls.get(mode, ())):
        driver.call(name)
    return driver


def attempts(driver):
    flags = ctypes.byref(ctypes.c_int()), ctypes.byref(ctypes.c_int())
    three, of_three = (ctypes.c_double * 3)(), ctypes.c_size_t(3)
    rates = "GetDerivatives" if driver.fmi == 2 else "GetContinuousStateDerivatives"
    return {
        "rates": lambda: driver.call(rates, three, of_three),
        "indicators": lambda: driver.call("GetEventIndicators", three, ctypes.c_size_t(0)),
        "nominals": lambda: driver.call("GetNominalsOfContinuousStates", three, of_three),
        "states read": lambda: driver.call("GetContinuousStates", three, of_three),
        "get": lambda: driver.get("torque"),
        "derivative": lambda: driver.derivative("Directional", ["torque"], ["speed"], [1.0])[0],
        "time": lambda: driver.call("SetTime", 0.0),
        "states": lambda: driver.call("SetContinuousStates", three, of_three),
        "completed": lambda: driver.call("CompletedIntegratorStep", 1, *flags),
        "step": lambda: driver.step(0, 1e-3),
        "event": lambda: driver.call("EnterEventMode"),
        "continuous": lambda: driver.call("EnterContinuousTimeMode"),
    }


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


@pytest.mark.parametrize("name", fuzz_models.MODELS)
def test_no_random_call_crashes_and_every_answer_keeps_the_rules(name, fmi, tmp_path):
    """A sample of what bench/fuzz.py does for long and under sanitizers."""
    machine, generated = PLATFORMS[host()], fuzz_models.code_of(name)
    library = compile_shared(sources_of(generated), f"played{machine.suffix}", machine.target)
    facts = fuzz_models.facts_of(generated, library, fmi, shrink=True)
    played = fuzz_models.play(facts, tmp_path, 25, seed=20, timeout=120)
    assert played.code == 0, played.reason
    assert played.counts["calls"] > played.counts["granted"] > 300
    assert len({*functions(fmi)} - {*played.counts["functions"]}) <= len(functions(fmi)) / 3
