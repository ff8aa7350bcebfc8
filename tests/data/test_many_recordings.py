"""One recording of a file that holds many: by column, by number, in every place where a recording is named."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cosim.api.diagnose import check_split
from cosim.api.show import show
from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.reading import read_recordings
from cosim.support.errors import InputError, ManyRecordingsError, RecordingError

ROWS = 300
DRIVES = ("lead", "lead", "worm")
SPEEDS = (10.0, 0.1, 10.0)


@pytest.fixture
def table() -> pd.DataFrame:
    """Three recordings below each other, told apart by run, or by drive and speed together."""
    rng = np.random.default_rng(3)
    parts = []
    for run, (drive, speed) in enumerate(zip(DRIVES, SPEEDS, strict=True)):
        t = 0.01 * np.arange(ROWS)
        tau = np.sin(t + run) + rng.normal(0, 0.01, ROWS)
        parts.append(pd.DataFrame({"drive": drive, "speed": speed, "t": t, "tau": tau, "q": run + np.cos(t)}))
    return pd.concat(parts, ignore_index=True).astype({"speed": "float32", "drive": "category"})


@pytest.fixture(params=["parquet", "csv"])
def path(request: pytest.FixtureRequest, tmp_path: Path, table: pd.DataFrame) -> Path:
    path = tmp_path / f"day.{request.param}"
    if request.param == "csv":
        table.to_csv(path, index=False)
    else:
        table.to_parquet(path, index=False)
    return path


@pytest.mark.parametrize(
    ("which", "run"),
    [
        ("#1", 0),
        ("#3", 2),
        ("drive=worm", 2),
        ("drive=lead,speed=0.1", 1),
        ("speed=10,drive=lead", 0),
        ("drive=lead,#2", 1),
    ],
)
def test_one_is_taken_by_column_or_number(path: Path, table: pd.DataFrame, which: str, run: int) -> None:
    one = Recording.read(f"{path}:{which}")
    assert one.name == f"day:{which}"
    rows = slice(run * ROWS, (run + 1) * ROWS)
    np.testing.assert_array_equal(one["q"], table["q"][rows])
    np.testing.assert_array_equal(one["tau"], table["tau"][rows])
    assert one.origin["file"]["rows"] == f"{run * ROWS + 1:,} to {(run + 1) * ROWS:,}"


def test_the_refusal_says_how_many_there_are_and_how_one_is_taken(path: Path) -> None:
    with pytest.raises(ManyRecordingsError) as caught:
        Recording.read(path)
    said = str(caught.value)
    assert "time runs backwards at row 301 (2.99 s to 0 s). These are 3 recordings" in said
    assert f"take one, {path.name}:drive=lead,speed=10, or by number, {path.name}:#1 to #3." in said
    for run, one in enumerate(caught.value.runs):  # what is offered can be taken
        assert Recording.read(f"{path}:{one.which}")["q"][0] == run + 1
        assert (one.first, one.rows) == (run * ROWS, ROWS)


def test_where_no_column_tells_them_apart_they_have_numbers(tmp_path: Path, table: pd.DataFrame) -> None:
    path = tmp_path / "day.csv"
    table[["t", "tau", "q"]].to_csv(path, index=False)
    with pytest.raises(ManyRecordingsError, match=re.escape("take one, day.csv:#1 to #3.")):
        Recording.read(path)


def test_one_column_that_suffices_is_offered_alone(tmp_path: Path, table: pd.DataFrame) -> None:
    path = tmp_path / "day.parquet"
    table.assign(run=np.repeat([4, 5, 7], ROWS).astype(np.int16)).to_parquet(path, index=False)
    with pytest.raises(ManyRecordingsError) as caught:
        Recording.read(path)
    assert [one.which for one in caught.value.runs] == ["run=4", "run=5", "run=7"]


def test_values_that_cannot_be_typed_leave_numbers(tmp_path: Path, table: pd.DataFrame) -> None:
    path = tmp_path / "day.parquet"
    table.assign(drive=np.repeat(["a/b", "a,b", "c"], ROWS), speed=1.0).to_parquet(path, index=False)
    with pytest.raises(ManyRecordingsError) as caught:
        Recording.read(path)
    assert [one.which for one in caught.value.runs] == ["#1", "#2", "#3"]


@pytest.mark.parametrize(
    ("which", "sentence"),
    [
        ("#4", "no #4; the file holds 3 recordings, #1 to #3 (another begins where time runs backwards)."),
        ("#0", "there is no #0; the file holds 3 recordings"),
        ("#٣", "there is no #٣; the file holds 3 recordings"),
        (f"#{'9' * 5000}", "9...; the file holds 3 recordings, #1 to #3"),
        ("drive=worn", '"drive" is nowhere worn; it holds: lead, worm. Did you mean "worm"?'),
        ("speed=fast", '"speed" is nowhere fast; it holds: 10, 0.1.'),
        (
            "drve=lead",
            'no column "drve" to tell recordings by; there are: drive, speed, t, tau, q. Did you mean "drive"?',
        ),
        ("", "after the colon stands which recording of the file is meant, column=value or #number"),
        ("3", "after the colon stands which recording of the file is meant, column=value or #number"),
        ("drive=lead", "These are 2 recordings, if another begins there; take one,"),
    ],
)
def test_what_is_not_there_is_a_sentence(path: Path, which: str, sentence: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(sentence)) as caught:
        Recording.read(f"{path}:{which}")
    assert str(caught.value).startswith(str(path))


def test_a_file_with_a_colon_in_its_name_is_a_file(tmp_path: Path, table: pd.DataFrame) -> None:
    path = tmp_path / "day:#2.csv"
    try:
        table[:ROWS].to_csv(path, index=False)
    except OSError:
        pytest.skip("this file system takes no colon")
    assert len(Recording.read(path)) == ROWS


def test_options_of_the_file_hold_for_its_recordings(tmp_path: Path, table: pd.DataFrame) -> None:
    path = tmp_path / "day.csv"
    table.rename(columns={"tau": "x", "t": "clock"}).to_csv(path, index=False)
    named = [Path(f"{path}:#1"), Path(f"{path}:drive=worm")]
    columns = ["day.csv:tau=x", "day:t=clock", "q=q"]
    read = read_recordings(named, {}, columns, ["day.csv:tau=mN.m"], "rotary")
    assert [one.name for one in read] == ["day:#1", "day:drive=worm"]
    np.testing.assert_allclose(read[1]["tau"], 1e-3 * table["tau"][2 * ROWS :], rtol=1e-12)


def test_a_recording_of_the_same_file_may_be_held_out_and_the_same_rows_may_not(path: Path) -> None:
    first, second, again = (Recording.read(f"{path}:{which}") for which in ("#1", "#2", "drive=lead,speed=0.1"))
    check_split([first], [second])
    with pytest.raises(InputError, match="is held out and among the training recordings"):
        check_split([first, second], [again])
    with pytest.raises(InputError, match="is given twice, and would count as two recordings"):
        check_split([first, second, Recording.read(f"{path}:#1")], [])


def test_a_table_in_memory_is_not_told_to_be_a_file(table: pd.DataFrame) -> None:
    values = {name: table[name].to_numpy() for name in ("t", "tau", "q")}
    with pytest.raises(RecordingError, match="Split the file there") as caught:
        Recording.of(values)
    assert ":#" not in str(caught.value)


def test_show_lists_them_and_previews_one(path: Path) -> None:
    shown = show(path)
    assert shown.facts["holds"] == "3 recordings"
    assert [row["recording"] for row in shown.tables["recordings"]] == [
        "drive=lead,speed=10",
        "drive=lead,speed=0.1",
        "drive=worm,speed=10",
    ]
    seen = preview(Path(f"{path}:drive=worm"))
    assert (seen.recording.name, len(seen.recording), seen.said) == ("day:drive=worm", ROWS, "")
