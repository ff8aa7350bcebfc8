"""A process whose parent, folder or lock is gone ends without a trace, and what a killed one left goes."""

import os
import pickle
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from commands import ENVIRONMENT
from test_isolation import left, linux

from cosim.support.activity import SIZE, Board
from cosim.support.scratch import PREFIX


def test_a_board_tells_another_process_what_is_done(tmp_path: Path) -> None:
    one, other = Board(tmp_path / "board"), Board(tmp_path / "board")
    one.write("mount", "loaded")
    assert other.work == ("mount", "loaded")
    one.write()
    assert other.work == ("", "")


@linux
def test_what_a_killed_process_left_half_written_goes_with_the_next_run(tmp_path: Path) -> None:
    from cosim.support.lock import claimed

    ended = subprocess.Popen([sys.executable, "-c", "pass"])
    ended.wait()
    for name in (f".a.parquet.{ended.pid}.partial", f".a.parquet.{os.getpid()}.partial", ".x.partial"):
        (tmp_path / name).touch()
    with claimed(tmp_path, "run"):
        pass
    assert left(tmp_path) == [f".a.parquet.{os.getpid()}.partial", ".x.partial"]


def test_a_lock_survives_the_file_being_removed(tmp_path: Path) -> None:
    from cosim.support.errors import OutputError
    from cosim.support.lock import claimed

    with claimed(tmp_path / "out", "run"):
        with pytest.raises(OutputError, match="Another run is writing"), claimed(tmp_path / "out", "run"):
            pass
        shutil.rmtree(tmp_path / "out")
    with claimed(tmp_path / "out", "run"):
        assert left(tmp_path) == ["out", "out/.cosim.lock"]
    assert left(tmp_path) == []


@linux
@pytest.mark.parametrize("call", [b"", b"\x80\x05\x95\xff\xff", pickle.dumps((print, ("heard",)))[:-5]])
@pytest.mark.parametrize("orphan", [False, True])
def test_a_process_whose_parent_is_gone_in_the_middle_of_a_call_ends_without_a_trace(
    tmp_path: Path, call: bytes, orphan: bool
) -> None:
    folder = tmp_path / f"{PREFIX}own"
    folder.mkdir()
    (folder / "board").write_bytes(bytes(SIZE))
    parent = ["1"] if orphan else [str(os.getpid())]  # one that ended before its child had begun
    command = [sys.executable, "-m", "cosim.support.child", str(folder / "board"), *parent]
    done = subprocess.run(
        command, env=ENVIRONMENT, input=call, capture_output=True, start_new_session=True, timeout=60, check=False
    )
    assert done.stderr == b""
    assert not folder.exists()


@linux
def test_a_process_whose_parent_was_gone_before_it_began_does_not_work_on(tmp_path: Path) -> None:
    folder = tmp_path / f"{PREFIX}own"
    folder.mkdir()
    (folder / "board").write_bytes(bytes(SIZE))
    command = [sys.executable, "-m", "cosim.support.child", str(folder / "board"), "1"]
    process = subprocess.Popen(command, env=ENVIRONMENT, stdin=subprocess.PIPE, start_new_session=True)
    assert process.stdin is not None
    process.stdin.write(pickle.dumps((time.sleep, (600.0,))))
    process.stdin.flush()
    process.wait(60)
    process.stdin.close()
    assert not folder.exists()


def test_a_process_whose_folder_is_gone_before_it_is_ready_ends_without_a_word(tmp_path: Path) -> None:
    """Ctrl-C may come so early that the parent has tidied up when its process looks for what they share."""
    command = [sys.executable, "-m", "cosim.support.child", str(tmp_path / "gone" / "activity"), str(os.getpid())]
    done = subprocess.run(
        command, env=ENVIRONMENT, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
