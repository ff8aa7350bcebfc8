"""FMUs of the tests' own C: compiled once, whichever file of tests and whichever worker asks first."""

import zipfile
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3ScheduledExecution, FMU3Slave

from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.platforms import PLATFORMS, host

KINDS = (FMU2Model, FMU2Slave, FMU3Model, FMU3Slave, FMU3ScheduledExecution)
FUNCTIONS = sorted({name for kind in KINDS for name in dir(kind) if name.startswith(("fmi2", "fmi3"))})
"""What FMPy looks for when it loads a library."""


def compiled(name: str, source: str, *flags: str) -> Path:
    """The library `name` of one C file, from the cache in which exported models lie."""
    flags = ("-shared", "-fPIC", "-O1", "-w", *flags)
    library = name + fmpy.sharedLibraryExtension
    return compile_shared({f"{name}.c": source.encode()}, library, PLATFORMS[host()].target, flags)


def with_stubs(source: str, made: str = "") -> str:
    """C of an FMU, and the functions that it lacks and no test calls; `made` names those that its macros make."""
    known = source + made
    lacks = [name for name in FUNCTIONS if f"{name}(" not in known and f"({name})" not in known]
    return source + "".join(f"API int {name}(void) {{ return 3; }}\n" for name in lacks)


def packed(path: Path, version: int, description: str, library: Path) -> Path:
    """Write an FMU of a description and a library, which has the name that the description says."""
    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{platform}/{library.name}")
    return path
