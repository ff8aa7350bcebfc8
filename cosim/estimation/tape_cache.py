"""Tapes of structures on disk: deriving the derivatives of one takes longer than a recording of it."""

import hashlib
import marshal
import os
import shutil
import time
from collections.abc import Callable, Sequence
from functools import cache
from itertools import chain
from pathlib import Path

import casadi as ca

import pyfmi_models
from cosim.estimation.rowwise import Tape
from cosim.support.files import cache_home

Tapes = list[tuple[Tape, list[int]]]
"""Tapes, each with the numbers of what it is differentiated by, where that must be known."""
PHYSICS = ("*.py", "effects/*.py", "friction/*.py")
OURS = ("equations.py", "rowwise.py", "tonal_disturbance.py")
UNUSED_DAYS = 30
"""Tapes of other sources are removed once nobody has asked for them for so long."""


MOST = 50_000
"""Tapes of these sources that are kept, some 250 MB; with more of them the folder begins anew. A diagnosis has 300."""


def stored(structure: object, parts: Sequence[type], make: Callable[[], Tapes]) -> Tapes:
    """What `make` makes of a structure, whose repr tells it from all others; from the disk where it is there.

    Tapes of parts that are not this package's own are made each time: their equations may change at any moment.
    """
    if not all(part.__module__.startswith(pyfmi_models.__name__ + ".") for part in parts):
        return make()
    path = _folder() / f"{hashlib.blake2b(repr(structure).encode(), digest_size=16).hexdigest()}.tape"
    try:
        return [(Tape.loaded(tape), by) for tape, by in marshal.loads(path.read_bytes())]
    except (OSError, EOFError, ValueError, TypeError):
        found = make()
    partial = path.with_suffix(f".{os.getpid()}")
    try:
        partial.write_bytes(marshal.dumps([(tape.dumped(), by) for tape, by in found]))
        os.replace(partial, path)
    except OSError:
        pass  # a cache that cannot be written is none
    return found


@cache
def _folder() -> Path:
    """Folder of the tapes of these sources; it is made. Too many, and others not used for long, are removed."""
    physics, here = Path(pyfmi_models.__file__).parent, Path(__file__).parent
    digest = hashlib.blake2b(ca.CasadiMeta.version().encode(), digest_size=8)
    for path in chain(*(sorted(physics.glob(pattern)) for pattern in PHYSICS), (here / name for name in OURS)):
        digest.update(path.read_bytes())
    folder = cache_home() / "tapes" / digest.hexdigest()
    try:
        if folder.is_dir() and sum(1 for _ in os.scandir(folder)) > MOST:
            shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "used").touch()
        for other in folder.parent.iterdir():
            if time.time() - (other / "used").stat().st_mtime > UNUSED_DAYS * 86400:
                shutil.rmtree(other, ignore_errors=True)
    except OSError:
        pass
    return folder
