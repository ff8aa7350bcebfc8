"""A test run that is killed leaves no drive and no server alive."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mortal import mortal

RUN = f"""
import subprocess, sys
sys.path.insert(0, {str(Path(__file__).parents[1] / "tools")!r})
from mortal import mortal
drive = subprocess.Popen(mortal("sleep", "600"))
print(drive.pid, flush=True)
drive.wait()
"""


def name_of(process: int) -> str:
    """What a process runs; nothing where it is gone, or waits to be counted out."""
    try:
        return Path(f"/proc/{process}/cmdline").read_text("utf-8").partition("\0")[0]
    except FileNotFoundError:
        return ""


def wait_until(process: int, name: str) -> None:
    last = time.monotonic() + 60
    while name_of(process) != name:
        assert time.monotonic() < last, f"{process} is still {name_of(process)!r}"
        time.sleep(0.01)


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone tells a process of its parent's end")
def test_what_a_test_started_ends_with_a_test_run_that_is_killed() -> None:
    with subprocess.Popen([sys.executable, "-c", RUN], stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        drive = int(run.stdout.readline())
        wait_until(drive, "sleep")
        os.kill(run.pid, signal.SIGKILL)
    try:
        wait_until(drive, "")
    finally:
        if name_of(drive) == "sleep":
            os.kill(drive, signal.SIGKILL)


def test_what_is_run_is_the_command_itself() -> None:
    words = (sys.executable, "-c", "import sys; print(sys.argv[1:])", "-p", "0", "")
    done = subprocess.run(mortal(*words), capture_output=True, text=True, check=True)
    assert done.stdout == "['-p', '0', '']\n"
