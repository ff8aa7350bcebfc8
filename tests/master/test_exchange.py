"""Interfaces beside co-simulation: a solver meets CVode and the times of events, partitions run as clocks tick."""

from itertools import product
from pathlib import Path
from typing import Any

import export_models as models
import fmpy
import numpy as np
import pytest
from compiling import compiled, packed, with_stubs
from oscillators import BOTH
from simulating import alone, simulate
from small_loop import text_of

from cosim.fmi.fmu import FmuComponent
from cosim.master.exchange import ExchangeComponent, open_fmu
from cosim.master.simulate import run
from cosim.support.errors import FmuError, StepError, WiringError
from cosim.system.scenario import parse_scenario
from cosim.system.wire import Wire
from pyfmi_models.export import export_fmu

WIRES = [("controller.command", "plant.drive"), ("plant.reading", "controller.measured"), ("r", "controller.wanted")]
VERSIONS = pytest.mark.parametrize("fmi", [2, 3])
Fmus = dict[tuple[str, int], Path]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    folder = tmp_path_factory.mktemp("fmus")
    kinds = product((models.lugre, models.controller, models.van_der_pol, models.undefined_below_zero), (2, 3))
    return {(one.__name__, v): export_fmu(one(), folder / f"{one.__name__}{v}.fmu", fmi=v) for one, v in kinds}


def axis(plant: Any, controller: Any, **options: Any) -> dict[str, np.ndarray]:
    """An axis with LuGre friction under PD control at 1 kHz, stepped four times as often."""
    options |= {"parameters": {"controller": {"kp": 3000.0, "kd": 400.0, "command": 0.0}}, "signals": {"r": 0.01}}
    record = {"q": "plant.reading", "tau": "controller.command", "friction": "plant.torque"}
    with plant, controller:
        both = {"plant": plant, "controller": controller}
        recording = simulate(both, WIRES, record=record, step=2.5e-4, ticks=2000, **options).recording
    return {name: recording[name] for name in record}


@VERSIONS
def test_a_sampled_controller_gives_the_bits_of_co_simulation_and_a_plant_its_numbers(fmus: Fmus, fmi: int) -> None:
    plant, controller = fmus["lugre", fmi], fmus["controller", fmi]
    both = axis(FmuComponent(plant), FmuComponent(controller))
    sampled = axis(FmuComponent(plant), ExchangeComponent(controller))
    exchanged = axis(ExchangeComponent(plant), ExchangeComponent(controller))
    for name in both:
        np.testing.assert_array_equal(sampled[name], both[name])
        np.testing.assert_allclose(exchanged[name], both[name], rtol=1e-5, atol=1e-6 * np.ptp(both[name]))
    python = axis(ExchangeComponent(plant), ExchangeComponent(controller), compiled=False)
    for name in both:
        np.testing.assert_array_equal(python[name], exchanged[name])


@VERSIONS
def test_the_solver_meets_cvode_on_a_stiff_oscillator(fmus: Fmus, fmi: int) -> None:
    path = fmus["van_der_pol", fmi]
    with ExchangeComponent(path, "vdp") as component:
        ours = alone(component, [], {"y": "one.y"}, step=0.05, ticks=2000).recording["y"]
    options = {"stop_time": 99.95, "output_interval": 0.05, "relative_tolerance": 1e-9, "fmi_type": "ModelExchange"}
    theirs = fmpy.simulate_fmu(str(path), solver="CVode", **options)
    np.testing.assert_allclose(ours, theirs["y"], atol=1e-3)  # in the jumps, which go at 100 a second
    assert np.ptp(ours) > 3.9


BALL = r"""
enum { H, V, DH, DV, COUNT };
typedef struct { double v[COUNT], t, next; int mode, bounces; } M;
typedef struct { int again, terminate, nominals, values, has_next; double next; } Event;
API void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, void *c, int v, int l) {
  M *m = calloc(1, sizeof(M)); m->v[H] = 1; m->mode = 1; return m; }
API int fmi2Reset(M *m) { *m = (M){{1}}; m->mode = 1; return 0; }
API int fmi2SetReal(M *m, const unsigned *r, size_t n, const double *x) { while (n--) m->v[r[n]] = x[n]; return 0; }
API int fmi2GetReal(M *m, const unsigned *r, size_t n, double *x) { while (n--) x[n] = m->v[r[n]]; return 0; }
API int fmi2SetTime(M *m, double t) { m->t = t; return 0; }
API int fmi2GetContinuousStates(M *m, double *x, size_t n) { x[0] = m->v[H]; x[1] = m->v[V]; return 0; }
API int fmi2SetContinuousStates(M *m, const double *x, size_t n) { m->v[H] = x[0]; m->v[V] = x[1]; return 0; }
API int fmi2GetDerivatives(M *m, double *d, size_t n) { d[0] = m->v[V]; d[1] = -9.81; return 0; }
API int fmi2GetNominalsOfContinuousStates(M *m, double *x, size_t n) { x[0] = x[1] = 1; return 0; }
API int fmi2GetEventIndicators(M *m, double *z, size_t n) { z[0] = m->v[H]; return 0; }
API int fmi2EnterEventMode(M *m) { m->mode = 1; return 0; }
API int fmi2EnterContinuousTimeMode(M *m) { m->mode = 0; return 0; }
API int fmi2CompletedIntegratorStep(M *m, int no, int *enter, int *end) { *enter = *end = 0; return 0; }
API int fmi2NewDiscreteStates(M *m, Event *e) {
  *e = (Event){0};
  if (!m->mode) return 3;
  if (m->v[H] <= 0 && m->v[V] < 0) { m->v[V] *= -0.7; e->values = 1; m->bounces++; }
  if (m->t >= 1.50005) { if (m->next == 0) { m->v[V] += 1; e->values = 1; m->next = 1; } }
  else { e->has_next = 1; e->next = 1.50005; }
  return 0; }
"""
DESCRIPTION = """<fmiModelDescription fmiVersion="2.0" modelName="ball" guid="b" numberOfEventIndicators="1">
<ModelExchange modelIdentifier="ball"/><ModelVariables>
<ScalarVariable name="h" valueReference="0" causality="output" initial="exact"><Real start="1"/></ScalarVariable>
<ScalarVariable name="v" valueReference="1" causality="output" initial="exact"><Real start="0"/></ScalarVariable>
<ScalarVariable name="der(h)" valueReference="2"><Real derivative="1"/></ScalarVariable>
<ScalarVariable name="der(v)" valueReference="3"><Real derivative="2"/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs><Unknown index="1" dependencies=""/><Unknown index="2" dependencies=""/>
</Outputs><Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives></ModelStructure></fmiModelDescription>"""


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball that bounces (state events) and is pushed at 1.50005 s (a time event between two ticks)."""
    path = tmp_path_factory.mktemp("ball") / "ball.fmu"
    return packed(path, 2, DESCRIPTION, compiled("ball", with_stubs(BALL)))


def flight(t: np.ndarray) -> np.ndarray:
    """Height of the ball in closed form."""
    g, height, speed, begun, pushed, out = 9.81, 1.0, 0.0, 0.0, False, np.empty_like(t)
    while begun < t[-1]:
        lands = begun + (speed + np.sqrt(speed**2 + 2 * g * height)) / g
        until = lands if pushed or lands < 1.50005 else 1.50005
        s = t - begun
        flying = (t >= begun) & (t < until + 1e-12)
        out[flying] = (height + speed * s - g * s**2 / 2)[flying]
        s, begun = until - begun, until
        end = speed - g * s
        if until == 1.50005:
            height, speed, pushed = height + speed * s - g * s**2 / 2, end + 1.0, True
        else:
            height, speed = 0.0, -0.7 * end
    return out


@BOTH
def test_state_and_time_events_are_met_at_their_times(ball: Path, compiled: bool) -> None:
    recording = alone(ball, [], {"h": "one.h"}, step=1e-3, ticks=1900, compiled=compiled).recording
    np.testing.assert_allclose(recording["h"], flight(recording.t), atol=1e-8)


def test_an_fmu_with_both_interfaces_is_stepped_by_co_simulation_unless_told(
    fmus: Fmus, ball: Path, tiny: dict[int, Path]
) -> None:
    kinds = {"": FmuComponent, "model-exchange": ExchangeComponent}
    for path, asked, kind in (*((fmus["lugre", 3], *one) for one in kinds.items()), (ball, "", ExchangeComponent)):
        with open_fmu(path, interface=asked) as component:
            assert type(component) is kind
    with pytest.raises(FmuError, match=r"has no co-simulation interface; it has: model-exchange\."):
        open_fmu(ball, interface="co-simulation")
    with pytest.raises(FmuError, match=r"has no model-exchange interface; it has: co-simulation\."):
        open_fmu(tiny[2], interface="model-exchange")


def test_a_scenario_chooses_the_interface(fmus: Fmus) -> None:
    found = []
    for interface in ("model-exchange", "co-simulation"):
        axis = {"fmu": fmus["lugre", 3], "interface": interface, "parameters": {"drive": 20.0}}
        text = text_of({}, stop=0.1, step=1e-2, components={"axis": axis}, record={"signals": ["axis.reading"]})
        found.append(run(parse_scenario(text, "x.toml", Path())).recording["axis.reading"])
    np.testing.assert_allclose(*found, rtol=1e-6)


@VERSIONS
def test_a_model_that_leaves_its_domain_says_so(fmus: Fmus, fmi: int) -> None:
    with (
        ExchangeComponent(fmus["undefined_below_zero", fmi], "tank") as tank,
        pytest.raises(StepError, match=r'one discarded the step at tick \d+ .*"flow" is not finite at t = '),
    ):
        alone(tank, [("r", "one.sink")], {"flow": "one.flow"}, ticks=20, signals={"r": 1.0})


def test_without_the_compiled_loop_there_is_no_solver(fmus: Fmus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.master.exchange.library", lambda: None)
    with pytest.raises(FmuError, match="its solver needs the compiled loop, which is missing here"):
        ExchangeComponent(fmus["lugre", 3])


@VERSIONS
def test_nominals_are_those_of_the_fmu_and_1_where_it_says_none(
    fmus: Fmus, fmi: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The solver's tolerance of a state goes by them; FMI wants them above 0 and finite."""

    def nominals(component: ExchangeComponent) -> list[float]:
        component.start({})
        return list(component._arrays_kept["nominals"][:3])

    def said(target: Any, count: int) -> None:
        assert count == 3
        target[0], target[1], target[2] = 0.0, -2.0, float("nan")

    with ExchangeComponent(fmus["lugre", fmi]) as component:
        assert nominals(component) == [1.0, 0.01, 1e-5]
        monkeypatch.setattr(component._fmu, "getNominalsOfContinuousStates", said)
        assert nominals(component) == [1.0, 1.0, 1.0]


# FMUs for scheduled execution: their partitions run when their clocks tick, in the order of time and priority.


PARTITIONS = r"""
/* Partitions: 1 every 0.5 s from 0.25 s on, 2 triggered, 3 half a second after each third of 1, 4 every 1 s, first. */
enum { FAST = 1, HAND, LATER, SLOW, OUT, COUNT = 10, SUM, ORDER, LAST, SCALE };
typedef struct { int count, sum, order, scale, asked; double last; bool out; } M;
API void *fmi3InstantiateScheduledExecution(const char *n, const char *t, const char *r, bool v, bool l, void *e,
  void *log, void *u, void *a, void *b) { M *m = calloc(1, sizeof(M)); m->scale = 1; return m; }
API int fmi3Reset(M *m) { *m = (M){.scale = 1}; return 0; }
API int fmi3ActivateModelPartition(M *m, unsigned clock, double time) {
  m->last = time;
  if (clock == FAST) { m->count++; m->asked = m->count % 3 == 0; m->out = m->asked; }
  if (clock == HAND) m->sum += 10 * m->scale;
  if (clock == LATER) m->sum++;
  m->order = 10 * (m->order % 100) + (int)clock;
  return m->sum > 40 ? 3 : 0;
}
API int fmi3GetIntervalDecimal(M *m, const unsigned *r, size_t n, double *x, int *q) {
  *x = 0.5; *q = m->asked ? 2 : 1; m->asked = 0; return 0; }
API int fmi3GetShiftDecimal(M *m, const unsigned *r, size_t n, double *x) { *x = 0; return 0; }
API int fmi3GetClock(M *m, const unsigned *r, size_t n, bool *x) { *x = m->out; m->out = false; return 0; }
API int fmi3GetInt32(M *m, const unsigned *r, size_t n, int *x, size_t k) {
  *x = *r == COUNT ? m->count : *r == SUM ? m->sum : *r == ORDER ? m->order : m->scale; return 0; }
API int fmi3SetInt32(M *m, const unsigned *r, size_t n, const int *x, size_t k) { m->scale = *x; return 0; }
API int fmi3GetFloat64(M *m, const unsigned *r, size_t n, double *x, size_t k) { *x = m->last; return 0; }
"""
PARTITIONED = """<fmiModelDescription fmiVersion="3.0" modelName="parts" instantiationToken="p">
<ScheduledExecution modelIdentifier="parts"/><ModelVariables>
<Clock name="fast" valueReference="1" causality="input" intervalVariability="constant" intervalDecimal="0.5"
  shiftDecimal="0.25" priority="2"/>
<Clock name="hand" valueReference="2" causality="input" intervalVariability="triggered" priority="3"/>
<Clock name="later" valueReference="3" causality="input" intervalVariability="countdown" priority="4"/>
<Clock name="slow" valueReference="4" causality="input" intervalVariability="fixed" intervalCounter="1000"
  resolution="1000" priority="1"/>
<Clock name="out" valueReference="5" causality="output" intervalVariability="triggered"/>
<Int32 name="count" valueReference="10" causality="output"/>
<Int32 name="sum" valueReference="11" causality="output"/>
<Int32 name="order" valueReference="12" causality="output"/>
<Float64 name="last" valueReference="13" causality="output"/>
<Int32 name="scale" valueReference="14" causality="input" start="1"/>
</ModelVariables><ModelStructure/></fmiModelDescription>"""


@pytest.fixture(scope="session")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU with four partitions."""
    path = tmp_path_factory.mktemp("parts") / "parts.fmu"
    return packed(path, 3, PARTITIONED, compiled("parts", with_stubs(PARTITIONS)))


def test_partitions_run_in_the_order_of_time_and_priority(parts: Path) -> None:
    record = {name: f"one.{name}" for name in ("count", "sum", "order", "last", "out")}
    seen = alone(parts, [], record, step=0.5, ticks=6, last=True).recording
    np.testing.assert_array_equal(seen["count"], np.arange(7))
    np.testing.assert_array_equal(seen["last"], [0.0, 0.25, 0.75, 1.25, 1.75, 2.25, 2.75])
    np.testing.assert_array_equal(seen["out"], [0, 0, 0, 1, 0, 0, 1])
    np.testing.assert_array_equal(seen["sum"], [0, 0, 0, 0, 1, 1, 1])  # 0.5 s after 1.25 s, in [1.5, 2)
    np.testing.assert_array_equal(seen["order"], [0, 41, 411, 141, 113, 341, 411])  # at 1.75 s 1, then 3


@pytest.mark.parametrize(("step", "last"), [(0.25, 0.0), (0.25 * (1 + 1e-7), 0.25)], ids=["at the end", "before it"])
def test_a_tick_at_the_end_of_a_step_is_of_the_next_and_one_before_it_of_this(parts: Path, step, last) -> None:
    seen = alone(parts, [], {"last": "one.last"}, step=step, ticks=1, last=True).recording
    np.testing.assert_array_equal(seen["last"], [0.0, last])


def test_a_triggered_clock_ticks_where_its_input_says_so(parts: Path) -> None:
    given = {"hand": np.array([1.0, 0, 0, 1, 0, 0]), "two": 2.0}
    wires = [Wire("hand", "one.hand"), Wire("two", "one.scale")]
    seen = alone(parts, wires, {"sum": "one.sum"}, ticks=6, signals=given).recording
    np.testing.assert_array_equal(seen["sum"], [0, 20, 20, 20, 40, 40])


def test_clocks_count_from_the_start_and_begin_anew(parts: Path) -> None:
    for _ in range(2):
        seen = alone(parts, [], {"last": "one.last"}, step=0.5, ticks=3, start=10.0).recording
        np.testing.assert_array_equal(seen["last"], [0.0, 10.25, 10.75])


def test_a_partition_that_fails_and_a_value_that_does_not_fit_end_the_run_in_a_sentence(parts: Path) -> None:
    with pytest.raises(StepError, match=r"one returned an error at tick 4 \(0.4 s\)"):
        alone(parts, [("s", "one.hand")], {"x": "one.sum"}, ticks=9, signals={"s": 1.0})
    with pytest.raises(StepError, match=r'"scale" is fed 0.5, and is of type Int32'):
        alone(parts, [("s", "one.scale")], {"x": "one.sum"}, ticks=9, signals={"s": 0.5})


def test_what_cannot_be_is_refused(parts: Path, tiny: dict[int, Path]) -> None:
    with pytest.raises(WiringError, match="a Clock cannot hold a Float64"):
        simulate({"p": parts, "t": tiny[3]}, [("t.y", "p.hand")], record={"x": "p.sum"}, step=0.1, ticks=9)
    with pytest.raises(FmuError, match="has no co-simulation interface; it has: scheduled-execution"):
        open_fmu(parts, interface="co-simulation")
