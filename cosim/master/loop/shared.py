"""What every C library of this project shares: how it is opened and declared, and how it sees a component."""

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from cosim.fmi.component import Functions
from cosim.master.loop.structures import CPart


def opened(path: str, probe: str, layout: int) -> ctypes.CDLL:
    """Open a library whose function `probe` says for which layout of the structures it was built.

    Raises:
        OSError: it cannot be loaded, or was built from another version of its C.
    """
    library = ctypes.CDLL(path)
    if not hasattr(library, probe) or getattr(library, probe)() != layout:
        raise OSError(f"{path} was built from another version")
    return library


def declare(library: ctypes.CDLL, returns: type[ctypes.c_int64] | None, **functions: Sequence[Any]) -> None:
    """Declare the types of arguments of functions that all return the same."""
    for name, arguments in functions.items():
        function = getattr(library, name)
        function.argtypes, function.restype = list(arguments), returns


def part(
    functions: Functions, references: tuple[np.ndarray, np.ndarray], input_: int, output: int, **more: Any
) -> CPart:
    """Return a component as the C sees it: its functions, references of inputs and outputs, addresses of the values."""
    inputs, outputs = references
    return CPart(
        version=functions.version,
        instance=functions.instance,
        set=functions.set,
        get=functions.get,
        step=functions.step,
        save=functions.save,
        restore=functions.restore,
        inputs=len(inputs),
        outputs=len(outputs),
        input_references=inputs.ctypes.data,
        output_references=outputs.ctypes.data,
        input=input_,
        output=output,
        state=functions.state,
        altered=functions.altered,
        **more,
    )
