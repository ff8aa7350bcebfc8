"""Temporary folders: gone at the end, kept while somebody lives, tidied up after somebody was killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from cosim.support.scratch import PREFIX, YOUNG, Scratch, tidy

HOLD = "import time; from cosim.support.scratch import Scratch; s = Scratch(); print(s.name, flush=True); time.sleep(9)"


@pytest.fixture
def holder(tmp_path: Path) -> subprocess.Popen[str]:
    """A process that lives in a folder of its own under `tmp_path`."""
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-c", HOLD], env=environment, stdout=subprocess.PIPE, text=True) as process:
        yield process
        process.kill()


def aged(folder: Path) -> Path:
    """Make a folder look as old as those that are tidied up."""
    long_ago = time.time() - 2 * YOUNG
    os.utime(folder, (long_ago, long_ago))
    return folder


def tidied(folder: Path) -> None:
    tidy.cache_clear()
    tidy(str(folder))


def test_a_folder_is_removed_at_its_end_and_by_its_context() -> None:
    with Scratch() as name:
        assert Path(name).name.startswith(PREFIX)
    assert not Path(name).exists()
    own = Scratch()
    own.cleanup()
    assert not Path(own.name).exists()


def test_what_a_killed_process_left_goes_and_what_a_living_one_holds_stays(
    tmp_path: Path, holder: subprocess.Popen[str]
) -> None:
    assert holder.stdout is not None
    folder = aged(Path(holder.stdout.readline().strip()))
    tidied(tmp_path)
    assert folder.exists()
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert folder.exists()
    tidied(tmp_path)
    assert not folder.exists()


def test_nothing_else_is_touched(tmp_path: Path) -> None:
    others = [tmp_path / "cosim-results", tmp_path / "scratch", tmp_path / f"{PREFIX}young"]
    for one in others:
        one.mkdir()
    for one in others[:2]:
        aged(one)
    tidied(tmp_path)
    assert all(one.exists() for one in others)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_signal_while_a_folder_is_removed_waits_until_it_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    folder = Scratch()
    path = Path(folder.name)
    (path / "file").write_text("x")
    removed = os.unlink

    def unlink(*given: Any, **named: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        removed(*given, **named)

    monkeypatch.setattr(os, "unlink", unlink)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            folder.cleanup()
    finally:
        signal.signal(signal.SIGINT, before)
    assert not path.exists()
