"""C -> shared library by the compiler that pip installed, cached by content."""

import hashlib
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path

from platformdirs import user_cache_dir

from pyfmi_models.errors import ExportError
from pyfmi_models.export.codegen import SHIM, Generated, generate
from pyfmi_models.export.platforms import host, known
from pyfmi_models.model import Model

FLAGS = (
    "-std=c11",
    "-O2",
    "-g0",
    "-s",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fvisibility=hidden",
    "-shared",
    "-fPIC",
)
"""No contraction: one rounding an operation on every machine. Without errno sqrt is an instruction, no call of libm."""


def cache_directory() -> Path:
    """Where libraries and the compiler's own cache are kept: $MOUNT_COSIM_CACHE or the user's cache directory."""
    return Path(os.environ.get("MOUNT_COSIM_CACHE") or user_cache_dir("mount-cosim"))


def fmi_headers() -> dict[str, bytes]:
    """The FMI 2 and 3 headers (BSD-2-Clause, Modelica Association) of the installed FMPy: name -> text."""
    folder = files("fmpy") / "c-code"
    return {
        item.name: item.read_bytes()
        for item in sorted(folder.iterdir(), key=lambda item: item.name)
        if item.name.endswith(".h") and item.name.startswith(("fmi2", "fmi3"))
    }


def sources_of(generated: Generated) -> dict[str, bytes]:
    """Every file that the library is made of: the model's two, the shim, the FMI headers; name -> content."""
    shim = {path.name: path.read_bytes() for path in sorted(SHIM.iterdir()) if path.suffix in (".c", ".h")}
    model = {name: text.encode() for name, text in generated.files.items()}
    return dict(sorted({**shim, **fmi_headers(), **model}.items()))


def units_of(sources: dict[str, bytes]) -> list[str]:
    """The files that the compiler is given; equations.c is included by model.c, under the names of detmath."""
    return [name for name in sources if name.endswith(".c") and name != "equations.c"]


def build_library(model: Model, platform: str | None = None) -> Path:
    """Compile the model and return the path of the shared library, which exports FMI 2 and FMI 3.

    `platform` is a key of `PLATFORMS`, by default the host's. An unchanged model is only looked up. Several processes
    may build at once: each works in a folder of its own and renames the result into place.
    Raises ExportError if the platform is unknown or the compiler fails, with its message.
    """
    return library_of(generate(model), platform or host())


def library_of(generated: Generated, name: str) -> Path:
    """As `build_library` on the platform `name`, for code that is already generated."""
    platform = known(name)
    sources = sources_of(generated) | {path.name: path.read_bytes() for path in platform.extra}
    library = generated.layout.identifier + platform.suffix
    return compile_shared(sources, library, platform.target, (*FLAGS, *platform.flags))


def libraries_of(generated: Generated, names: tuple[str, ...]) -> dict[str, Path]:
    """The libraries for several platforms: the first one first, then the others side by side."""
    first, *others = names
    found = {first: library_of(generated, first)}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return found | dict(zip(others, pool.map(partial(library_of, generated), others), strict=True))


def compile_shared(sources: dict[str, bytes], name: str, target: str, flags: tuple[str, ...] = FLAGS) -> Path:
    """Compile the C files among the sources into the library `name`, or find it in the cache."""
    key = _key(sources, name, target, flags)
    library = cache_directory() / "libraries" / key / name
    if not library.exists():
        try:
            library.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=library.parent) as folder:  # it appears complete or not at all
                os.replace(_compile(sources, Path(folder), name, target, flags), library)
        except OSError as error:
            raise ExportError(
                f"cannot build in {library.parent}: {error}; set MOUNT_COSIM_CACHE to a folder"
            ) from error
    return library


def _key(sources: dict[str, bytes], name: str, target: str, flags: tuple[str, ...]) -> str:
    try:
        compiler = version("ziglang")
    except PackageNotFoundError as error:
        raise ExportError('there is no C compiler: install the Python package "ziglang"') from error
    digest = hashlib.sha256(repr((name, target, flags, compiler)).encode())
    for file, content in sorted(sources.items()):
        digest.update(f"{file} {len(content)}\n".encode() + content)
    return digest.hexdigest()[:32]


def _compile(sources: dict[str, bytes], folder: Path, name: str, target: str, flags: tuple[str, ...]) -> Path:
    for file, content in sources.items():
        (folder / file).write_bytes(content)
    here = [flag.format(zig=files("ziglang")) for flag in flags]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *here, *units_of(sources), "-o", name]
    zig = cache_directory() / "zig"
    environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": str(zig), "ZIG_LOCAL_CACHE_DIR": str(zig)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ExportError(f"the C compiler failed on {name} for {target}: {done.stderr.strip()[-2000:]}")
    return folder / name
