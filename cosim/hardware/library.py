"""The compiled loop of the hardware, and parts of it made from components."""

import ctypes
import mmap
import sys
from ctypes import POINTER, Structure, c_char_p, c_int64
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from cosim.fmi.component import Component, Functions
from cosim.hardware.structures import LAYOUT, CAdapter, CAxis, CDrive, CRecord, CSample, CSession, CUdp, CVirtual
from cosim.master.loop.shared import declare, opened, part
from cosim.master.loop.structures import CPart
from cosim.support.errors import HardwareError

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
        udp_open=[POINTER(CUdp), POINTER(CAdapter), c_char_p],
        udp_bye=[POINTER(CUdp)],
        virtual_run=[POINTER(CVirtual), POINTER(CAdapter), c_char_p],
        hardware_mac=[c_char_p, c_int64, c_char_p, c_int64, c_char_p],
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
        HardwareError: only Python can step it, or a variable is of another type than double.
    """
    functions = component.functions
    if not isinstance(functions, Functions):
        message = f"{component.name} can only be stepped by Python; a machine needs an FMU."
        raise HardwareError(message, culprit=component.name)
    for name in (*inputs, *outputs):
        if not component.ports[name].real:
            message = f'"{component.name}.{name}" is no single double, and loops on a machine carry nothing else.'
            raise HardwareError(message, culprit=f"{component.name}.{name}")
    read, written = (
        np.array([component.ports[name].reference for name in names], np.uint32) for names in (inputs, outputs)
    )
    values = [np.zeros(len(names)) for names in (inputs, outputs)]
    made = part(functions, (read, written), *(one.ctypes.data for one in values), every=1)
    return made, (read, written, *values)
