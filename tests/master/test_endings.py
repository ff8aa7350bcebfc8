"""Where a run begins and ends: its start, its last row, and components that ask to end it before its time."""

from pathlib import Path

import numpy as np
import pytest
from simulating import simulate

from cosim.data.recording import Recording
from cosim.master.simulate import Options, run
from cosim.support.errors import StepError
from cosim.system.scenario import parse_scenario
from cosim.system.wire import Record

LOOPS = pytest.mark.parametrize("compiled", [True, False])
VERSIONS = pytest.mark.parametrize("fmi", [2, 3])
ENDS, EARLY, DISCARDS = 17.0, 18.0, 2.0


@LOOPS
@VERSIONS
def test_a_component_may_ask_to_end_the_run_and_what_was_until_then_is_whole(
    tiny: dict[int, Path], tmp_path: Path, fmi: int, compiled: bool
) -> None:
    path = tmp_path / "run.parquet"
    done = simulate(
        {"one": tiny[fmi]},
        [],
        record={"y": "one.y"},
        step=0.1,
        ticks=100,
        parameters={"one": {"status": ENDS, "fail_at": 1.0, "a": 1.0}},
        path=path,
        compiled=compiled,
    )
    assert done.statistics["ended"] == "one asked to end the simulation at tick 10 (1 s)"
    assert done.statistics["ended"] + "." in done.statistics["notes"]
    origin = Recording.read(path, required=()).origin
    assert origin["complete"]
    assert origin["ended"] == done.statistics["ended"]
    np.testing.assert_allclose(done.recording["y"], np.arange(11) * 0.1, atol=1e-12)


@LOOPS
@pytest.mark.parametrize(
    ("fmi", "status", "said"),
    [
        (2, DISCARDS, "one discarded the step at tick 10"),
        (3, EARLY, "one returned early from its step, though early return is not allowed here, at tick 10"),
    ],
)
def test_a_step_cut_short_that_ends_nothing_is_a_failure(
    tiny: dict[int, Path], fmi: int, status: float, said: str, compiled: bool
) -> None:
    """Early return is never allowed here, so an FMU goes through its events itself; one that does not is named."""
    given: dict = {"parameters": {"one": {"status": status, "fail_at": 1.0}}, "compiled": compiled}
    with pytest.raises(StepError, match=said):
        simulate({"one": tiny[fmi]}, [], record={"y": "one.y"}, step=0.1, ticks=20, **given)


@LOOPS
@pytest.mark.parametrize("ticks", [8, 9])
def test_the_last_row_is_the_sample_at_stop_where_one_falls_due(
    tiny: dict[int, Path], ticks: int, compiled: bool
) -> None:
    given: dict = {"signals": {"r": np.arange(ticks + 1.0)}, "step": 0.5, "decimation": 2, "compiled": compiled}
    record = {"y": "one.y", "a": "one.a", "r": "r", "mean": Record("r", "mean")}
    plain, whole = (
        simulate({"one": tiny[3]}, [("r", "one.a")], record=record, ticks=ticks, last=last, **given).recording
        for last in (False, True)
    )
    rows = ticks // 2 + 1
    assert len(plain) == -(-ticks // 2)
    assert len(whole) == rows
    np.testing.assert_array_equal(whole["r"], 2.0 * np.arange(rows))
    np.testing.assert_array_equal(whole["a"], whole["r"])
    np.testing.assert_array_equal(whole["y"], [0.5 * sum(range(2 * row)) for row in range(rows)])
    np.testing.assert_array_equal(whole["mean"][: rows - 1], plain["mean"][: rows - 1])


@LOOPS
@VERSIONS
def test_components_and_recording_begin_at_the_start(tiny: dict[int, Path], fmi: int, compiled: bool) -> None:
    text = f"""
    start = 5.0
    stop = 7.0
    step = 0.5
    [components.one]
    fmu = "{tiny[fmi]}"
    parameters = {{ a = 1.0, status = {ENDS}, fail_at = 6.0 }}
    [record]
    signals = ["one.y"]
    """
    done = run(parse_scenario(text, "x.toml", Path()), Options(compiled=compiled))
    np.testing.assert_array_equal(done.recording.t, [5.0, 5.5, 6.0])
    assert done.statistics["ended"] == "one asked to end the simulation at tick 2 (6 s)"
