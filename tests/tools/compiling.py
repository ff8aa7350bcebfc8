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


HEAD = (
    "#define _GNU_SOURCE\n"
    + "".join(f"#include <{one}.h>\n" for one in ("math", "signal", "stdbool", "stddef", "stdint", "stdio", "stdlib"))
    + "#include <string.h>\n#include <unistd.h>\n"
    + '#define API __attribute__((visibility("default")))\n'
)
GIVEN = {"fmi2GetVersion": "2.0", "fmi2GetTypesPlatform": "default", "fmi3GetVersion": "3.0"}
QUIET = ("SetupExperiment", "InitializationMode", "Terminate", "EnterEventMode", "EnterContinuousTimeMode", "SetTime")
"""What succeeds and does nothing where an FMU has no function of its own for it, by the ends of names."""


def compiled(name: str, source: str, *flags: str) -> Path:
    """The library `name` of one C file, from the cache in which exported models lie."""
    flags = ("-shared", "-fPIC", "-O1", "-w", *flags)
    library = name + fmpy.sharedLibraryExtension
    return compile_shared({f"{name}.c": source.encode()}, library, PLATFORMS[host()].target, flags)


def with_stubs(source: str, made: str = "") -> str:
    """C of an FMU with what each needs, and the functions that it lacks; `made` names those that its macros make.

    Of what it lacks, changes of mode succeed and its memory is freed; all else fails, for no test calls it.
    """
    known = source + made
    lacks = [name for name in FUNCTIONS if f"{name}(" not in known and f"({name})" not in known]
    return HEAD + source + "".join(_stub(name) for name in lacks)


def _stub(name: str) -> str:
    if name in GIVEN:
        return f'API const char *{name}(void) {{ return "{GIVEN[name]}"; }}\n'
    if name.endswith("FreeInstance"):
        return f"API void {name}(void *m) {{ free(m); }}\n"
    return f"API int {name}(void) {{ return {0 if name.endswith(QUIET) else 3}; }}\n"


def packed(path: Path, version: int, description: str, library: Path) -> Path:
    """Write an FMU of a description and a library, which has the name that the description says."""
    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{platform}/{library.name}")
    return path
