"""One recording of a file that holds many: by column, by number, in every place where a recording is named."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tables import written

from cosim.api.diagnose import check_split
from cosim.api.show import show
from cosim.data.formats import is_recording
from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.reading import read_recordings
from cosim.support.errors import InputError, ManyRecordingsError, RecordingError
from cosim.support.suffixes import recordings
from cosim_serve.pages import SUFFIXES

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


def test_the_refusal_says_how_many_there_are_and_how_one_is_taken(path: Path, table: pd.DataFrame) -> None:
    with pytest.raises(ManyRecordingsError) as caught:
        Recording.read(path)
    said = str(caught.value)
    assert "time runs backwards at row 301 (2.99 s to 0 s). These are 3 recordings" in said
    assert f"take one, {path.name}:drive=lead,speed=10, or by number, {path.name}:#1 to #3." in said
    for run, one in enumerate(caught.value.runs):  # what is offered can be taken
        assert Recording.read(f"{path}:{one.which}")["q"][0] == run + 1
        assert (one.first, one.rows) == (run * ROWS, ROWS)
    with pytest.raises(RecordingError, match=r"Split the file there[^:#]*$"):  # a table in memory is no file
        Recording.of({name: table[name].to_numpy() for name in ("t", "tau", "q")})


NUMBERS, RUNS = ["#1", "#2", "#3"], ["run=4", "run=5", "run=7"]


@pytest.mark.parametrize(
    ("more", "offered"),
    [
        pytest.param({"drive": "lead", "speed": 1.0}, NUMBERS, id="where no column tells them apart they have numbers"),
        pytest.param({"run": np.repeat([4, 5, 7], ROWS).astype(np.int16)}, RUNS, id="one column that suffices"),
        pytest.param({"drive": np.repeat(["a/b", "a,b", "c"], ROWS), "speed": 1.0}, NUMBERS, id="what none can type"),
    ],
)
def test_what_is_offered_is_the_least_that_can_be_typed(
    tmp_path: Path, table: pd.DataFrame, more: dict[str, object], offered: list[str]
) -> None:
    path = tmp_path / "day.parquet"
    table.assign(**more).to_parquet(path, index=False)
    with pytest.raises(ManyRecordingsError, match=f"take one, day.parquet:{offered[0]}") as caught:
        Recording.read(path)
    assert [one.which for one in caught.value.runs] == offered


@pytest.mark.parametrize(
    ("which", "sentence"),
    [
        ("#4", "no #4; the file holds 3 recordings, #1 to #3 (another begins where time runs backwards)."),
        ("#0", "there is no #0; the file holds 3 recordings"),
        ("#٣", "there is no #٣; the file holds 3 recordings"),
        (f"#{'9' * 5000}", "9...; the file holds 3 recordings, #1 to #3"),
        ("drive=worn", '"drive" is nowhere worn; it holds: lead, worm. Did you mean "worm"?'),
        ("speed=fast", '"speed" is nowhere fast; it holds: 10, 0.1.'),
        ("drve=lead", 'no column "drve" to tell recordings by; there are: drive, speed, t, tau, q. Did you mean'),
        ("", "after the colon stands which recording of the file is meant, column=value or #number"),
        ("3", "after the colon stands which recording of the file is meant, column=value or #number"),
        ("drive=lead", "These are 2 recordings, if another begins there; take one,"),
    ],
)
def test_what_is_not_there_is_a_sentence(path: Path, which: str, sentence: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(sentence)) as caught:
        Recording.read(f"{path}:{which}")
    assert str(caught.value).startswith(str(path))


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


# Several files of one run, with a sign between them or in a folder, are one recording; what is open is asked.

TA, TQ, TV = np.arange(2000) / 1000, 3e-4 + np.arange(1000) / 500, np.arange(1500) / 750


def tau(t: np.ndarray) -> np.ndarray:
    return np.cos(9 * t)


def q(t: np.ndarray) -> np.ndarray:
    return 0.1 * np.sin(9 * t)


def agrees(seen: Recording) -> None:
    np.testing.assert_allclose(seen["q"], q(seen.t - seen.t[0] + 3e-4), atol=1e-8)
    np.testing.assert_allclose(seen["tau"], tau(seen.t - seen.t[0] + 3e-4), atol=3e-5)


def test_files_of_one_run_are_joined_and_named_in_a_note_and_a_folder_of_such_files_is_one(tmp_path: Path) -> None:
    written(tmp_path / "position.csv", "t,q", TQ, q(TQ))
    written(tmp_path / "effort.csv", "t_ms,tau", 1e3 * TA, tau(TA))
    (tmp_path / "notes.md").write_text("axis 3")
    seen = Recording.read(tmp_path / "position.csv+effort.csv")
    whole = Recording.read(f"{tmp_path / 'position.csv'}+{tmp_path / 'effort.csv'}")
    for one in (seen, whole, Recording.read(tmp_path)):
        agrees(one)
    assert seen.name == whole.name == "position+effort"
    assert "2 files were read as one run: position.csv, effort.csv." in seen.notes[0]
    assert seen.sha256 != Recording.read(tmp_path / "position.csv", required=()).sha256
    written(tmp_path / "other.csv", "t,tau,q", TQ, tau(TQ), q(TQ))
    with pytest.raises(RecordingError, match=r"is not a file but a folder of 3 recordings: other.csv holds torque and"):
        Recording.read(tmp_path)


def test_columns_of_one_name_are_named_after_their_files(tmp_path: Path) -> None:
    for name, t, x in (("position", TQ, q(TQ)), ("velocity", TV, 0.9 * tau(TV)), ("effort", TA, tau(TA))):
        written(tmp_path / f"{name}.csv", "time,joint1,joint2", t, x, 0.1 * t)
    path = tmp_path / "position.csv+velocity.csv+effort.csv"
    asked = preview(path).undecided
    assert "tau may be any of effort.joint1, effort.joint2" in asked[0]
    assert "q may be any of position.joint1, position.joint2" in asked[1]
    seen = Recording.read(path, {"tau": "effort.joint1", "q": "position.joint1"})
    agrees(seen)
    np.testing.assert_allclose(seen["v"], 0.9 * tau(seen.t), atol=1e-4)


def test_times_may_be_in_a_file_of_their_own_or_dates_of_several_kinds(
    tmp_path: Path,
) -> None:
    for name, column in (("time", TA), ("positions", q(TA)), ("torques", tau(TA))):
        written(tmp_path / f"{name}.txt", "", column)
    seen = Recording.read(tmp_path / "time.txt+positions.txt+torques.txt")
    np.testing.assert_allclose(seen["q"], q(TA), atol=1e-8)
    alone = preview(tmp_path / "positions.txt", {"layout": {"period": "1ms"}, "columns": {"q": "#1"}})
    assert "one column of numbers" in alone.recording.notes[0]
    np.testing.assert_allclose(alone.recording["q"], q(TA), atol=1e-8)
    written(tmp_path / "a.csv", "t,q", TQ, q(TQ))
    written(tmp_path / "b.csv", "tau,load", tau(TQ), q(TQ))
    agrees(Recording.read(tmp_path / "a.csv+b.csv"))
    written(tmp_path / "d.csv", "x1,q", 1e3 * TQ, q(TQ))
    agrees(Recording.read(tmp_path / "d.csv+b.csv", {"t": "x1"}, {"t": "ms"}))
    written(tmp_path / "b.csv", "tau,load", tau(TA), q(TA))
    with pytest.raises(RecordingError, match=r"b.csv has no time \(2,000 rows\); name it with --columns t="):
        Recording.read(tmp_path / "a.csv+b.csv")
    start = datetime(2026, 3, 1, 12, tzinfo=UTC)
    written(tmp_path / "a.csv", "time,position", [str(start + timedelta(seconds=t)) for t in TQ], q(TQ))
    stamps = [str(round(start.timestamp()) * 10**9 + round(1e9 * t)) for t in TA]
    written(tmp_path / "b.csv", "stamp_ns,effort", stamps, tau(TA))
    seen = Recording.read(tmp_path / "a.csv+b.csv")
    assert len(seen) == len(TQ)
    agrees(seen)
    written(tmp_path / "c.csv", "time,effort", [f"{start.timestamp() + t:.4f}" for t in TA], tau(TA))
    agrees(Recording.read(tmp_path / "a.csv+c.csv"))


def test_files_that_lack_what_the_other_has_are_asked_whether_they_are_one_run(tmp_path: Path) -> None:
    first = written(tmp_path / "position.csv", "t,q", TQ, q(TQ))
    second = written(tmp_path / "effort.csv", "t,tau", TA, tau(TA))
    with pytest.raises(InputError, match=r"are files of one run, give them as one: .*position.csv\+effort.csv\."):
        read_recordings([first, second], {}, None, None, "rotary")
    run = tmp_path / "position.csv+effort.csv"
    agrees(read_recordings([run], {}, None, ["position.csv+effort.csv:q=rad"], "rotary")[0])


@pytest.mark.parametrize("name", ["a+b.csv", "day:#2.csv"])
def test_a_file_whose_name_has_the_sign_is_one_file(tmp_path: Path, name: str) -> None:
    written(tmp_path / "a.csv", "t,q", TQ, q(TQ))
    try:
        path = written(tmp_path / name, "t,tau,q", TQ, tau(TQ), q(TQ))
    except OSError:
        pytest.skip("this file system takes no colon")
    assert (Recording.read(path).name, len(Recording.read(path))) == (name.removesuffix(".csv"), len(TQ))


@pytest.mark.parametrize(
    ("name", "rule"), [("a.csv+gone.csv", r"a.csv\+gone.csv does not exist"), ("", "is not a file")]
)
def test_files_that_are_not_there_and_an_empty_folder_are_refused(tmp_path: Path, name: str, rule: str) -> None:
    with pytest.raises(RecordingError, match=rule):
        Recording.read(tmp_path / name)


# Command line and page know each kind of file that is read.


def test_what_is_offered_is_read_and_what_is_read_is_offered(tmp_path: Path) -> None:
    for suffix in (*recordings(), ".toml", ".md"):
        path = tmp_path / f"run{suffix}"
        path.touch()
        assert is_recording(path) == (suffix in recordings()), suffix
        assert suffix not in recordings() or path.suffix in SUFFIXES.split(",")
