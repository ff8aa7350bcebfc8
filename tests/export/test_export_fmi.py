"""The binary behind the archive: exact memory, counted time, honest errors, the order of the solver."""

import ctypes
from math import inf, nan

import export_models as models
import numpy as np
import pytest
from export_models import everything, instance, library

pytestmark = pytest.mark.parametrize("fmi", [2, 3])


@pytest.mark.parametrize("make", [models.lugre, models.controller, models.oscillator])
def test_a_restored_run_repeats_its_bits(make, fmi):
    driver = instance(make, fmi)
    step, name = 1e-3, {"lugre": "drive", "controller": "wanted", "oscillator": "force"}[make.__name__]
    driver.set(name, 4.0)
    driver.run(0, 100, step)
    state = driver.save()
    driver.set(name, -3.0)
    once = everything(driver.run(100 * step, 100, step))
    assert driver.restore(state) == "ok"
    driver.set(name, -3.0)
    assert everything(driver.run(100 * step, 100, step)) == once
    assert driver.call("FreeFMUstate" if fmi == 2 else "FreeFMUState", ctypes.byref(state)) == "ok"
    assert state.value is None


def test_a_damaged_or_foreign_state_is_refused(fmi):
    driver = instance(models.lugre, fmi)
    content = driver.serialize(driver.save())
    damaged = bytes([*content[:60], content[60] ^ 1, *content[61:]])
    foreign = instance(models.oscillator, fmi)
    assert driver.deserialize(damaged) == "error"
    assert "corrupted" in driver.messages[-1][2]
    assert driver.deserialize(content[:-1]) == "error"
    assert f"this model's has {len(content)}" in driver.messages[-1][2]
    assert driver.restore(foreign.save()) == "error"
    assert "another model" in driver.messages[-1][2]
    assert instance(models.lugre, fmi, "ME").restore(driver.save()) == "error"


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
    other = instance(models.controller, fmi, command=7.0)
    assert other.get("command") == 7.0


def test_in_event_mode_a_due_tick_shows_its_outputs_before_the_memory_moves(fmi):
    driver = instance(models.controller, fmi, "ME")
    for wanted in (1.0, 2.0):
        assert driver.set("wanted", wanted) == "ok"
        assert driver.get("command") == 10 * wanted + 0.5 * wanted / 1e-3
        assert driver.get("count") == 0
    update(driver)
    assert list(driver.get("count", "last")) == [1, 2.0]


def update(driver):
    """Update the discrete states; return the time of the next event."""
    if driver.fmi == 2:
        flags = ctypes.create_string_buffer(32)  # five integers, padding, then the time
        assert driver.call("NewDiscreteStates", ctypes.byref(flags)) == "ok"
        return ctypes.c_double.from_buffer(flags, 24).value
    flags, time = [ctypes.byref(ctypes.c_bool()) for _ in range(5)], ctypes.c_double()
    assert driver.call("UpdateDiscreteStates", *flags, ctypes.byref(time)) == "ok"
    return time.value


def test_the_next_event_is_a_multiple_of_the_period(fmi):
    driver = instance(models.controller, fmi, "ME", start=5.0)
    assert [update(driver), update(driver)] == [5.0 + 1e-3, 5.0 + 1e-3]
    assert driver.call("EnterContinuousTimeMode") == "ok"
    assert driver.call("SetTime", 5.0 + 1e-3) == "ok"
    assert driver.get("count") == 1
    assert driver.call("EnterEventMode") == "ok"
    assert update(driver) == 5.0 + 2 * 1e-3
    assert driver.get("count") == 2


def test_a_tick_is_due_at_its_time_though_a_master_rounds_it_down(fmi):
    driver = instance(models.controller, fmi, "ME")
    assert driver.call("EnterContinuousTimeMode") == "ok"
    assert driver.call("SetTime", 3e-3 - 1e-10) == "ok"
    assert driver.call("EnterEventMode") == "ok"
    update(driver)
    assert driver.get("count") == 4, "the ticks at 0, 1, 2 and 3 ms"


# what is wrong: how it is done, part of the message
WRONG = {
    "not a number": (lambda d: d.set("drive", nan), '"drive" = nan is not finite'),
    "infinite": (lambda d: d.set("friction.Fc", inf), '"friction.Fc" = inf is not finite'),
    "calculated": (lambda d: d.set("torque", 1.0), '"torque" is calculated and cannot be set'),
    "state after the start": (lambda d: d.set("z", 1.0), '"z" can be set before the end of initialization only'),
    "below the bound": (
        lambda d: d.set("friction.Fs", -1.0),
        'parameter "friction.Fs" = -1 is below its least value 1e-09',
    ),
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


def test_a_step_before_initialization_is_refused(fmi):
    driver = models.Driver(models.lugre(), library(models.lugre), fmi)
    assert driver.step(0, 1e-3) == "error"
    assert "not allowed in the instantiated mode" in driver.messages[-1][2]


def test_calls_without_an_instance_are_errors_not_crashes(fmi):
    driver = instance(models.lugre, fmi)
    driver.instance = None
    assert {driver.step(0, 1.0), driver.set("drive", 1.0), driver.get("angle"), driver.call("Terminate")} == {"error"}


def test_the_binary_of_another_description_is_refused(fmi):
    driver = models.Driver(models.lugre(), library(models.lugre), fmi, token="{0}")
    assert driver.instance is None
    assert "do not belong together" in driver.messages[-1][2]


def test_equations_that_leave_their_domain_stop_the_run_with_a_sentence(fmi):
    driver = instance(models.undefined_below_zero, fmi, sink=1.0)
    assert driver.step(0, 2.0) == "ok"
    assert driver.get("flow") == "error"
    assert '"flow" is not finite at t = 2 s' in driver.messages[-1][2]
    assert driver.get("level")[0] == pytest.approx(-1.0)


def test_parameters_can_be_tuned_between_steps(fmi):
    driver = instance(models.oscillator, fmi)
    assert driver.set("stiffness", 4.0) == "ok"
    assert driver.get("der(velocity)")[0] == -4.0


def test_reset_returns_to_the_start(fmi):
    driver = instance(models.lugre, fmi)
    fresh = everything(driver)
    driver.set("drive", 5.0)
    driver.run(0, 10, 1e-3)
    assert driver.call("Reset") == "ok"
    assert everything(driver.start()) == fresh


def test_a_tighter_tolerance_gives_a_smaller_error(fmi):
    def end(tolerance):
        return instance(models.lugre, fmi, tolerance=tolerance, drive=5.0).run(0, 10, 0.05).get("angle", "speed")

    exact = end(1e-12)
    errors = [np.abs(end(tolerance) / exact - 1).max() for tolerance in (1e-3, 1e-5, 1e-7, 1e-9)]
    assert errors[0] > 10 * errors[1] > 100 * errors[2] > 1000 * errors[3]
    assert errors[2] < 1e-6


def test_log_categories_can_be_chosen(fmi):
    driver = instance(models.lugre, fmi)
    on = True if fmi == 3 else 1
    names = (ctypes.c_char_p * 1)(b"logEvents")
    assert driver.call("SetDebugLogging", on, ctypes.c_size_t(1), names) == "ok"
    assert driver.call("Terminate") == "ok"
    assert driver.messages == [("ok", "logEvents", "terminated mode at t = 0 s")]
    assert driver.call("SetDebugLogging", on, ctypes.c_size_t(1), (ctypes.c_char_p * 1)(b"gossip")) == "error"


def test_with_logging_on_changes_of_mode_are_told_from_the_start(fmi):
    driver = models.Driver(models.lugre(), library(models.lugre), fmi, logging=True).start()
    assert [message[:2] for message in driver.messages] == [("ok", "logEvents")] * 2
    assert driver.messages[-1][2] == "step mode at t = 0 s"
    driver.call("SetDebugLogging", False, ctypes.c_size_t(0), None)
    assert [driver.set("drive", nan), len(driver.messages)] == ["error", 2]
