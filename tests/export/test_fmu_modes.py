"""What our FMUs allow in each mode, take back after a failure, and refuse by name."""

import ctypes

import export_models as models
import pytest
from export_models import everything, instance, library
from fuzz_rules import sealed
from test_fmu_capabilities import both

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
    three, of_three = (ctypes.c_double * 3)(), ctypes.c_size_t(3)
    rates = "GetDerivatives" if driver.fmi == 2 else "GetContinuousStateDerivatives"
    return {
        "rates": lambda: driver.call(rates, three, of_three),
        "indicators": lambda: driver.call("GetEventIndicators", three, ctypes.c_size_t(0)),
        "nominals": lambda: driver.call("GetNominalsOfContinuousStates", three, of_three),
        "states read": lambda: driver.call("GetContinuousStates", three, of_three),
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
