"""Build the C libraries of the wheel with the compiler that pip brings (ziglang), so that no other is needed.

`python cosim/master/loop/build_hook.py` builds them in place for a work tree that is not installed.
"""

import os
import platform
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ModuleNotFoundError:  # a work tree builds in place without it
    BuildHookInterface = object  # type: ignore[assignment,misc]

ROOT = Path(__file__).resolve().parents[3]
_LOOP = ("loop", "part", "coupling", "exchange", "rodas4", "typed", "pool")
_DETMATH = tuple(f"pyfmi_models/export/c/{name}.c" for name in ("detmath", "detmath_trig"))
LIBRARIES = {
    "cosim/master/loop/_loop": (*(f"cosim/master/loop/{name}.c" for name in _LOOP), *_DETMATH),
    "cosim/estimation/kernels/_kernels": (
        *(f"cosim/estimation/kernels/{name}.c" for name in ("tape", "filter", "marginal", "play")),
        *_DETMATH,
    ),
    "cosim_studies/proof/_machine": ("cosim_studies/proof/truth.c",),
}
_HARDWARE = ("cia402", "checks", "heads", "axis", "drive", "mac", "udp", "virtual", "blackbox", "realtime", "process")
if sys.platform == "linux":  # absolute sleeps
    LIBRARIES["cosim/hardware/_hardware"] = (
        *(f"cosim/hardware/{name}.c" for name in _HARDWARE),
        *(f"cosim/master/loop/{name}.c" for name in ("loop", "part", "coupling")),
    )
FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-Wall", "-Wextra"]
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
GLIBC = "2.17"


class CustomBuildHook(BuildHookInterface):  # type: ignore[misc]
    """Compile the loop (and the concealed mount, where there is one) into the package; the wheel fits this platform."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build before the wheel is packed."""
        build_data["artifacts"] += [f"/{built}" for built in build(Path(self.root))]
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{tag()}"


def build(root: Path) -> list[str]:
    """Compile every library whose sources are there; returns their paths relative to `root`."""
    made = []
    for target, sources in LIBRARIES.items():
        if all((root / source).exists() for source in sources):
            compile_library([root / source for source in sources], root / (target + SUFFIX))
            made.append(target + SUFFIX)
    return made


def compile_library(sources: list[Path], target: Path) -> None:
    """Compile C files into one shared library, which appears complete or not at all."""
    with tempfile.TemporaryDirectory() as directory:
        local = Path(directory) / target.name
        command = [sys.executable, "-m", "ziglang", "cc", *FLAGS, *_target(), "-shared", "-o", str(local)]
        command += [*(f"-I{folder}" for folder in sorted({str(one.parent) for one in sources})), *map(str, sources)]
        if sys.platform != "win32":
            command += ["-fPIC", "-fvisibility=hidden", "-lm"]
        environment = os.environ | {"ZIG_LOCAL_CACHE_DIR": directory}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{target.name} does not compile:\n{done.stderr}")
        partial = target.with_suffix(f".{os.getpid()}.partial")
        partial.write_bytes(local.read_bytes())
        os.replace(partial, target)


def tag() -> str:
    """Return the platform tag of the wheel; on glibc that of the oldest one the libraries run on."""
    if _is_glibc():
        return f"manylinux_{GLIBC.replace('.', '_')}_{platform.machine()}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


def _target() -> list[str]:
    return ["-target", f"{platform.machine()}-linux-gnu.{GLIBC}"] if _is_glibc() else []


def _is_glibc() -> bool:
    machines = {"x86_64", "aarch64"}
    return sys.platform == "linux" and platform.libc_ver()[0] == "glibc" and platform.machine() in machines


if __name__ == "__main__":
    print("\n".join(build(ROOT)))
