"""Processes of tests that end with the test run, however that ends: after SIGKILL nobody is left to tidy up."""

import os
import sys
from contextlib import suppress
from pathlib import Path

DIES = """
import ctypes, os, sys
PR_SET_PDEATHSIG, SIGKILL = 1, 9
ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, SIGKILL)
if os.getppid() == int(sys.argv[1]):  # or it was gone before
    os.execvp(sys.argv[2], sys.argv[2:])
"""


def mortal(*command: str) -> list[str]:
    """Return the command that does the same, and that Linux kills when the thread that starts it ends."""
    if sys.platform != "linux":
        return list(command)
    return [sys.executable, "-c", DIES, str(os.getpid()), *command]


def marked(mark: str | Path) -> list[str]:
    """Other processes in whose environment a text is, as their numbers."""
    found = []
    for one in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):
            if one.parent.name != str(os.getpid()) and os.fsencode(mark) in one.read_bytes():
                found.append(one.parent.name)
    return found
