"""The plant's C code, compiled once and called with arrays."""

import ctypes
import hashlib
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).with_name("plant.c")
FLAGS = ("-O2", "-ffp-contract=off", "-fno-fast-math", "-shared", "-fPIC")


def names(prefix):
    """List the names that the C code uses with a prefix, in order of appearance."""
    return list(dict.fromkeys(re.findall(rf"\b{prefix}_(\w+)", SOURCE.read_text("utf-8").split("*/", 1)[1])))


PARAMETERS = names("P")
CHANNELS = names("C")
ALWAYS_ON = {"vt": 1.0, "Vs": 1.0, "delta": 2.0, "dahl_n": 1.0, "ep_ba": 0.5, "vsmall": 1e-4, "ffv": 1.0, "turn": 1.0,
             "cg_half": 1.0, "runaway": 1e9, "limit": 1e9, "vfilter": 1.0, "loop": 1e-9}  # fmt: skip
"""Parameters that divide or limit, so that 0 is no neutral value."""


def library(folder=None):
    """Compile (unless a build of this very text is there) and load."""
    lines = ["enum { " + ", ".join(f"P_{name}" for name in PARAMETERS) + " };"]
    lines += ["enum { " + ", ".join(f"C_{name}" for name in CHANNELS) + ", NC };"]
    text = "\n".join(lines) + "\n" + SOURCE.read_text("utf-8")
    digest = hashlib.sha256((text + " ".join(FLAGS)).encode()).hexdigest()[:16]
    place = Path(folder or Path(tempfile.gettempdir()) / f"machines-{os.getuid() if hasattr(os, 'getuid') else 0}")
    built = place / f"plant-{digest}.so"
    if not built.exists():
        place.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=place) as box:
            source, fresh = Path(box) / "plant.c", Path(box) / "plant.so"
            source.write_text(text, "utf-8")
            subprocess.run([*_compiler(), *FLAGS, str(source), "-o", str(fresh), "-lm"], check=True)
            os.replace(fresh, built)
    return ctypes.CDLL(str(built))


def _compiler():
    try:
        import ziglang  # noqa: F401
    except ImportError:
        return ["cc"]
    return [sys.executable, "-m", "ziglang", "cc"]


_LIBRARY = None


def _lib():
    global _LIBRARY
    _LIBRARY = _LIBRARY or library()
    return _LIBRARY


def _pointer(array):
    return array.ctypes.data_as(ctypes.c_void_p)


def simulate(parameters, period, steps, arrays, slips, channels):
    """Run the plant.

    Args:
        parameters: by name; those not named are off.
        period: controller period in s.
        steps: integration steps a period.
        arrays: qd, vd, ad, noise, shake, tone, level, temp, one value a tick.
        slips: stiffness and share of Maxwell-slip elements.
        channels: names of the channels that are wanted.

    Returns:
        command, true position under the encoder, reading, channels (ticks x channels); or None if it ran away.
    """
    unknown = set(parameters) - set(PARAMETERS)
    if unknown:
        raise KeyError(f"the plant has no parameter {sorted(unknown)}")
    values = np.array([parameters.get(name, ALWAYS_ON.get(name, 0.0)) for name in PARAMETERS], float)
    inputs = [np.ascontiguousarray(arrays[name], float)
              for name in ("qd", "vd", "ad", "noise", "shake", "tone", "level", "temp")]  # fmt: skip
    stiff, share = (np.ascontiguousarray(x, float) for x in slips)
    n, wanted = len(inputs[0]), np.array([CHANNELS.index(name) for name in channels], np.int32)
    command, position, reading = np.empty(n), np.empty(n), np.empty(n)
    table = np.empty((n, len(wanted)))
    failed = _lib().simulate(
        ctypes.c_int(n), ctypes.c_int(steps), ctypes.c_double(period), _pointer(values), *map(_pointer, inputs),
        _pointer(stiff), _pointer(share), ctypes.c_int(len(stiff)), _pointer(wanted), ctypes.c_int(len(wanted)),
        *map(_pointer, (command, position, reading, table)),
    )  # fmt: skip
    return None if failed else (command, position, reading, table)


def bristle(v, dt, kappa, rho, Vs):
    """LuGre's bristle along a speed: force per Coulomb level, and rate of deflection."""
    v = np.ascontiguousarray(v, float)
    force, rate = np.empty(len(v)), np.empty(len(v))
    _lib().bristle(ctypes.c_int(len(v)), ctypes.c_double(dt), _pointer(v), *map(ctypes.c_double, (kappa, rho, Vs)),
                   _pointer(force), _pointer(rate))  # fmt: skip
    return force, rate
