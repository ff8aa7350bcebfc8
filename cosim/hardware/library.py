"""The compiled loop of the hardware, and parts of it made from components."""

import ctypes
import mmap
import sys
from ctypes import POINTER, Structure, c_int64
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from cosim.component import Component, Functions
from cosim.errors import HardwareError
from cosim.hardware.structures import LAYOUT, CAdapter, CAxis, CDrive, CRecord, CSample, CSession, CUdp, CVirtual
from cosim.loop.shared import declare, opened, part
from cosim.loop.structures import CPart

Kind = TypeVar("Kind", bound=Structure)


@cache
def library() -> ctypes.CDLL:
    """Load the compiled loop.

    Raises:
        HardwareError: it was not built for this machine.
    """
    path = Path(__file__).with_name("_hardware.so")
    if not path.exists():
        where = "reinstall the package to build it" if sys.platform == "linux" else "it needs Linux"
        raise HardwareError(f"The compiled loop of the hardware is missing here: {where}.", culprit=str(path))
    try:
        found = opened(str(path), "hardware_layout", LAYOUT)
    except OSError as error:
        raise HardwareError(f"{error}; reinstall the package.", culprit=str(path)) from error
    declare(
        found,
        c_int64,
        hardware_ready=[POINTER(CAxis)],
        hardware_run=[POINTER(CSession), POINTER(CSample), c_int64],
        hardware_spawn=[POINTER(CSession), POINTER(CSample)],
        drive_open=[POINTER(CDrive), POINTER(CAdapter)],
    )
    declare(
        found,
        None,
        hardware_bare=[POINTER(CSession), c_int64],
        hardware_release=[POINTER(CSession)],
        hardware_replay=[POINTER(CAxis), POINTER(CRecord), c_int64],
        udp_open=[POINTER(CUdp), POINTER(CAdapter)],
        virtual_run=[POINTER(CVirtual), POINTER(CAdapter)],
    )
    return found


def shared(structure: Kind) -> Kind:
    """Return a copy of a structure in memory that a forked process sees too, as this one sees what it writes there."""
    size = ctypes.sizeof(structure)
    made = type(structure).from_buffer(mmap.mmap(-1, size))
    ctypes.memmove(ctypes.addressof(made), ctypes.addressof(structure), size)
    return made


def part_of(component: Component, inputs: list[str], outputs: list[str]) -> tuple[CPart, tuple[np.ndarray, ...]]:
    """Return a component as the C loops see it, and the arrays that must live as long as it is used.

    Raises:
        HardwareError: only Python can step it.
    """
    functions = component.functions
    if not isinstance(functions, Functions):
        message = f"{component.name} can only be stepped by Python; a machine needs an FMU."
        raise HardwareError(message, culprit=component.name)
    read, written = (
        np.array([component.ports[name].reference for name in names], np.uint32) for names in (inputs, outputs)
    )
    values = [np.zeros(len(names)) for names in (inputs, outputs)]
    made = part(functions, (read, written), *(one.ctypes.data for one in values), every=1)
    return made, (read, written, *values)
