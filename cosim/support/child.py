"""The process of a cell: `python -m cosim.support.child BOARD PARENT`, calls on stdin, answers on stdout, both pickled.

What an FMU prints goes to stderr, so that it cannot get between the answers; where it reads, there is nothing. Ctrl-C
is the parent's business; SIGTERM ends a call as Ctrl-C would. A process whose parent is gone ends too.
"""

import os
import pickle
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from shutil import rmtree
from threading import Thread
from typing import IO, Any

from cosim.support.activity import watched
from cosim.support.errors import CosimError
from cosim.support.files import forget_partials
from cosim.support.interrupts import ENDING, end_well
from cosim.support.scratch import PREFIX

PAUSE, GRACE = 0.5, 2.0
"""Seconds between two looks for the parent; seconds to end well once it is gone."""
_ANSWERS: list[IO[bytes]] = []


def main() -> None:
    """Answer calls until the parent has no more, or is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_well()
    try:
        watched(Path(sys.argv[1]))
    except FileNotFoundError:  # the parent was interrupted and has tidied up before this process was ready
        return
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    _ANSWERS.append(answers)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    calls = os.fdopen(os.dup(sys.stdin.fileno()), "rb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, sys.stdin.fileno())  # an FMU that reads finds nothing there, and takes no call away
    os.close(nothing)
    try:
        # The parent has no more calls, or is gone, perhaps in the middle of one.
        with suppress(EOFError, KeyboardInterrupt, BrokenPipeError, pickle.UnpicklingError):
            _listen(calls, int(sys.argv[2]))
    except KeyboardInterrupt:
        pass  # it came on the way out
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    _remove_folder()


def _listen(calls: IO[bytes], parent: int) -> None:
    Thread(target=_mind_parent, args=(parent,), daemon=True).start()
    while True:
        function, arguments = pickle.load(calls)
        _put("answer", _answer(function, arguments))


def tell(*content: Any) -> None:
    """Tell the parent something before the answer."""
    _put("told", content)


def _put(kind: str, content: Any) -> None:
    for answers in _ANSWERS:
        pickle.dump((kind, content), answers)
        answers.flush()


def _answer(function: Any, arguments: Any) -> Any:
    try:
        return function(*arguments)
    except (CosimError, KeyboardInterrupt, OSError, MemoryError) as error:
        return error


def _mind_parent(parent: int) -> None:
    """End this process when its parent has ended: well if it can, without a trace if a component does not return."""
    while os.getppid() == parent:
        time.sleep(PAUSE)
    with suppress(AttributeError):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(GRACE)
    forget_partials()
    _remove_folder()
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)  # Windows has no groups of processes


def _remove_folder() -> None:
    """Remove the folder for temporary files, which the parent made under a name of ours."""
    folder = Path(sys.argv[1]).parent
    if folder.name.startswith(PREFIX):
        rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    from cosim.support import child  # the module that called functions import, not this copy of it: they `tell` there

    child.main()
