"""Times, counts and words of the master: where a run begins and ends, which moment is stepped at, what is said."""

import gc
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from oscillators import BOND, BOTH, VERSIONS, H, Tiny, oscillator
from simulating import alone
from small_loop import text_of

import cosim.master.execution
from cosim.data.recording import Recording
from cosim.data.signals import Samples
from cosim.master.execution import chunks
from cosim.master.loop import library
from cosim.master.loop.shared import opened
from cosim.master.pool import Pool
from cosim.master.result import Statistics, _speed, remarks
from cosim.master.simulate import Options, run
from cosim.support.errors import StepError
from cosim.system.algorithm import Energy, GaussSeidel, Iterated, Jacobi
from cosim.system.scenario import parse_scenario
from cosim.system.wire import Record, Wire

HALVES = Energy(kind="energy", bonds=BOND, tolerance=1e-12, max_pieces=2)
"""So little energy may be lost that each step is taken in two pieces."""


@BOTH
@pytest.mark.parametrize(
    ("algorithm", "fail_at", "tick"),
    [
        (Jacobi(), 10.4, 10),
        (Jacobi(), 10.6, 11),
        (Iterated(kind="iterated"), 10.4, 10),
        (Iterated(kind="iterated"), 10.6, 11),
        (HALVES, 10.2, 10),
        (HALVES, 10.3, 10),
        (HALVES, 10.7, 10),
        (HALVES, 10.8, 11),
    ],
)
def test_a_component_is_stepped_at_the_time_of_its_step_or_piece(
    plain: Tiny, algorithm: Any, fail_at: float, tick: int, compiled: bool
) -> None:
    """It fails from the step on whose middle lies behind; the middles of halves are at a quarter and three quarters."""
    with pytest.raises(StepError) as caught:
        oscillator(plain[3], algorithm, compiled=compiled, parameters={"spring": {"fail_at": fail_at * H}})
    assert caught.value.tick == tick


@pytest.mark.parametrize(("algorithm", "count"), [(Jacobi(), 10), (GaussSeidel(kind="gauss-seidel"), 10), (HALVES, 19)])
def test_each_step_that_ends_with_a_warning_counts(plain: Tiny, algorithm: Any, count: int) -> None:
    """From the middle of tick 10 on, 20 ticks in all; of the half-steps from the second of tick 10 on."""
    for compiled in (True, False):
        parameters = {"spring": {"fail_at": (10 + 0.6 * (algorithm is HALVES)) * H - 1e-9, "status": 1.0}}
        done = oscillator(plain[2], algorithm, ticks=20, compiled=compiled, parameters=parameters)
        assert done.statistics["warnings"] == count


def test_pieces_of_a_run_follow_the_time_that_the_last_one_took(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tenth of a second each; at most eight times the last one, at least 16 ticks, at most half of the rest."""
    clock = iter(np.cumsum([0.0, 1e-3, 0.0, 0.09, 0.0, 1.0, 0.0, 100.0, *[0.0, 1e-7] * 20]))
    monkeypatch.setattr(cosim.master.execution, "perf_counter", lambda: float(next(clock)))
    sizes = [len(piece) for piece in chunks(200_000)]
    assert sizes[:5] == [16, 128, 142, 16, 16]
    assert sizes[5:9] == [128, 1024, 8192, 65_536]
    assert sum(sizes) == 200_000
    assert [len(piece) for piece in chunks(5)] == [5]


def test_a_chunk_grows_where_steps_are_quick_ends_small_and_holds_few_columns_or_few_ticks() -> None:
    sizes = [len(piece) for piece in chunks(1_000_000, 7)]
    assert sum(sizes) == 1_000_000
    assert max(sizes) == 131_072
    assert sizes[-1] <= 32_768
    wide = [len(piece) for piece in chunks(10_000, 1_000)]
    assert max(wide) == 2**20 // 1_000
    assert sum(wide) == 10_000


def test_statistics_are_of_the_ticks_that_were_run(tiny: Tiny) -> None:
    told = alone(tiny[3], [], {"y": "one.y"}, step=2e-3, ticks=300, decimation=7).statistics
    assert (told["steps"], told["step"], told["rows"], told["ended"]) == (300, 2e-3, 43, "")
    assert told["simulated_seconds"] == pytest.approx(0.6)
    assert told["ratio_to_real_time"] == pytest.approx(0.6 / told["seconds"])
    assert told["microseconds_per_step"] == pytest.approx(1e6 * told["seconds"] / 300)


def said(**changes: Any) -> Statistics:
    quiet: dict[str, Any] = {"coupling": [], "unconnected": [], "notes": [], "warnings": 0, "steps": 400}
    return quiet | changes  # type: ignore[return-value]


def test_what_is_said_of_a_run_beside_its_speed() -> None:
    assert remarks(said()) == []
    assert remarks(said(coupling=[{"rounds": 1000, "greatest": 4, "at_limit": 0}])) == [
        "coupled components took 2.5 passes a step, 4 at most"
    ]
    assert remarks(said(steps=0, coupling=[{"rounds": 0, "greatest": 0, "at_limit": 0}]))[0].startswith(
        "coupled components took 0 passes a step"
    )
    assert remarks(said(page="run.html", unconnected=["a.b", "c.d"], notes=["So."], warnings=1234)) == [
        "pictures: run.html",
        "not connected, at their start values: a.b, c.d",
        "So.",
        "1,234 steps ended with a warning of their FMU",
    ]
    assert remarks(said(warnings=1)) == ["1 steps ended with a warning of their FMU"]
    speed: Any = {"steps": 2000, "seconds": 0.25, "ratio_to_real_time": 8.0, "microseconds_per_step": 125.0}
    assert _speed(speed | {"rows": 200, "loop": "compiled"}) == (
        "2,000 steps in 0.25 s, 8 times real time, 125 us a step with recording (200 rows, compiled loop)"
    )


@pytest.mark.parametrize(
    ("gain", "offset", "quantum", "unit"),
    [(2.0, 0.0, 0.0, ""), (1.5, 4.0, 0.0, ""), (-1.0, 7.3, 2.0, ""), (1.0, 0.0, 5.0, ""), (2.0, 0.3, 0.0, "arcsec")],
)
def test_a_wire_scales_shifts_and_rounds_in_its_own_unit_before_it_is_converted(
    tiny: Tiny, gain: float, offset: float, quantum: float, unit: str
) -> None:
    """What is sent is in degrees or the wire's own unit, so are offset and quantum; what arrives is in rad."""
    sent = np.linspace(-20, 20, 33)
    wire = Wire("r", "one.a", gain=gain, offset=offset, quantum=quantum, unit=unit)
    done = alone(tiny[3], [wire], {"a": "one.a"}, ticks=33, signals={"r": Samples(sent, "deg")})
    size = {"": np.pi / 180, "arcsec": np.pi / 648_000}[unit]
    value = gain * sent + offset
    rounded = quantum * np.floor(value / quantum + 0.5) if quantum else value
    np.testing.assert_allclose(done.recording["a"], size * rounded, rtol=1e-12, atol=1e-15)


def test_a_pool_that_was_never_made_has_nothing_to_free() -> None:
    with pytest.raises(AttributeError):
        Pool(SimpleNamespace())  # type: ignore[arg-type]
    gc.collect()  # what its end raises would be told here


@pytest.mark.parametrize("probe", [{}, {"loop_layout": lambda: 7}])
def test_a_library_of_another_layout_or_none_was_built_from_another_version(
    probe: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = SimpleNamespace(**probe)
    monkeypatch.setattr("cosim.master.loop.shared.ctypes.CDLL", lambda _: made)
    with pytest.raises(OSError, match="another version"):
        opened("here.so", "loop_layout", 8)
    made.loop_layout = lambda: 8
    assert opened("here.so", "loop_layout", 8) is made


def test_a_column_of_exact_integers_is_zero_where_nothing_was_sent_yet() -> None:
    found = library()
    assert found is not None
    pool = Pool(found)
    big = 2**63 - 25
    number = pool.number(big.to_bytes(8, "little"))
    column = pool.column(np.array([0.0, number, 0.0]), "UInt64")
    assert column.tolist() == [0, big, 0]
    assert pool.column(np.array([pool.number((-7).to_bytes(8, "little", signed=True))]), "Int64").tolist() == [-7]
    assert math.isfinite(number)


# Where a run begins and ends: its start, its last row, and components that ask to end it before its time.

ENDS, EARLY, DISCARDS = 17.0, 18.0, 2.0


@BOTH
@VERSIONS
def test_a_component_may_ask_to_end_the_run_and_what_was_until_then_is_whole(
    tiny: Tiny, tmp_path: Path, version: int, compiled: bool
) -> None:
    parameters, path = {"one": {"status": ENDS, "fail_at": 1.0, "a": 1.0}}, tmp_path / "run.parquet"
    given: dict[str, Any] = {"parameters": parameters, "path": path, "compiled": compiled}
    done = alone(tiny[version], [], {"y": "one.y"}, ticks=100, **given)
    assert done.statistics["ended"] == "one asked to end the simulation at tick 10 (1 s)"
    assert done.statistics["ended"] + "." in done.statistics["notes"]
    origin = Recording.read(path, required=()).origin
    assert origin["complete"]
    assert origin["ended"] == done.statistics["ended"]
    np.testing.assert_allclose(done.recording["y"], np.arange(11) * 0.1, atol=1e-12)


@BOTH
@pytest.mark.parametrize(
    ("version", "status", "said"),
    [
        (2, DISCARDS, "one discarded the step at tick 10"),
        (3, EARLY, "one returned early from its step, though early return is not allowed here, at tick 10"),
    ],
)
def test_a_step_cut_short_that_ends_nothing_is_a_failure(
    tiny: Tiny, version: int, status: float, said: str, compiled: bool
) -> None:
    """Early return is never allowed here, so an FMU goes through its events itself; one that does not is named."""
    parameters = {"one": {"status": status, "fail_at": 1.0}}
    with pytest.raises(StepError, match=said):
        alone(tiny[version], [], {"y": "one.y"}, ticks=20, parameters=parameters, compiled=compiled)


@BOTH
@pytest.mark.parametrize("ticks", [8, 9])
def test_the_last_row_is_the_sample_at_stop_where_one_falls_due(tiny: Tiny, ticks: int, compiled: bool) -> None:
    given: dict[str, Any] = {"signals": {"r": np.arange(ticks + 1.0)}, "step": 0.5, "decimation": 2}
    system = (tiny[3], [("r", "one.a")], {"y": "one.y", "a": "one.a", "r": "r", "mean": Record("r", "mean")})
    plain, whole = (
        alone(*system, ticks=ticks, last=last, compiled=compiled, **given).recording for last in (False, True)
    )
    rows = ticks // 2 + 1
    assert (len(plain), len(whole)) == (-(-ticks // 2), rows)
    np.testing.assert_array_equal(whole["r"], 2.0 * np.arange(rows))
    np.testing.assert_array_equal(whole["a"], whole["r"])
    np.testing.assert_array_equal(whole["y"], [0.5 * sum(range(2 * row)) for row in range(rows)])
    np.testing.assert_array_equal(whole["mean"][: rows - 1], plain["mean"][: rows - 1])


@BOTH
@VERSIONS
def test_components_and_recording_begin_at_the_start(tiny: Tiny, version: int, compiled: bool) -> None:
    one = {"fmu": tiny[version], "parameters": {"a": 1.0, "status": ENDS, "fail_at": 6.0}}
    times = {"start": 5.0, "stop": 7.0, "step": 0.5}
    text = text_of({}, **times, components={"one": one}, record={"signals": ["one.y"]})
    done = run(parse_scenario(text, "x.toml", Path()), Options(compiled=compiled))
    np.testing.assert_array_equal(done.recording.t, [5.0, 5.5, 6.0])
    assert done.statistics["ended"] == "one asked to end the simulation at tick 2 (6 s)"
