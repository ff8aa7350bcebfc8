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
    found = ctypes.CDLL(str(path))
    if found.hardware_layout() != LAYOUT:
        raise HardwareError(f"{path} was built from another version; reinstall the package.", culprit=str(path))
    found.hardware_ready.argtypes = [POINTER(CAxis)]
    found.hardware_run.argtypes = [POINTER(CSession), POINTER(CSample), c_int64]
    found.hardware_spawn.argtypes = [POINTER(CSession), POINTER(CSample)]
    found.hardware_bare.argtypes = [POINTER(CSession), c_int64]
    found.hardware_release.argtypes = [POINTER(CSession)]
    found.hardware_replay.argtypes = [POINTER(CAxis), POINTER(CRecord), c_int64]
    found.drive_open.argtypes = [POINTER(CDrive), POINTER(CAdapter)]
    found.udp_open.argtypes = [POINTER(CUdp), POINTER(CAdapter)]
    found.virtual_run.argtypes = [POINTER(CVirtual), POINTER(CAdapter)]
    for function in (found.hardware_ready, found.hardware_run, found.hardware_spawn, found.drive_open):
        function.restype = c_int64
    for function in (found.hardware_bare, found.hardware_release, found.hardware_replay, found.udp_open):
        function.restype = None
    found.virtual_run.restype = None
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
    references = [np.array([component.ports[n].reference for n in names], np.uint32) for names in (inputs, outputs)]
    values = [np.zeros(len(names)) for names in (inputs, outputs)]
    part = CPart(
        version=functions.version,
        instance=functions.instance,
        set=functions.set,
        get=functions.get,
        step=functions.step,
        save=functions.save,
        restore=functions.restore,
        inputs=len(inputs),
        outputs=len(outputs),
        input_references=references[0].ctypes.data,
        output_references=references[1].ctypes.data,
        input=values[0].ctypes.data,
        output=values[1].ctypes.data,
        every=1,
        state=functions.state,
    )
    return part, (*references, *values)
