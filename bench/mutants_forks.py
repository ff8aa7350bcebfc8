"""Tests run in a fork that has all but the tree loaded already, for so many seconds of a processor."""

import os
import resource
import signal
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from math import ceil
from pathlib import Path

from mutants_choice import HOME, PRODUCT

HEAVY = ("casadi", "fmpy", "pandas", "pyarrow.parquet", "scipy.signal", "scipy.optimize", "scipy.stats")
"""What is loaded here need not be loaded in each fork."""
"""What a fork loads anew, from the tree; with it what lies beside this file."""


def preloaded() -> None:
    """Load what every fork needs."""
    for one in HEAVY:
        import_module(one)


def forked(run: Callable[[], int], place: Path, said: Path, seconds: float) -> tuple[int, float]:
    """Run something in a copy of the tree; its exit code (that of a signal negative) and seconds of a processor."""
    pid = os.fork()
    if not pid:  # whatever happens there, nothing of the bench goes on in the fork
        try:
            _moved(place, said, ceil(seconds))
            os._exit(run())
        except BaseException:
            traceback.print_exc()
            sys.stderr.flush()
        finally:
            os._exit(4)
    _, status, usage = os.wait4(pid, 0)
    with suppress(ProcessLookupError):  # what a file of tests left behind: it had a session of its own
        os.killpg(pid, signal.SIGKILL)
    return os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime


def _moved(place: Path, said: Path, most: int) -> None:
    """Be in the copy: what is ours is loaded from there, what is said goes to a file, and time is short."""
    os.setsid()
    os.chdir(place)
    os.environ |= {"PYTHONPATH": str(place), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    sys.dont_write_bytecode = True
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 5))
    sys.path[:] = [str(place), *(one for one in sys.path if not _is_of_home(one))]
    beside = {one.stem for one in Path(__file__).parent.glob("*.py")}
    for module in [one for one in sys.modules if one.split(".")[0] in beside.union(PRODUCT)]:
        del sys.modules[module]
    with said.open("w") as output:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)


def _is_of_home(folder: str) -> bool:
    """Whether modules there are those of which a copy is changed; a virtual environment may lie in their tree."""
    return (folder == str(HOME) or folder.startswith(str(HOME) + os.sep)) and not folder.startswith(sys.prefix + os.sep)
