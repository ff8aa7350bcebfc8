"""The concealed mount of `truth.c` through ctypes: parameters by name in, arrays of one value a tick out."""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TICK = 1e-4
BLOCKS = 10
_SCALARS = """
    tick inertia inertia_swing inertia_cycles inertia_phase
    load_inertia drive_stiffness drive_damping gap load_friction load_viscous load_stiffness
    coulomb breakaway stribeck_speed stribeck_power stiffness damping viscous blend level_asymmetry viscous_asymmetry
    rough_relative rough_cycles rough_phase spot_relative spot_center spot_width dwell_torque dwell_time dwell_length
    load_sensitivity thermal_level thermal_viscous thermal_tilt heating warm_up_time payload payload_phase
    unbalance unbalance_phase offset cogging_1 cogging_2 cogging_3 cogging_cycles cogging_phase
    quadratic cable cable_home cable_hardening swerve remanence remanence_length home kick kick_time
    delay lag knee knee_slope ripple_1 ripple_2 ripple_cycles ripple_phase quantum kp kd observer loop_inertia
    controller ki speed_filter loop_every regular lorentz friction_lag run_in run_in_length
    viscous_swing viscous_cycles viscous_phase dead_band gain_swing gain_cycles gain_phase gain_fade
    shift shift_phase shift_time
    warp_place warp_place_cycles warp_place_phase warp_speed warp_speed_scale warp_time warp_time_rate warp_time_phase
    warp_way edge bend bend_rate bend_phase mottle mottle_cycles mottle_phase
"""  # the order of `struct mount`
ROWS = ("block_weight", "block_reach")
INPUTS = ("target", "target_speed", "target_acceleration", "push", "level", "noise", "ambient")
OUTPUTS = ("command", "reading", "clean_reading", "angle", "speed", "temperature", "friction", "extra")

_Pointer = ctypes.POINTER(ctypes.c_double)


def ticks(n: int) -> Array:
    """Times of the first n ticks of the loop [s]."""
    return TICK * np.arange(n, dtype=np.float64)


class _Mount(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in _SCALARS.split()] + [
        (name, ctypes.c_double * BLOCKS) for name in ROWS
    ]


class _Inputs(ctypes.Structure):
    _fields_ = [(name, _Pointer) for name in INPUTS]


class _Outputs(ctypes.Structure):
    _fields_ = [(name, _Pointer) for name in OUTPUTS]


@dataclass(frozen=True)
class Drive:
    """What acts on the mount, one value a tick (0.1 ms) each; see `struct inputs` in truth.c."""

    target: Array
    target_speed: Array
    target_acceleration: Array
    push: Array
    level: Array
    noise: Array
    ambient: Array


@cache
def _library() -> ctypes.CDLL:
    path = Path(__file__).with_name("_machine.so")
    if not path.exists():
        raise FileNotFoundError(f"{path} is missing: it is compiled from truth.c when the package is installed")
    library = ctypes.CDLL(str(path))
    library.truth_size.restype = ctypes.c_size_t
    if library.truth_size() != ctypes.sizeof(_Mount):
        raise RuntimeError(f"{path} is not of this truth.c: python cosim/master/loop/build_hook.py")
    return library


def _mount(parameters: Mapping[str, Any]) -> _Mount:
    defaults = {"tick": TICK, "warm_up_time": 30.0, "stribeck_speed": 0.01, "stribeck_power": 1.0}
    mount = _Mount(**{**defaults, **{k: v for k, v in parameters.items() if k not in ROWS}})
    for name in ROWS:
        if name in parameters:
            setattr(mount, name, (ctypes.c_double * BLOCKS)(*parameters[name]))
    return mount


def _pointers(arrays: Mapping[str, Array]) -> dict[str, Any]:
    return {name: array.ctypes.data_as(_Pointer) for name, array in arrays.items()}


def simulate(parameters: Mapping[str, Any], drive: Drive, temperature: float = 20.0) -> dict[str, Array]:
    """The closed loop from rest, with names as in `struct mount` (absent: zero) and `struct outputs`."""
    n = drive.target.size
    inputs = {name: np.ascontiguousarray(getattr(drive, name), dtype=float) for name in INPUTS}
    if wrong := [name for name, array in inputs.items() if array.size != n]:
        raise ValueError(f"inputs {wrong} do not have the length of the target, {n}")
    outputs: dict[str, Array] = {name: np.empty(n) for name in OUTPUTS}
    mount, given, made = _mount(parameters), _Inputs(**_pointers(inputs)), _Outputs(**_pointers(outputs))
    run = _library().truth_run
    run(ctypes.byref(mount), ctypes.c_long(n), ctypes.c_double(temperature), ctypes.byref(given), ctypes.byref(made))
    return outputs


def rub(parameters: Mapping[str, Any], angle: Array, step: float, degrees: float = 20.0) -> Array:
    """Friction torque along a prescribed path [rad], sampled every `step` seconds."""
    mount, torque = _mount(parameters), np.empty(angle.size)
    path = np.ascontiguousarray(angle, dtype=float)
    pointers = [array.ctypes.data_as(_Pointer) for array in (path, torque)]
    size, h, warm = ctypes.c_long(angle.size), ctypes.c_double(step), ctypes.c_double(degrees)
    _library().truth_rub(ctypes.byref(mount), size, h, warm, *pointers)
    return torque
