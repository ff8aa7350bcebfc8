"""FMUs for scheduled execution: their partitions run when their clocks tick, in the order of time and priority."""

from pathlib import Path

import numpy as np
import pytest
from compiling import compiled, packed, with_stubs
from simulating import alone, simulate

from cosim.master.exchange import open_fmu
from cosim.support.errors import FmuError, StepError, WiringError
from cosim.system.wire import Wire

SOURCE = r"""
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
DESCRIPTION = """<fmiModelDescription fmiVersion="3.0" modelName="parts" instantiationToken="p">
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
    return packed(path, 3, DESCRIPTION, compiled("parts", with_stubs(SOURCE)))


def test_partitions_run_in_the_order_of_time_and_priority(parts: Path) -> None:
    record = {name: f"one.{name}" for name in ("count", "sum", "order", "last", "out")}
    seen = alone(parts, [], record, step=0.5, ticks=6, last=True).recording
    np.testing.assert_array_equal(seen["count"], np.arange(7))
    np.testing.assert_array_equal(seen["last"], [0.0, 0.25, 0.75, 1.25, 1.75, 2.25, 2.75])
    np.testing.assert_array_equal(seen["out"], [0, 0, 0, 1, 0, 0, 1])
    np.testing.assert_array_equal(seen["sum"], [0, 0, 0, 0, 1, 1, 1])  # 0.5 s after 1.25 s, in [1.5, 2)
    np.testing.assert_array_equal(seen["order"], [0, 41, 411, 141, 113, 341, 411])  # at 1.75 s 1, then 3


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
