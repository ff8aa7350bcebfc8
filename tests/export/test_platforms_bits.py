"""The same bits on every processor and from another compiler; the libraries of other machines load there."""

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import export_models as models
import pytest
from effect_examples import EXAMPLES, mount

from pyfmi_models.card import read_card
from pyfmi_models.export import build_library
from pyfmi_models.export.build import FLAGS, compile_shared, sources_of
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Pair

# The same bits everywhere.

LAW = LuGre(sigma0=Pair(2e4, 3e4), sigma1=200.0, sigma2=3.0, Fc=Pair(1.0, 1.2), Fs=1.5, Vs=0.05, delta=1.9)


def plant():
    """An effect of every kind but presliding, which would replace the bristles of the law."""
    kinds = {one.id: one for one in EXAMPLES if one.id != "presliding"}
    return mount(*kinds.values(), friction=LAW).model()


def controller():
    return read_card("paper_mount").controller_model()


@dataclass(frozen=True)
class Machine:
    target: str
    flags: tuple[str, ...] = ("-static",)
    runner: str = ""
    options: tuple[str, ...] = ()
    package: str = "qemu-user"


HOST = Machine(PLATFORMS[host()].target, ())
CONSOLE = ("-lkernel32", "-mconsole", "-Wl,-e,mainCRTStartup")
MACHINES = {
    "Cortex-A9": Machine("arm-linux-musleabihf", ("-static", "-mcpu=cortex_a9"), "qemu-arm", ("-cpu", "cortex-a9")),
    "aarch64": Machine("aarch64-linux-musl", runner="qemu-aarch64"),
    "Windows": Machine(
        PLATFORMS["x86_64-windows"].target, (*PLATFORMS["x86_64-windows"].flags, *CONSOLE), "wine64", package="wine64"
    ),
}
STEPS = {plant: 2_400, controller: 25_000}
AMPLITUDES = {"tau": 9.0, "disturbance": 1.0, "temperature": 20.0, "q": 0.01, "q_d": 0.01, "v_d": 0.05, "a_d": 0.1}


def amplitude(variable):
    """How far an input swings: as above, others by their nominal value."""
    return AMPLITUDES.get(variable.name, variable.nominal)


@cache
def sources(make):
    """The sources of an FMU and of the driver that hashes at least 100 000 states, rates and outputs of it."""
    generated, steps = generate(make()), STEPS[make]
    assert steps * len(generated.layout.of("state", "rate", "output")) >= 100_000
    values = {
        "SIZE": len(generated.layout.rows),
        "COUNT": steps,
        "LENGTH": 1e-4,
        "AMPLITUDES": ", ".join(str(amplitude(row.variable)) for row in generated.layout.of("input")),
    }
    scenario = "".join(f"#define {name} {value}\n" for name, value in values.items())
    driver = (Path(__file__).parent / "exact_driver.c").read_bytes()
    return sources_of(generated) | {"scenario.h": scenario.encode(), "driver.c": driver}


def runner_of(machine):
    """The program that runs the machine's code here, as the start of a command."""
    if not machine.runner:
        return []
    found = shutil.which(machine.runner) or shutil.which(machine.runner, path="/usr/lib/wine")
    if not found:
        pytest.skip(f"{machine.runner} is not installed (apt-get install {machine.package})")
    return [found, *machine.options]


@pytest.fixture(scope="module")
def wine(tmp_path_factory):
    """Environment with a home of its own for Wine, which fills it with 700 MB."""
    folder = tmp_path_factory.mktemp("wine")
    environment = os.environ | {"WINEPREFIX": str(folder), "WINEDEBUG": "-all"}
    yield environment
    if (folder / "system.reg").exists():
        server = shutil.which("wineserver", path=f"/usr/lib/wine:{os.defpath}")
        subprocess.run([str(server), "-k"], env=environment, check=False)
        subprocess.run([str(server), "-w"], env=environment, check=False)
    shutil.rmtree(folder, ignore_errors=True)


def bits(make, machine, environment=None):
    """Hash of the bits that the FMU answers in the scenario, run as the machine would run it."""
    runner = runner_of(machine)
    flags = tuple(flag for flag in FLAGS if flag not in ("-shared", "-fPIC"))
    extra = {path.name: path.read_bytes() for path in PLATFORMS["x86_64-windows"].extra if machine.runner == "wine64"}
    program = compile_shared(sources(make) | extra, "driver.exe", machine.target, (*flags, *machine.flags))
    command = [*runner, str(program)]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout.strip()


native = cache(lambda make: bits(make, HOST))


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("make", STEPS)
def test_every_machine_computes_the_same_bits(make, machine, wine):
    assert re.fullmatch(r"[0-9a-f]{16}", native(make))
    assert bits(make, MACHINES[machine], wine) == native(make)


def gcc_bits(make, folder, *flags):
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("gcc is not installed")
    files = sources(make)
    for name, text in files.items():
        (folder / name).write_bytes(text)
    units = [name for name in files if name.endswith(".c") and name != "equations.c"]
    subprocess.run([compiler, "-std=c11", *flags, *units, "-o", "driver", "-lm"], cwd=folder, check=True)
    return subprocess.run([folder / "driver"], capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.parametrize("make", STEPS)
def test_another_compiler_computes_the_same_bits(make, tmp_path):
    assert gcc_bits(make, tmp_path, "-O3", "-ffp-contract=off") == native(make)


LOADERS = {
    "x86_64-windows": b"""
__declspec(dllimport) void *LoadLibraryA(const char *name);
__declspec(dllimport) void *GetProcAddress(void *library, const char *name);
__declspec(dllimport) void ExitProcess(unsigned code);
void mainCRTStartup(void) {
    void *library = LoadLibraryA("lugre.dll");
    const char *(*version)(void) = library ? (const char *(*)(void))GetProcAddress(library, "fmi3GetVersion") : 0;
    ExitProcess(version ? (unsigned)(version()[0] - '0') : 99);
}
""",
    "aarch64-linux": b"""
#include <dlfcn.h>
int main(void) {
    void *library = dlopen("./lugre.so", RTLD_NOW);
    const char *(*version)(void) = library ? (const char *(*)(void))dlsym(library, "fmi3GetVersion") : 0;
    return version ? version()[0] - '0' : 99;
}
""",
}
ARM_LIBC = Path("/usr/aarch64-linux-gnu")
LOADING = {
    "x86_64-windows": Machine("", ("-O2", "-nostdlib", *CONSOLE), "wine64", package="wine64"),
    "aarch64-linux": Machine("", ("-O2", "-ldl"), "qemu-aarch64", ("-L", str(ARM_LIBC))),
}


@pytest.mark.parametrize("platform", LOADERS)
def test_the_library_for_another_machine_loads_there(platform, wine):
    machine, library = LOADING[platform], build_library(models.lugre(), platform)
    runner = runner_of(machine)
    if "-L" in runner and not ARM_LIBC.exists():
        pytest.skip("there is no glibc for aarch64 (apt-get install libc6-arm64-cross)")
    program = compile_shared({"l.c": LOADERS[platform]}, "l.exe", PLATFORMS[platform].target, machine.flags)
    command = [*runner, str(program)]
    assert subprocess.run(command, cwd=library.parent, env=wine, check=False).returncode == 3
