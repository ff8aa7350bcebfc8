"""Time that stands, falls or begins again: copies out, late rows in place, registers continued, all else kept."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.data.order import LATE, order_of
from cosim.data.recording import Recording
from cosim.support.errors import RecordingError

ROWS = 1500
T = np.arange(ROWS) / 1000
SEEDS = st.integers(0, 2**32 - 1)


def columns(t: np.ndarray, seed: int = 1, phase: float = 0.0) -> dict[str, np.ndarray]:
    noise = np.random.default_rng(seed).normal(0, 0.05, len(t))
    return {"tau": np.cos(9 * t + phase) + noise, "q": 0.1 * np.sin(9 * t + phase) + 1e-6 * noise}


def table(t: np.ndarray, seed: int = 1, phase: float = 0.0) -> dict[str, np.ndarray]:
    return {"t": t} | columns(t - t[0], seed, phase)


def at(rows: np.ndarray, of: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: column[rows] for name, column in of.items()}


def written(path: Path, of: dict[str, np.ndarray]) -> Path:
    np.savetxt(path, np.column_stack([*of.values()]), delimiter=",", header=",".join(of), comments="", fmt="%.10g")
    return path


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, share=st.floats(0.001, 1.0))
def test_copies_are_left_out_wherever_they_are(seed: int, share: float) -> None:
    times = 1 + (np.random.default_rng(seed).uniform(size=ROWS) < share)
    rows = np.repeat(np.arange(ROWS), times)
    one = Recording.of(at(rows, table(T)))
    np.testing.assert_array_equal(one.t, T)
    np.testing.assert_array_equal(one["q"], table(T)["q"])
    assert len(one.notes) == int(len(rows) > ROWS)


def test_each_row_twice_is_no_time_of_too_few_digits(tmp_path: Path) -> None:
    one = Recording.read(written(tmp_path / "run.csv", at(np.repeat(np.arange(ROWS), 2), table(T))))
    assert (len(one), one.sample_time) == (ROWS, pytest.approx(1e-3))
    assert one.notes == (
        "run: 1,500 rows that repeat the time and all values of others were left out; the first is row 2.",
    )


def test_a_copy_may_come_late_and_rows_may_be_numbered() -> None:
    rows = np.insert(np.arange(ROWS), 800, 795)
    one = Recording.of(at(rows, table(T)) | {"index": np.arange(len(rows))})
    np.testing.assert_array_equal(one.t, T)


def test_a_stretch_that_was_written_twice_is_left_out_once() -> None:
    rows = np.concatenate([np.arange(1000), np.arange(700, ROWS)])
    one = Recording.of(at(rows, table(T)))
    np.testing.assert_array_equal(one["tau"], table(T)["tau"])
    again = Recording.of(at(np.tile(np.arange(ROWS), 2), table(T)))
    np.testing.assert_array_equal(again.t, T)


def test_rows_of_one_time_that_differ_are_refused_with_both_values(tmp_path: Path) -> None:
    made = at(np.insert(np.arange(ROWS), 700, 699), table(T))
    made["q"][700] = 0.5
    with pytest.raises(
        RecordingError, match=r'time stands still at row 701 .* its rows differ: "q" is .* and 0.5\. Leave one'
    ):
        Recording.read(written(tmp_path / "run.csv", made))


def test_mixed_rows_of_two_axes_are_told_apart_by_their_column(tmp_path: Path) -> None:
    both = at(np.repeat(np.arange(ROWS), 2), table(T))
    both["axis"] = np.tile([1.0, 2.0], ROWS)
    both["q"] = both["q"] * both["axis"]
    path = written(tmp_path / "run.csv", both)
    with pytest.raises(RecordingError, match=r'"axis" tells them apart; take one, run.csv:axis=1 to axis=2\.'):
        Recording.read(path)
    np.testing.assert_allclose(Recording.read(f"{path}:axis=2")["q"], 2 * table(T)["q"], rtol=1e-9)


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, jitter=st.floats(0, 0.2), swaps=st.integers(1, 400))
def test_neighbours_that_are_swapped_are_put_in_order(seed: int, jitter: float, swaps: int) -> None:
    rng = np.random.default_rng(seed)
    t = T + 1e-3 * jitter * rng.uniform(-0.5, 0.5, ROWS)
    rows = np.arange(ROWS)
    for k in rng.choice(np.arange(0, ROWS - 1, 3), swaps, replace=False):
        rows[[k, k + 1]] = rows[[k + 1, k]]
    one = Recording.of(at(rows, table(t)))
    np.testing.assert_array_equal(one.t, t)
    np.testing.assert_array_equal(one["q"], table(t)["q"])
    assert "put in the order of time; the first is row" in one.notes[0]


@pytest.mark.parametrize("late", [1, 3, LATE - 1])
def test_a_packet_of_rows_that_came_late_is_put_in_its_place(late: int) -> None:
    rows = np.concatenate(
        [np.arange(500), np.arange(500 + late, 530), np.arange(500, 500 + late), np.arange(530, ROWS)]
    )
    np.testing.assert_array_equal(Recording.of(at(rows, table(T))).t, T)


def test_a_table_with_the_newest_row_first_is_turned_about() -> None:
    one = Recording.of(at(np.arange(ROWS)[::-1], table(T)))
    np.testing.assert_array_equal(one["tau"], table(T)["tau"])
    assert one.notes == ("table: its rows ran from the last to the first and were turned about.",)


@settings(max_examples=80, deadline=None)
@given(
    bits=st.sampled_from([8, 16, 24, 32]),
    tick=st.sampled_from([1.0, 1e-3, 1e-6, 1e-7, 1e3]),
    signed=st.booleans(),
    each=st.integers(1, 60),
    phase=st.floats(0, 1),
)
def test_a_register_of_time_goes_on(bits: int, tick: float, signed: bool, each: int, phase: float) -> None:
    """Some whole number of ticks a row; the register begins again once or many times."""
    counts = np.arange(ROWS, dtype=np.int64) * each
    first = int(2**bits * phase) if bits < 24 else 2**bits - int(phase * counts[-1])
    low = 2 ** (bits - 1) if signed else 0
    read = ((first + low + counts) % 2**bits - low) * tick
    ordered = order_of(read, columns(T))
    np.testing.assert_allclose(ordered.t - ordered.t[0], tick * counts, atol=1e-6 * tick * each)
    assert len(ordered.done) == int((np.diff(read) < 0).any())


@settings(max_examples=60, deadline=None)
@given(first=st.integers(200, 1400), seed=SEEDS, phase=st.floats(0.5, 5.5), start=st.floats(0, 2))
def test_a_logger_that_was_started_anew_made_two_recordings(first: int, seed: int, phase: float, start: float) -> None:
    one, two = table(T[:first] + start, seed), table(T + start, seed + 1, phase)
    both = {name: np.concatenate([one[name], two[name]]) for name in one}
    assert order_of(both["t"], {name: both[name] for name in ("tau", "q")}).done == ()


@pytest.mark.parametrize("rows", [256, 65_536])
def test_records_as_long_as_a_register_are_recordings_where_the_motion_begins_anew(rows: int) -> None:
    t = np.arange(rows, dtype=float)
    parts = [columns(t / 1000, seed, phase) for seed, phase in ((1, 0.0), (2, 2.0), (3, 4.0))]
    others = {name: np.concatenate([part[name] for part in parts]) for name in ("tau", "q")}
    assert order_of(np.tile(t, 3), others).done == ()


@settings(max_examples=60, deadline=None)
@given(back=st.floats(0.1, 300), row=st.integers(100, 1400))
def test_a_clock_that_was_set_back_is_never_sorted(back: float, row: int) -> None:
    """Rows after the step would lie between the rows before it."""
    t = T - 1e-3 * back * (np.arange(ROWS) >= row)
    ordered = order_of(t, columns(T))
    np.testing.assert_array_equal(ordered.rows, np.arange(ROWS))
    if (np.diff(t) < 0).any():
        with pytest.raises(RecordingError, match="time runs backwards"):
            Recording.of({"t": t} | columns(T))
