"""How many threads linear algebra works in: one, unless the environment says otherwise.

Matrices of a diagnosis are small: more threads make it no faster and wait for each other with the processor (11 s of
it in one thread, 21 s in two, 3 x 60 s at 1 kHz). A command says so before libraries are loaded; a call from Python
finds them loaded.
"""

import os
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""What the libraries of linear algebra read as they are loaded."""


def in_one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Let linear algebra have one thread while a function is called, and as many as before after that.

    The limit is the whole process's where the library has no other; where one of `VARIABLES` is set nothing is changed.
    """

    @wraps(function)
    def limited(*given: P.args, **named: P.kwargs) -> R:
        if any(name in os.environ for name in VARIABLES):
            return function(*given, **named)
        from threadpoolctl import threadpool_limits  # here, so that a command does without it

        with threadpool_limits(1, "blas"):
            return function(*given, **named)

    return limited
