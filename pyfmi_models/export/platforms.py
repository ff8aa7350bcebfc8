"""The machines that FMUs are built for."""

import platform as this_machine
from dataclasses import dataclass
from pathlib import Path

from pyfmi_models.errors import ExportError

_UCRT = tuple(f"-lapi-ms-win-crt-{part}-l1-1-0" for part in ("heap", "stdio", "string", "private"))
WINDOWS = Path(__file__).parent / "c" / "windows"


@dataclass(frozen=True)
class Platform:
    """A machine that FMUs are built for.

    `name` is FMI 3's platform tuple and `fmi2` the folder that FMI 2 gives it; `target` is what the compiler calls it.
    `{zig}` in a flag is the compiler's folder. `extra` are files compiled into the library that no archive shows.
    """

    name: str
    target: str
    fmi2: str
    suffix: str
    flags: tuple[str, ...] = ()
    extra: tuple[Path, ...] = ()


PLATFORMS = {
    platform.name: platform
    for platform in (
        # A step takes 5 % less time when compiler and linker see all of it; for macOS zig cannot.
        Platform("x86_64-linux", "x86_64-linux-gnu.2.17", "linux64", ".so", ("-flto",)),
        Platform("aarch64-linux", "aarch64-linux-gnu.2.17", "linux64", ".so", ("-flto",)),
        Platform(
            "x86_64-windows",
            "x86_64-windows-gnu",
            "win64",
            ".dll",
            ("-nostdlib", "-isystem", "{zig}/lib/libc/include/any-windows-any", *_UCRT, "-lcompiler_rt"),
            (WINDOWS / "without_crt.c",),
        ),
        Platform("x86_64-darwin", "x86_64-macos.11.0", "darwin64", ".dylib"),
        Platform("aarch64-darwin", "aarch64-macos.11.0", "darwin64", ".dylib"),
    )
}


def host() -> str:
    """Name of the platform that this process runs on, as FMI 3 spells it."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(this_machine.machine().lower(), this_machine.machine())
    return f"{machine}-{this_machine.system().lower()}"


def platforms_of(words: str) -> tuple[str, ...]:
    """Read `host`, `all` or names with commas between them; the host comes first, the others in the order of PLATFORMS.

    Raises ExportError naming the platform that is unknown and those that there are.
    """
    wanted = set(words.split(",")) - {"all", "host"}
    wanted |= {host()} if "host" in words.split(",") else set()
    wanted |= set(PLATFORMS) if "all" in words.split(",") else set()
    for name in sorted(wanted):
        known(name)
    return tuple(sorted(wanted, key=lambda name: (name != host(), list(PLATFORMS).index(name))))


def known(name: str) -> Platform:
    """The platform of this name; raises ExportError that lists the names there are."""
    if name not in PLATFORMS:
        raise ExportError(f'platform "{name}" is unknown; there are: {", ".join(PLATFORMS)}')
    return PLATFORMS[name]
