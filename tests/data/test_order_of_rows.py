"""Time that stands, falls or begins again: copies out, late rows in place, registers continued, all else kept."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tables import written

from cosim.data.order import LATE, order_of
from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import ManyRecordingsError, RecordingError, UndecidedError

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


def stored(path: Path, of: dict[str, np.ndarray]) -> Path:
    return written(path, ",".join(of), *of.values())


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, share=st.floats(0.001, 1.0))
def test_copies_are_left_out_wherever_they_are(seed: int, share: float) -> None:
    times = 1 + (np.random.default_rng(seed).uniform(size=ROWS) < share)
    rows = np.repeat(np.arange(ROWS), times)
    one = Recording.of(at(rows, table(T)))
    np.testing.assert_array_equal(one.t, T)
    np.testing.assert_array_equal(one["q"], table(T)["q"])
    assert len(one.notes) == int(len(rows) > ROWS)


ALL = np.arange(ROWS)
PUT_RIGHT = {
    "a copy that comes late": np.insert(ALL, 800, 795),
    "a stretch that was written twice": np.concatenate([ALL[:1000], ALL[700:]]),
    "the whole twice": np.tile(ALL, 2),
    **{
        f"a packet of {late} rows that came late": np.concatenate(
            [ALL[:500], ALL[500 + late : 530], ALL[500 : 500 + late], ALL[530:]]
        )
        for late in (1, 3, LATE - 1)
    },
    "a copy of each row": np.repeat(ALL, 2),
    "the newest row first": ALL[::-1],
}


@pytest.mark.parametrize("how", PUT_RIGHT)
def test_rows_that_are_copied_late_or_turned_about_are_put_right(how: str) -> None:
    rows, true = PUT_RIGHT[how], table(T)
    one = Recording.of(at(rows, true) | ({"index": np.arange(len(rows))} if "copy" in how else {}))
    np.testing.assert_array_equal([one["t"], one["tau"]], [T, true["tau"]])
    (note,) = one.notes
    assert ("its rows ran from the last to the first and were turned about." in note) == ("newest" in how)
    assert ("1,500 rows that repeat the time and all values of others were left out; the first is" in note) == (
        how in ("a copy of each row", "the whole twice")
    )


def test_mixed_rows_of_two_axes_are_told_apart_by_their_column(tmp_path: Path) -> None:
    both = at(np.repeat(np.arange(ROWS), 2), table(T))
    both["axis"] = np.tile([1.0, 2.0], ROWS)
    both["q"] = both["q"] * both["axis"]
    path = stored(tmp_path / "run.csv", both)
    with pytest.raises(RecordingError, match=r'"axis" tells them apart; take one, run.csv:axis=1 to axis=2\.'):
        Recording.read(path)
    np.testing.assert_allclose(Recording.read(f"{path}:axis=2")["q"], 2 * table(T)["q"], atol=1e-9)


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
    said = f"{swaps} rows that came late were" if swaps > 1 else "one row that came late was"
    assert f"{said} put in the order of time; the first is row" in one.notes[0]


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


# Rows without a sample, rows of one time, and what a table counts that is no axis: left out with a note, or asked.

TW = np.arange(400) / 200
TAU, Q = np.cos(5 * TW), 0.3 * np.sin(3 * TW)


def without(column: np.ndarray, *rows: int) -> np.ndarray:
    column = column.copy()
    column[[*rows]] = np.nan
    return column


@pytest.mark.parametrize("empty", ["nan", "", "---"])
def test_a_logger_that_starts_before_its_devices_costs_the_rows_before_them(tmp_path: Path, empty: str) -> None:
    columns = (TW, without(TAU, 0, 1, 2, 3, 399), without(Q, 0, 1), without(Q, 0, 1, 2))
    seen = Recording.read(written(tmp_path / "run.csv", "t,tau,q,other", *columns, empty=empty))
    np.testing.assert_allclose(seen.t, TW[4:399])
    np.testing.assert_allclose(seen["other"], Q[4:399], atol=1e-9)  # whole, once the rows without a torque are gone
    note = 'run: 5 rows in which "tau", "q" has no value were left out; the first is row 1.'
    assert note in seen.notes


def test_rows_without_any_value_are_gaps_and_keep_their_place_among_evenly_spaced_ones(tmp_path: Path) -> None:
    rows = (100, 101, 250)
    columns = [without(one, *rows) for one in (TW, TAU, Q)]
    seen = Recording.read(written(tmp_path / "run.csv", "t,tau,q", *columns))
    np.testing.assert_allclose(seen.t, np.delete(TW, rows))
    assert "run: 3 rows without any value were left out; the first is row 101." in seen.notes
    assert [gap.missing for gap in seen.gaps] == [2, 1]
    even = Recording.read(written(tmp_path / "run.csv", "tau,q", *columns[1:]), layout={"period": "5ms"})
    np.testing.assert_allclose(even.t, np.delete(TW, rows))


@pytest.mark.parametrize("value", [np.nan, 1e184])
def test_a_value_that_is_missing_between_others_is_asked_for_by_its_row(tmp_path: Path, value: float) -> None:
    tau, q = (np.where(np.arange(len(TW)) == row, value, one) for row, one in ((0, TAU), (100, Q)))
    path = written(tmp_path / "run.csv", "t,tau,q", TW, tau, q)
    with pytest.raises(UndecidedError, match=r'"tau" holds .* at row 1,.* --layout nan=gap leaves such rows out'):
        Recording.read(path)
    seen = Recording.read(path, layout={"nan": "gap"})
    np.testing.assert_allclose(seen.t, np.delete(TW, [0, 100]))
    with pytest.raises(RecordingError, match="nan=hold: it is gap"):
        Recording.read(path, layout={"nan": "hold"})


@pytest.mark.parametrize(("kept", "value"), [("first", 0.25), ("last", 0.5)])
def test_which_of_the_rows_of_one_time_is_kept_is_said_by_an_option(tmp_path: Path, kept: str, value: float) -> None:
    rows = np.insert(np.arange(400), 200, 200)
    q = Q[rows]
    q[[200, 201]] = 0.25, 0.5
    path = written(tmp_path / "run.csv", "t,tau,q", TW[rows], TAU[rows], q)
    with pytest.raises(UndecidedError, match=r'"q" is 0.25 and 0.5\. .* --layout repeated=first keeps the first'):
        Recording.read(path)
    seen = Recording.read(path, layout={"repeated": kept})
    np.testing.assert_allclose(seen.t, TW)
    assert seen["q"][200] == value
    assert any(f"the {kept} was kept" in note for note in seen.notes)


def test_rows_that_are_half_empty_hide_neither_names_nor_where_a_table_begins_again(tmp_path: Path) -> None:
    """A logger may write blocks of two rows, the second of which is empty."""
    columns = (TW, Q, without(TAU, 0), *(without(Q, 0) for _ in range(8)))
    names = ["timestamp", "target", "effort", *(f"pos ({n})" for n in range(8))]
    assert {*preview(written(tmp_path / "run.csv", ",".join(names), *columns, empty="")).found.values} == {*names}
    blocks = (np.tile([0, 0.01], 60), np.where(np.arange(120) % 2, np.nan, TW[:120]), TW[:120])
    path = written(tmp_path / "run.csv", "t [s],force [N],x", *blocks)
    assert "tau" not in str(preview(Path(f"{path}:#1")).undecided)
    with pytest.raises(RecordingError, match="These are 60 recordings"):
        preview(path)


def test_a_time_that_counts_is_asked_for_in_a_table_that_is_no_axis_too_and_a_frequency_is_no_unit_of_time(
    tmp_path: Path,
) -> None:
    path = written(tmp_path / "run.csv", "x,step,motorU,rpm", TW, 11 * np.arange(400), TW**2, 0 * TW)
    seen = preview(path, {"columns": {"t": "step"}})
    assert any('"step" steps by 11; say what one is, for example --units' in text for text in seen.undecided)
    path.write_text(path.read_text().replace("step", "ts"))
    seen = preview(path)
    assert any('"ts" steps by 11, which is 0.09091 Hz in s or 90.91 Hz in ms' in text for text in seen.undecided)
    assert seen.options["units"] == {"t": "ms"}
    path = written(tmp_path / "run.csv", "timestep (8Hz),torque (Nm),position (rad)", 10 * np.arange(400), TAU, Q)
    with pytest.raises(UndecidedError, match='"8 Hz" of column "timestep" is no unit of time; say which'):
        Recording.read(path, {"t": "timestep"})


def test_a_column_without_a_name_is_one_if_it_holds_anything_and_nothing_is_proposed_that_holds_no_number(
    tmp_path: Path,
) -> None:
    """A separator at the end of each row makes one that does not."""
    for held, names in (("", ["t", "tau", "q"]), ("1.5", ["t", "tau", "q", ""])):
        last = [held if k == 7 else "" for k in range(400)]
        assert [*preview(written(tmp_path / "run.csv", "t,tau,q,", TW, TAU, Q, last)).found.values] == names
    words = ["1 a", "b 2"] * 200
    path = written(tmp_path / "run.csv", "", [f"{k}" if k % 2 else "x" for k in range(400)], words, TW)
    assert all("for example ." not in text for text in preview(path, {"columns": {"t": "#3"}}).undecided)


def test_single_rows_and_absurd_values_warn_of_nothing(tmp_path: Path) -> None:
    v = Q.copy()
    v[7] = 1e300
    with pytest.raises(ManyRecordingsError, match="These are 2 recordings"):
        preview(written(tmp_path / "run.csv", "t,tau,q,speed", np.append(TW[:-1], 0.0), TAU, Q, v))
    assert "speed" in preview(written(tmp_path / "run.csv", "t,tau,q,speed", TW, TAU, Q, v)).found.values
