"""Rows without a sample, rows of one time, and what a table counts that is no axis: left out with a note, or asked."""

from pathlib import Path

import numpy as np
import pytest
from tables import written

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import ManyRecordingsError, RecordingError, UndecidedError

T = np.arange(400) / 200
TAU, Q = np.cos(5 * T), 0.3 * np.sin(3 * T)


def without(column: np.ndarray, *rows: int) -> np.ndarray:
    column = column.copy()
    column[[*rows]] = np.nan
    return column


@pytest.mark.parametrize("empty", ["nan", "", "---"])
def test_a_logger_that_starts_before_its_devices_costs_the_rows_before_them(tmp_path: Path, empty: str) -> None:
    columns = (T, without(TAU, 0, 1, 2, 3, 399), without(Q, 0, 1), without(Q, 0, 1, 2))
    seen = Recording.read(written(tmp_path / "run.csv", "t,tau,q,other", *columns, empty=empty))
    np.testing.assert_allclose(seen.t, T[4:399])
    np.testing.assert_allclose(seen["other"], Q[4:399], atol=1e-9)  # whole, once the rows without a torque are gone
    note = 'run: 5 rows in which "tau", "q" has no value were left out; the first is row 1.'
    assert note in seen.notes


def test_rows_without_any_value_are_gaps(tmp_path: Path) -> None:
    rows = (100, 101, 250)
    columns = [without(one, *rows) for one in (T, TAU, Q)]
    seen = Recording.read(written(tmp_path / "run.csv", "t,tau,q", *columns))
    np.testing.assert_allclose(seen.t, np.delete(T, rows))
    assert "run: 3 rows without any value were left out; the first is row 101." in seen.notes
    assert [gap.missing for gap in seen.gaps] == [2, 1]


def test_rows_are_left_out_of_evenly_spaced_ones_in_their_places(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "tau,q", without(TAU, 100), without(Q, 100))
    seen = Recording.read(path, layout={"period": "5ms"})
    np.testing.assert_allclose(seen.t, np.delete(T, 100))


@pytest.mark.parametrize("value", [np.nan, 1e184])
def test_a_value_that_is_missing_between_others_is_asked_for_by_its_row(tmp_path: Path, value: float) -> None:
    tau, q = (np.where(np.arange(len(T)) == row, value, one) for row, one in ((0, TAU), (100, Q)))
    path = written(tmp_path / "run.csv", "t,tau,q", T, tau, q)
    with pytest.raises(UndecidedError, match=r'"tau" holds .* at row 1,.* --layout nan=gap leaves such rows out'):
        Recording.read(path)
    seen = Recording.read(path, layout={"nan": "gap"})
    np.testing.assert_allclose(seen.t, np.delete(T, [0, 100]))
    with pytest.raises(RecordingError, match="nan=hold: it is gap"):
        Recording.read(path, layout={"nan": "hold"})


@pytest.mark.parametrize(("kept", "value"), [("first", 0.25), ("last", 0.5)])
def test_which_of_the_rows_of_one_time_is_kept_is_said_by_an_option(tmp_path: Path, kept: str, value: float) -> None:
    rows = np.insert(np.arange(400), 200, 200)
    q = Q[rows]
    q[[200, 201]] = 0.25, 0.5
    path = written(tmp_path / "run.csv", "t,tau,q", T[rows], TAU[rows], q)
    with pytest.raises(UndecidedError, match=r'"q" is 0.25 and 0.5\. .* --layout repeated=first keeps the first'):
        Recording.read(path)
    seen = Recording.read(path, layout={"repeated": kept})
    np.testing.assert_allclose(seen.t, T)
    assert seen["q"][200] == value
    assert any(f"the {kept} was kept" in note for note in seen.notes)


def test_names_are_found_above_rows_that_are_half_empty(tmp_path: Path) -> None:
    columns = (T, Q, without(TAU, 0), *(without(Q, 0) for _ in range(8)))
    header = "timestamp,target,effort," + ",".join(f"pos ({n})" for n in range(8))
    seen = preview(written(tmp_path / "run.csv", header, *columns, empty=""))
    assert seen.found.values.keys() == {"timestamp", "target", "effort", *(f"pos ({n})" for n in range(8))}


def test_a_table_that_begins_again_in_rows_half_empty_is_many_recordings(tmp_path: Path) -> None:
    """A logger that writes blocks of two rows, the second of which is empty."""
    path = written(
        tmp_path / "run.csv",
        "t [s],force [N],x",
        np.tile([0, 0.01], 60),
        np.where(np.arange(120) % 2, np.nan, T[:120]),
        T[:120],
    )
    assert "tau" not in str(preview(Path(f"{path}:#1")).undecided)
    with pytest.raises(RecordingError, match="These are 60 recordings"):
        preview(path)


@pytest.mark.parametrize(
    ("header", "options", "question"),
    [
        ("idx,ts,motorU,rpm", {}, '"ts" steps by 11, which is 0.09091 Hz in s or 90.91 Hz in ms'),
        ("x,step,motorU,rpm", {"columns": {"t": "step"}}, '"step" steps by 11; say what one is, for example --units'),
    ],
)
def test_a_time_that_counts_is_asked_for_in_a_table_that_is_no_axis_too(
    tmp_path: Path, header: str, options: dict[str, dict[str, str]], question: str
) -> None:
    seen = preview(written(tmp_path / "run.csv", header, T, 11 * np.arange(400), T**2, 0 * T), options)
    assert any(question in text for text in seen.undecided)
    assert seen.options["units"] == {"t": "ms"}


def test_a_frequency_is_no_unit_of_a_time(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "timestep (8Hz),torque (Nm),position (rad)", 10 * np.arange(400), TAU, Q)
    with pytest.raises(UndecidedError, match='"8 Hz" of column "timestep" is no unit of time; say which'):
        Recording.read(path, {"t": "timestep"})


@pytest.mark.parametrize(("held", "names"), [("", ["t", "tau", "q"]), ("1.5", ["t", "tau", "q", ""])])
def test_a_column_without_a_name_is_one_if_it_holds_anything(tmp_path: Path, held: str, names: list[str]) -> None:
    """A separator at the end of each row makes one that does not."""
    path = written(tmp_path / "run.csv", "t,tau,q,", T, TAU, Q, [held if k == 7 else "" for k in range(400)])
    assert [*preview(path).found.values] == names


def test_a_question_without_an_example_is_none(tmp_path: Path) -> None:
    """Columns without names of which none holds numbers: there is nothing to propose."""
    words = ["1 a", "b 2"] * 200
    path = written(tmp_path / "run.csv", "", [f"{k}" if k % 2 else "x" for k in range(400)], words, T)
    seen = preview(path, {"columns": {"t": "#3"}})
    assert all("for example ." not in text for text in seen.undecided)


def test_single_rows_and_absurd_values_warn_of_nothing(tmp_path: Path) -> None:
    v = Q.copy()
    v[7] = 1e300
    with pytest.raises(ManyRecordingsError, match="These are 2 recordings"):
        preview(written(tmp_path / "run.csv", "t,tau,q,speed", np.append(T[:-1], 0.0), TAU, Q, v))
    assert "speed" in preview(written(tmp_path / "run.csv", "t,tau,q,speed", T, TAU, Q, v)).found.values
