"""`cosim doctor`: what is installed, what works here, and what the caches hold."""

import platform
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from cosim.support.errors import CosimError
from cosim.support.extras import DISTRIBUTION, declared
from cosim.support.files import cache_home, in_bytes
from cosim.support.plain import JsonObject
from cosim.support.version import __version__

FOR_USERS = {
    "mdf": "MDF4 recordings",
    "hdf5": "HDF5 and MAT 7.3 recordings",
    "mcap": "MCAP recordings",
    "serve": "the local page, cosim serve",
    "cluster": "sweeps on a Dask cluster",
    "simulators": "reading the files that export writes for MuJoCo, URDF and USD",
    "ethercat": "drives on an EtherCAT bus",
    "alpaca": "ASCOM's own client, for tests",
    "proof": "baselines of cosim prove",
}
"""Extras and what they are for; those of developers are left out."""


@dataclass(frozen=True)
class Health:
    """What is here: versions, abilities, extras and caches."""

    versions: Mapping[str, str]
    works: Mapping[str, str]
    """What can be done, with "yes" or what it needs."""
    extras: Mapping[str, str]
    caches: Mapping[str, int]
    """Bytes by folder."""
    folder: Path

    def as_json(self) -> JsonObject:
        """Return everything as plain data."""
        tables = ("versions", "works", "extras", "caches")
        return {name: dict(getattr(self, name)) for name in tables} | {"cache_folder": str(self.folder)}

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        yield from _table("Versions", self.versions)
        yield from _table("Works here", self.works)
        yield from _table("Extras", self.extras)
        sizes = {name: in_bytes(size) for name, size in self.caches.items()} or {"empty": ""}
        yield from _table(f"Caches in {self.folder}; what is deleted there is made again when it is needed", sizes)


def doctor() -> Health:
    """Look at this installation; nothing is changed and nothing is run."""
    folder = cache_home()
    return Health(_versions(), _works(), _extras(), _caches(folder), folder)


def _table(title: str, rows: Mapping[str, str]) -> Iterator[str]:
    yield title
    width = max(map(len, rows))
    yield from (f"  {name:<{width}}  {value}".rstrip() for name, value in rows.items())


def _versions() -> dict[str, str]:
    own = {DISTRIBUTION: __version__, "Python": f"{platform.python_version()} ({sys.executable})"}
    own["computer"] = f"{platform.system()} {platform.release()}, {platform.machine()}"
    needed = sorted({name for name, _, extra in declared() if not extra})
    return own | {name: _version_of(name) or "missing: reinstall the package" for name in needed}


def _version_of(name: str) -> str:
    try:
        return version(name.partition("[")[0])
    except PackageNotFoundError:
        return ""


def _works() -> dict[str, str]:
    from cosim.estimation.kernels import library as kernels
    from cosim.master.loop import library as loop

    slow = "no library for this machine: reinstall the package to build it; until then {} in Python, slowly"
    zig = _version_of("ziglang")
    return {
        "run": "yes, compiled loop" if loop() else slow.format("the loop runs"),
        "diagnose": "yes, compiled kernels" if kernels() else slow.format("fits run"),
        "hardware": "yes" if _has_hardware() else "no library for this machine: reinstall the package",
        "export": f"yes, compiler of ziglang {zig}" if zig else "no compiler: pip install ziglang",
    }


def _has_hardware() -> bool:
    from cosim.hardware.library import library

    try:
        return library() is not None
    except (CosimError, OSError):
        return False


def _extras() -> dict[str, str]:
    wanted: dict[str, list[str]] = {}
    for name, _, extra in declared():
        wanted.setdefault(extra, []).append(name)
    found = {}
    for extra, words in FOR_USERS.items():
        missing = [name for name in wanted.get(extra, []) if not _version_of(name)]
        found[extra] = f"{words}: " + (f"not installed (pip install {' '.join(missing)})" if missing else "yes")
    return found


def _caches(folder: Path) -> dict[str, int]:
    if not folder.is_dir():
        return {}
    parts = sorted(one for one in folder.iterdir() if one.is_dir())
    return {part.name: sum(one.stat().st_size for one in part.rglob("*") if one.is_file()) for part in parts}
