"""A sampled model -> a small C project for a processor without an operating system, or for this one.

The equations are those of the FMU, line by line, with the same deterministic maths; around them a loop of one function
and three functions of hardware to fill in. There is no heap; how much stack and memory the project takes is worked
out from the compiled code, before anything runs.
"""

from dataclasses import dataclass
from pathlib import Path

from pyfmi_models.errors import ExportError
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.codegen import SHIM, generate
from pyfmi_models.export.description import version_text
from pyfmi_models.export.objects import Footprint, footprint
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.export.templates import groups_of, rendered
from pyfmi_models.model import Model

FOLDER = SHIM / "firmware"
FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-ffunction-sections", "-fdata-sections")
"""One rounding an operation on every machine; what is not used does not get into the program."""
LINK = ("-Wl,--gc-sections",)
_MEASURE = ("-c", "-g0", "-fstack-size-section")


@dataclass(frozen=True)
class Target:
    """A processor: what the compiler calls it, flags of its own, flags of its linker, and a gcc for it."""

    name: str
    target: str
    flags: tuple[str, ...] = ()
    link: tuple[str, ...] = ()
    gcc: str = "gcc"

    def command(self, compiler: str) -> str:
        """Write the line that builds the project; `compiler` is zig or gcc."""
        zig = compiler == "zig"
        start = f"python -m ziglang cc -target {self.target}" if zig else self.gcc
        return " ".join((start, *(self.flags if zig else ()), *FLAGS, *LINK, *self.link, "*.c -o controller"))


_BOARDS = {
    "cortex-a9": Target(
        name="cortex-a9",
        target="arm-linux-musleabihf",
        flags=("-mcpu=cortex_a9",),
        link=("-static",),
        gcc="arm-linux-gnueabihf-gcc -mcpu=cortex-a9 -mfpu=vfpv3",
    ),
}
TARGETS = (*_BOARDS, "host")


def target_of(name: str) -> Target:
    """Return a target by name; raises ExportError that lists those there are."""
    if name in _BOARDS:
        return _BOARDS[name]
    if name != "host":
        raise ExportError(f'firmware target "{name}" is unknown; there are: {", ".join(TARGETS)}')
    if not host().endswith("-linux"):
        raise ExportError(f'firmware target "host" is for Linux and this is {host()}; there are: {", ".join(_BOARDS)}')
    # Below the stack pointer nothing is kept, so that the frames are all there is.
    return Target(name, PLATFORMS[host()].target, ("-mno-red-zone",) if host().startswith("x86_64") else ())


@dataclass(frozen=True)
class Project:
    """A C project: its files, name to content, and what the program made of them takes, without its HAL."""

    files: dict[str, bytes]
    size: Footprint

    def write(self, out: Path) -> None:
        """Write the files into a directory; those of the same names are replaced."""
        out.mkdir(parents=True, exist_ok=True)
        for name, content in self.files.items():
            (out / name).write_bytes(content)


def firmware(model: Model, target: Target, *, encoder: str, quantum: float, command: str, origin: str) -> Project:
    """Turn a sampled model into a project for a target.

    `encoder` is the input that comes from encoder counts, `quantum` of its unit each; `command` is the output that is
    the torque. `origin` is the command that the README names.
    Raises ExportError if the model is not sampled, lacks one of the two, or the compiler fails.
    """
    names = _names(model, encoder, quantum, command)
    files = sources(model, names)
    size = measure(files, target)
    calls = [name for name in size.outside if not name.startswith("hal_")]
    page = {"target": target, "size": size, "calls": calls, "origin": origin, "version": version_text()}
    return Project(files | {"README.md": _render("README.md.j2", names | page)}, size)


def sources(model: Model, names: dict[str, object]) -> dict[str, bytes]:
    """Return every C file of the project, name to content; `names` are what the templates name."""
    fixed = {path.name: path.read_bytes() for path in (*FOLDER.glob("*.[ch]"), *SHIM.glob("detmath*"))}
    written = {name: _render(f"{name}.j2", names) for name in ("controller.h", "controller.c")}
    return dict(sorted((fixed | written | {"equations.h": generate(model).files["equations.c"].encode()}).items()))


def measure(files: dict[str, bytes], target: Target) -> Footprint:
    """Compile all but the HAL and work out what the program takes, from `main` on."""
    headers = {name: text for name, text in files.items() if name.endswith(".h")}
    units = [name for name in files if name.endswith(".c") and not name.startswith("hal_")]
    flags = (*FLAGS, *target.flags, *_MEASURE)
    objects = [compile_shared(headers | {one: files[one]}, f"{one[:-2]}.o", target.target, flags) for one in units]
    return footprint(objects, "main")


def _names(model: Model, encoder: str, quantum: float, command: str) -> dict[str, object]:
    if not model.period:
        raise ExportError(f'model "{model.name}" is not sampled, so there is no step for a firmware to take')
    inputs, outputs = ({one.name: one for one in group} for group in (model.inputs, model.outputs))
    for name, group, kind in ((encoder, inputs, "input"), (command, outputs, "output")):
        if name not in group:
            raise ExportError(f'model "{model.name}" has no {kind} "{name}"; there are: {", ".join(group)}')
    return {
        "model": model,
        "encoder": inputs[encoder],
        "quantum": quantum,
        "command": command,
        "groups": groups_of(model),
    }


def _render(name: str, values: dict[str, object]) -> bytes:
    return rendered(FOLDER / name, values).encode()
