"""A system to one FMU: components, plan and signals go in, a binary with the loop of `cosim run` steps them."""

import hashlib
import re
import zipfile
from collections.abc import Sequence
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from typing import Literal

from cosim.support.errors import WiringError
from cosim.system.system import System
from cosim_nesting.description import description
from cosim_nesting.prepared import Prepared, prepare
from cosim_nesting.source import C_FILES, folder_of, model_c, signal_bytes, signal_columns, system_c
from cosim_nesting.variables import Shown, shown_of
from pyfmi_models.export.archive import write_zip
from pyfmi_models.export.build import compile_shared, fmi_headers
from pyfmi_models.export.codegen import SHIM
from pyfmi_models.export.platforms import PLATFORMS, host

LOOP = Path(str(files("cosim"))) / "master" / "loop"
_INCLUDED = {"loop.inc": LOOP / "loop.c", "part.inc": LOOP / "part.c", "coupling.inc": LOOP / "coupling.c"}
_INCLUDED |= {"instance.inc": SHIM / "instance.c"}
_AS_THEY_ARE = [LOOP / name for name in ("loop.h", "part.h", "foreign.h")]
_AS_THEY_ARE += [SHIM / name for name in ("core.h", "model.h", "fmi2.c", "fmi3.c", "fmi3_unused.c")]
FLAGS = ("-std=c11", "-O2", "-g0", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC")
"""As of the loop of a run (build_hook.py): one rounding an operation."""
LIBRARIES = ("-ldl", "-lm")


def nest(system: System, paths: dict[Literal[2, 3], Path]) -> tuple[Path, ...]:
    """Write a system as an FMU for co-simulation of each FMI version that has a path; returns the paths.

    Raises:
        WiringError: it has what cannot be nested, or this is no Linux.
        FmuError, SignalError: as a run.
    """
    if not host().endswith("-linux"):
        raise WiringError(f"A system becomes an FMU on Linux only, and this is {host()}.")
    with ExitStack() as stack:
        prepared = prepare(stack, system)
        shown = shown_of(prepared)
        if not shown:
            raise WiringError(
                f'"{system.name}" cannot become one FMU: it would show doubles only, and has none to show.'
            )
        for version, path in paths.items():
            write_zip(path, _files(prepared, shown, version, path.stem))
    return tuple(paths.values())


def _files(prepared: Prepared, shown: Sequence[Shown], version: Literal[2, 3], stem: str) -> dict[str, bytes]:
    columns = signal_columns(prepared.signals)
    plan, content = system_c(prepared, shown, columns), signal_bytes(prepared.signals, columns)
    parts = {f"resources/parts/{name}": data for name, data in _parts(prepared).items()}
    token = _token(plan, content, parts, shown)
    identifier = re.sub(r"\W", "_", stem, flags=re.ASCII)
    identifier = identifier if identifier[:1].isalpha() else f"system_{identifier}"
    sources = _sources() | {"system.c": plan.encode(), "model.c": model_c(prepared, shown, token).encode()}
    platform = PLATFORMS[host()]
    library = _built(sources, f"{identifier}.so", platform.target).read_bytes()
    folder = platform.fmi2 if version == 2 else platform.name
    files = {f"binaries/{folder}/{identifier}.so": library} | parts
    files |= {"resources/signals.bin": content} if content else {}
    files |= {f"sources/{name}": text for name, text in sources.items()}
    return files | {"modelDescription.xml": description(prepared, shown, token, identifier, version)}


def _built(sources: dict[str, bytes], name: str, target: str) -> Path:
    """Compile and link; what is the same in every system is kept as objects, which takes most of the time."""
    own = ("system.c", "model.c")
    others = {file: text for file, text in sources.items() if not file.endswith(".c")}
    units = [file for file in sources if file.endswith(".c") and file not in own]
    flags = (*FLAGS, "-c")
    objects = [compile_shared(others | {unit: sources[unit]}, f"{unit[:-2]}.o", target, flags) for unit in units]
    written = others | {unit: sources[unit] for unit in own}
    return compile_shared(written, name, target, (*FLAGS, "-s", "-shared", *map(str, objects), *LIBRARIES))


def _sources() -> dict[str, bytes]:
    own = {path.name: path.read_bytes() for path in sorted(C_FILES.iterdir())}
    shim = {path.name: path.read_bytes() for path in _AS_THEY_ARE}
    return own | shim | {name: path.read_bytes() for name, path in _INCLUDED.items()} | fmi_headers()


def _parts(prepared: Prepared) -> dict[str, bytes]:
    """Each component unpacked in a folder of its own, without the binaries of other platforms and its sources."""
    found: dict[str, bytes] = {}
    for index, (fmu, binary) in enumerate(zip(prepared.components, prepared.binaries, strict=True)):
        kept = (binary.folder, "resources/", "modelDescription.xml", "extra/")
        with zipfile.ZipFile(fmu.path) as archive:
            names = [name for name in archive.namelist() if name.startswith(kept) and not name.endswith("/")]
            found |= {f"{folder_of(index)}/{name}": archive.read(name) for name in names}
    return found


def _token(plan: str, content: bytes, parts: dict[str, bytes], shown: Sequence[Shown]) -> str:
    digest = hashlib.sha256(plan.encode() + content + repr(shown).encode())
    for name, data in sorted(parts.items()):
        digest.update(name.encode() + data)
    found = digest.hexdigest()
    return "{" + "-".join((found[:8], found[8:12], found[12:16], found[16:20], found[20:32])) + "}"
