"""Five platforms from one machine: right formats, old enough systems, found by importers, the same bits on each."""

import hashlib
import json
import os
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import export_models as models
import numpy as np
import pytest
from commands import call
from effect_examples import EXAMPLES, mount

import cosim
from cosim.system.scenario import read_scenario
from pyfmi_models.card import read_card
from pyfmi_models.errors import ExportError
from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.export.build import FLAGS, compile_shared, sources_of
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.platforms import PLATFORMS, host, platforms_of
from pyfmi_models.export.universal import universal_binary
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Pair

content = cache(lambda platform: build_library(models.lugre(), platform).read_bytes())


def machine_of(file):
    """Kind of a library, and the number of the machine that it is for."""
    if file[:5] == b"\x7fELF\x02":
        return "ELF", struct.unpack_from("<H", file, 18)[0]
    magic, number = struct.unpack_from("<2I", file)
    if magic == 0xFEEDFACF:
        return "Mach-O", number
    header = struct.unpack_from("<I", file, 60)[0]
    assert file[header : header + 4] == b"PE\0\0"
    return "PE", struct.unpack_from("<H", file, header + 4)[0]


KIND = {
    "x86_64-linux": ("ELF", 62),
    "aarch64-linux": ("ELF", 183),
    "x86_64-windows": ("PE", 0x8664),
    "x86_64-darwin": ("Mach-O", 0x01000007),
    "aarch64-darwin": ("Mach-O", 0x0100000C),
}


@pytest.mark.parametrize("platform", PLATFORMS)
def test_each_platform_gets_a_library_of_its_own_kind(platform):
    assert machine_of(content(platform)) == KIND[platform]
    assert all(name in content(platform) for name in (b"fmi2DoStep", b"fmi3DoStep"))


@pytest.mark.parametrize("platform", ["x86_64-linux", "aarch64-linux"])
def test_linux_libraries_run_with_glibc_2_17(platform):
    versions = {tuple(map(int, found)) for found in re.findall(rb"GLIBC_(\d+)\.(\d+)", content(platform))}
    assert versions
    assert max(versions) <= (2, 17)


def test_windows_libraries_need_nothing_but_windows():
    wanted = {name.decode() for name in re.findall(rb"[\w-]+\.dll", content("x86_64-windows"))}
    assert wanted - {"lugre.dll"}
    assert all(name.startswith("api-ms-win-crt-") for name in wanted - {"lugre.dll"})


def commands_of(file):
    """Load commands of a 64-bit Mach-O file: kind -> the bytes after kind and size."""
    found, offset = {}, 32
    for _ in range(struct.unpack_from("<I", file, 16)[0]):
        kind, size = struct.unpack_from("<2I", file, offset)
        found[kind] = file[offset + 8 : offset + size]
        offset += size
    return found


@pytest.mark.parametrize("platform", ["x86_64-darwin", "aarch64-darwin"])
def test_macos_libraries_run_from_macos_11_on_and_carry_the_signature_that_arm_wants(platform):
    commands = commands_of(content(platform))
    build_version, code_signature = commands[0x32], commands.get(0x1D)
    assert struct.unpack_from("<2I", build_version) == (1, 11 << 16)
    assert code_signature or platform == "x86_64-darwin"


def slices_of(file):
    magic, count = struct.unpack_from(">2I", file)
    assert magic == 0xCAFEBABE
    rows = [struct.unpack_from(">5I", file, 8 + 20 * i) for i in range(count)]
    assert all(offset % 2**alignment == 0 for _, _, offset, _, alignment in rows)
    return {processor: file[offset : offset + size] for processor, _, offset, size, _ in rows}


def test_a_universal_file_holds_both_processors_untouched():
    thin = [content("x86_64-darwin"), content("aarch64-darwin")]
    assert slices_of(universal_binary(thin)) == {0x01000007: thin[0], 0x0100000C: thin[1]}
    with pytest.raises(ValueError, match="no 64-bit Mach-O file: it starts with 7f454c46"):
        universal_binary([content("x86_64-linux")])


@pytest.mark.parametrize(
    ("fmi", "platforms", "folders"),
    [
        (3, tuple(PLATFORMS), {name: name for name in PLATFORMS}),
        (2, tuple(PLATFORMS), {"linux64": "x86_64-linux", "aarch64-linux": "aarch64-linux", "win64": "x86_64-windows"}),
        (2, ("aarch64-linux",), {"linux64": "aarch64-linux", "aarch64-linux": "aarch64-linux"}),
    ],
    ids=["a folder each", "linux64 is x86, one folder for macOS", "where importers of an ARM look"],
)
def test_binaries_lie_where_importers_look(fmi, platforms, folders, tmp_path):
    path = export_fmu(models.lugre(), tmp_path / "a.fmu", fmi=fmi, platforms=platforms)
    with zipfile.ZipFile(path) as archive:
        found = {name: archive.read(name) for name in archive.namelist() if name.startswith("binaries/")}
    if fmi == 2 and len(platforms) > 1:
        thin = slices_of(found.pop("binaries/darwin64/lugre.dylib"))
        assert set(thin.values()) == {content("x86_64-darwin"), content("aarch64-darwin")}
    expected = {f"{folder}/lugre{PLATFORMS[name].suffix}": content(name) for folder, name in folders.items()}
    assert found == {f"binaries/{name}": library for name, library in expected.items()}


def test_the_command_gives_aarch64_linux_an_fmi_2_archive_of_its_own(tmp_path):
    assert call("export", "emps", "--fmi", "2", "--platform", "x86_64-linux,aarch64-linux", "--out", tmp_path) == 0
    plants = [tmp_path / "emps_plant_fmi2.fmu", tmp_path / "aarch64-linux" / "emps_plant_fmi2.fmu"]
    for path, machine in zip(plants, (62, 183), strict=True):
        with zipfile.ZipFile(path) as archive:
            assert machine_of(archive.read("binaries/linux64/emps_plant.so")) == ("ELF", machine)


def test_platforms_are_named_in_words_and_the_host_comes_first():
    assert platforms_of("host") == (host(),)
    assert set(platforms_of("all")) == set(PLATFORMS)
    assert platforms_of("all")[0] == host()
    assert platforms_of("x86_64-windows,aarch64-linux") == ("aarch64-linux", "x86_64-windows")
    with pytest.raises(ExportError, match='platform "vax" is unknown; there are: x86_64-linux, aarch64-linux'):
        platforms_of("host,vax")


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
"""How far an input swings; others by their nominal value."""


@cache
def sources(make):
    """The sources of an FMU and of the driver that hashes at least 100 000 states, rates and outputs of it."""
    generated, steps = generate(make()), STEPS[make]
    assert steps * len(generated.layout.of("state", "rate", "output")) >= 100_000
    inputs = [row.variable for row in generated.layout.of("input")]
    swings = ", ".join(str(AMPLITUDES.get(one.name, one.nominal)) for one in inputs)
    values = {"SIZE": len(generated.layout.rows), "COUNT": steps, "LENGTH": 1e-4, "AMPLITUDES": swings}
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


@pytest.mark.parametrize("make", STEPS)
def test_another_compiler_computes_the_same_bits(make, tmp_path):
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("gcc is not installed")
    for name, text in sources(make).items():
        (tmp_path / name).write_bytes(text)
    units = [name for name in sources(make) if name.endswith(".c") and name != "equations.c"]
    flags = ("-std=c11", "-O3", "-ffp-contract=off")
    subprocess.run([compiler, *flags, *units, "-o", "driver", "-lm"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "driver"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == native(make)


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


# A change of the house changes no number: what a shipped scenario records and a shipped card exports, held by hash.
# Where physics, generated C or a default changes on purpose, the hash here changes with it, and CHANGELOG says so.

TICKS = 5_000
RECORDED = {
    "sidereal": "eba360c55796575d3f971b0f8328220e92319051a34e6d1657d14c2fda7ce3e5",
    "two_axis": "32ff574022b6bd4ecd2e0361bd703410749b359db76ce8fddd5715107d679124",
}
"""SHA-256 of the columns t, and all others in their order, float64, over the first 5,000 ticks, a row a tick."""
EXPORTED = {
    "plant": "4f309d35c64e779c520e217352c07ac1ce730e3a3b8993f6e16123598c32a568",
    "controller": "ce7cdd736efde0c8f4260a796ea7144fed9c07197365a6e91383a0f1e0205635",
}
"""SHA-256 of the C and the description in the FMI 3.0 archive of `paper_mount`; the version and date are left out."""
SET_POINTS = [
    {"kind": "sine", "frequency": 0.7, "amplitude": 0.3, "phase": 0.4, "smooth_start": 0.8},
    {"kind": "multisine", "frequencies": [0.3, 1.1, 2.9], "amplitudes": 1.0, "seed": 4},
    {"kind": "chirp", "start": 0.1, "stop": 3.0, "duration": 4.0, "amplitude": 0.2},
    {"kind": "star", "latitude_deg": 49.0, "declination_deg": 45.0, "hour_angle_h": -0.01},
    {"kind": "ramp", "velocity": 0.4, "smooth_start": 0.5},
]
STREAMED = """
import hashlib, json, sys
import numpy as np
from pydantic import TypeAdapter
from cosim.data.signals import Generator
signals = map(TypeAdapter(Generator).validate_python, json.loads(sys.argv[1]))
print(*(hashlib.sha256(one.stream(1e-3)(np.arange(30_000)).tobytes()).hexdigest() for one in signals))
"""
PASSING = rb'generationTool="[^"]*"|generationDateAndTime="[^"]*"|version="[^"]*"'


def digest(parts: list[bytes]) -> str:
    return hashlib.sha256(b"\n".join(parts)).hexdigest()


@pytest.mark.parametrize("name", RECORDED)
def test_a_shipped_scenario_records_the_same_bits(name: str) -> None:
    recording = cosim.run(replace(read_scenario(name), ticks=TICKS, decimation=1)).recording
    assert digest([f"{key}".encode() + recording[key].tobytes() for key in recording]) == RECORDED[name]


def streamed(**environment: str) -> list[str]:
    command = [sys.executable, "-c", STREAMED, json.dumps(SET_POINTS)]
    done = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_a_processor_without_the_newest_instructions_gives_the_same_set_points() -> None:
    """What numpy and glibc take for a sine depends on the processor; here they are told that it can do little."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    poor = {
        "NPY_DISABLE_CPU_FEATURES": " ".join(found),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable",
    }
    assert streamed(**poor) == streamed()


@pytest.mark.parametrize("part", EXPORTED)
def test_a_shipped_card_exports_the_same_model(part: str, tmp_path: Path) -> None:
    card = read_card("paper_mount")
    model = card.plant().model() if part == "plant" else card.controller_model()
    with zipfile.ZipFile(export_fmu(model, tmp_path / "one.fmu", fmi=3)) as archive:
        kept = re.compile(r"sources/.*\.[ch]|modelDescription.xml")
        names = [name for name in sorted(archive.namelist()) if kept.fullmatch(name)]
        texts = [re.sub(PASSING, b"", archive.read(name)) for name in names]
    assert len(texts) > 2
    assert digest([name.encode() + text for name, text in zip(names, texts, strict=True)]) == EXPORTED[part]
