"""What a diagnosis computes most, in one C library; None where it was not built, and then Python does the same."""

import ctypes
import sys
from ctypes import POINTER, c_double, c_int, c_longlong, c_void_p
from functools import cache
from pathlib import Path

import numpy as np

SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


class CTape(ctypes.Structure):
    """A tape as `kernels.h` has it."""

    _fields_ = [
        ("shared", c_void_p),
        ("rowwise", c_void_p),
        *((name, c_longlong) for name in ("shared_count", "rowwise_count", "inputs", "slots", "outputs", "registers")),
    ]


ARGUMENTS = {
    "tape_run": [POINTER(CTape), c_void_p, c_void_p, c_longlong, c_void_p],
    "filter_run": [c_void_p, c_longlong, c_longlong, c_longlong, c_void_p, c_void_p, c_longlong],
    "play_run": [c_void_p, c_longlong, c_double, c_void_p, c_longlong, c_void_p],
    "recurrence_run": [c_void_p, c_void_p, c_longlong, c_longlong, c_void_p],
    "marginal_run": [
        *(c_void_p, c_void_p, c_longlong, c_longlong, c_void_p, c_void_p, c_void_p, c_longlong),
        *(c_void_p, c_void_p, c_void_p, c_longlong, c_void_p, c_void_p, c_void_p, c_void_p),
    ],
}


@cache
def library() -> ctypes.CDLL | None:
    """The library; None where it is missing or does not fit this machine."""
    try:
        found = ctypes.CDLL(str(Path(__file__).with_name(f"_kernels{SUFFIX}")))
        for name, arguments in ARGUMENTS.items():
            if name == "play_run" and not hasattr(found, name):
                continue  # a work tree's library that was built before it had plays: they are walked in Python
            function = getattr(found, name)
            function.argtypes, function.restype = arguments, c_int
    except (OSError, AttributeError):
        return None
    return found


def done(returned: int, meaning: str = "") -> None:
    """Check what a kernel returned: 1 without memory, 2 where the numbers do not allow what was to be done.

    Raises:
        MemoryError: there was not enough memory.
        numpy.linalg.LinAlgError: the numbers do not allow it, in the words of `meaning`.
    """
    if returned == 1:
        raise MemoryError("there is not enough memory for the rows of a recording")
    if returned:
        raise np.linalg.LinAlgError(meaning)
