"""The process in which runs happen: `python -m cosim.sweep.child`, calls on stdin, answers on stdout, both pickled.

What an FMU prints goes to stderr, so that it cannot get between the answers. Ctrl-C is the parent's business.
"""

import os
import pickle
import signal
import sys
from typing import Any

from cosim.errors import InputError


def main() -> None:
    """Answer calls until the parent has no more, or is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    while True:
        try:
            function, arguments = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(_answer(function, arguments), answers)
        answers.flush()


def _answer(function: Any, arguments: Any) -> Any:
    try:
        return function(*arguments)
    except InputError as error:
        return error


if __name__ == "__main__":
    main()
