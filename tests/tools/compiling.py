"""Shared libraries of the tests' own C: compiled once, whichever file of tests and whichever worker asks first."""

from pathlib import Path

import fmpy

from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.platforms import PLATFORMS, host


def compiled(name: str, source: str, *flags: str) -> Path:
    """The library `name` of one C file, from the cache in which exported models lie."""
    flags = ("-shared", "-fPIC", "-O1", "-w", *flags)
    library = name + fmpy.sharedLibraryExtension
    return compile_shared({f"{name}.c": source.encode()}, library, PLATFORMS[host()].target, flags)
