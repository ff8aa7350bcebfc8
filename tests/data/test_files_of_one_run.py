"""Several files of one run, with a sign between them or in a folder, are one recording; what is open is asked."""

import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.reading import read_recordings
from cosim.support.errors import InputError, RecordingError

TA, TQ, TV = np.arange(2000) / 1000, 3e-4 + np.arange(1000) / 500, np.arange(1500) / 750


def tau(t: np.ndarray) -> np.ndarray:
    return np.cos(9 * t)


def q(t: np.ndarray) -> np.ndarray:
    return 0.1 * np.sin(9 * t)


def written(path: Path, header: str, *columns: object) -> Path:
    rows = zip(*columns, strict=True)
    lines = [",".join(x if isinstance(x, str) else f"{x:.9g}" for x in row) for row in rows]
    path.write_text("\n".join(([header] if header else []) + lines) + "\n")
    return path


def agrees(seen: Recording) -> None:
    np.testing.assert_allclose(seen["q"], q(seen.t - seen.t[0] + 3e-4), atol=1e-8)
    np.testing.assert_allclose(seen["tau"], tau(seen.t - seen.t[0] + 3e-4), atol=3e-5)


def test_files_of_one_run_are_joined_and_named_in_a_note(tmp_path: Path) -> None:
    written(tmp_path / "position.csv", "t,q", TQ, q(TQ))
    written(tmp_path / "effort.csv", "t_ms,tau", 1e3 * TA, tau(TA))
    seen = Recording.read(tmp_path / "position.csv+effort.csv")
    agrees(seen)
    assert seen.name == "position+effort"
    assert "2 files were read as one run: position.csv, effort.csv." in seen.notes[0]
    assert seen.sha256 != Recording.read(tmp_path / "position.csv", required=()).sha256
    whole = Recording.read(f"{tmp_path / 'position.csv'}+{tmp_path / 'effort.csv'}")
    agrees(whole)
    assert whole.name == seen.name


def test_a_folder_of_such_files_is_one_run(tmp_path: Path) -> None:
    written(tmp_path / "position.csv", "time,position", TQ, q(TQ))
    written(tmp_path / "effort.csv", "time,effort", TA, tau(TA))
    (tmp_path / "notes.md").write_text("axis 3")
    agrees(Recording.read(tmp_path))
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


def test_one_value_a_line_and_the_times_in_a_file_of_their_own(tmp_path: Path) -> None:
    for name, column in (("time", TA), ("positions", q(TA)), ("torques", tau(TA))):
        written(tmp_path / f"{name}.txt", "", column)
    seen = Recording.read(tmp_path / "time.txt+positions.txt+torques.txt")
    np.testing.assert_allclose(seen["q"], q(TA), atol=1e-8)
    alone = preview(tmp_path / "positions.txt", {"layout": {"period": "1ms"}, "columns": {"q": "#1"}})
    assert "one column of numbers" in alone.recording.notes[0]
    np.testing.assert_allclose(alone.recording["q"], q(TA), atol=1e-8)


def test_dates_of_several_kinds_are_one_time(tmp_path: Path) -> None:
    start = datetime(2026, 3, 1, 12, tzinfo=UTC)
    written(tmp_path / "a.csv", "time,position", [str(start + timedelta(seconds=t)) for t in TQ], q(TQ))
    stamps = [str(round(start.timestamp()) * 10**9 + round(1e9 * t)) for t in TA]
    written(tmp_path / "b.csv", "stamp_ns,effort", stamps, tau(TA))
    seen = Recording.read(tmp_path / "a.csv+b.csv")
    assert len(seen) == len(TQ)
    agrees(seen)
    written(tmp_path / "c.csv", "time,effort", [f"{start.timestamp() + t:.4f}" for t in TA], tau(TA))
    agrees(Recording.read(tmp_path / "a.csv+c.csv"))


def test_a_file_without_a_time_has_that_of_one_with_as_many_rows_only(tmp_path: Path) -> None:
    written(tmp_path / "a.csv", "t,q", TQ, q(TQ))
    written(tmp_path / "b.csv", "tau,load", tau(TQ), q(TQ))
    agrees(Recording.read(tmp_path / "a.csv+b.csv"))
    written(tmp_path / "b.csv", "tau,load", tau(TA), q(TA))
    with pytest.raises(RecordingError, match=r"b.csv has no time \(2,000 rows\); name it with --columns t="):
        Recording.read(tmp_path / "a.csv+b.csv")


def test_files_that_lack_what_the_other_has_are_asked_whether_they_are_one_run(tmp_path: Path) -> None:
    first = written(tmp_path / "position.csv", "t,q", TQ, q(TQ))
    second = written(tmp_path / "effort.csv", "t,tau", TA, tau(TA))
    with pytest.raises(InputError, match=r"are files of one run, give them as one: .*position.csv\+effort.csv\."):
        read_recordings([first, second], {}, None, None, "rotary")
    run = tmp_path / "position.csv+effort.csv"
    agrees(read_recordings([run], {}, None, ["position.csv+effort.csv:q=rad"], "rotary")[0])


def test_a_file_whose_name_has_the_sign_is_one_file(tmp_path: Path) -> None:
    written(tmp_path / "a.csv", "t,q", TQ, q(TQ))
    path = written(tmp_path / "a+b.csv", "t,tau,q", TQ, tau(TQ), q(TQ))
    assert Recording.read(path).name == "a+b"
    with pytest.raises(RecordingError, match=r"a.csv\+gone.csv does not exist"):
        Recording.read(tmp_path / "a.csv+gone.csv")
    shutil.rmtree(tmp_path / "empty", ignore_errors=True)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="is not a file"):
        Recording.read(tmp_path / "empty")
