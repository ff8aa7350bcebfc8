"""Five platforms from one machine: right formats, old enough systems, and folders where importers look."""

import re
import struct
import zipfile
from functools import cache

import export_models as models
import pytest
from commands import call

from pyfmi_models.errors import ExportError
from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.export.platforms import PLATFORMS, host, platforms_of
from pyfmi_models.export.universal import universal_binary

content = cache(lambda platform: build_library(models.lugre(), platform).read_bytes())


def elf_machine(file):
    assert file[:5] == b"\x7fELF\x02"
    return struct.unpack_from("<H", file, 18)[0]


def pe_machine(file):
    header = struct.unpack_from("<I", file, 60)[0]
    assert file[header : header + 4] == b"PE\0\0"
    return struct.unpack_from("<H", file, header + 4)[0]


def mach_machine(file):
    magic, machine = struct.unpack_from("<2I", file)
    assert magic == 0xFEEDFACF
    return machine


KIND = {
    "x86_64-linux": (elf_machine, 62),
    "aarch64-linux": (elf_machine, 183),
    "x86_64-windows": (pe_machine, 0x8664),
    "x86_64-darwin": (mach_machine, 0x01000007),
    "aarch64-darwin": (mach_machine, 0x0100000C),
}


@pytest.mark.parametrize("platform", PLATFORMS)
def test_each_platform_gets_a_library_of_its_own_kind(platform):
    machine, expected = KIND[platform]
    assert machine(content(platform)) == expected
    for name in (b"fmi2DoStep", b"fmi3DoStep"):
        assert name in content(platform)


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


@pytest.fixture(scope="module")
def everywhere(tmp_path_factory):
    """Binaries in the archives for all platforms: version -> name -> content."""
    found = {}
    for fmi in (2, 3):
        path = export_fmu(models.lugre(), tmp_path_factory.mktemp("all") / "a.fmu", fmi=fmi, platforms=tuple(PLATFORMS))
        with zipfile.ZipFile(path) as archive:
            names = [name for name in archive.namelist() if name.startswith("binaries/")]
            found[fmi] = {name.removeprefix("binaries/"): archive.read(name) for name in names}
    return found


def test_fmi_3_has_a_folder_for_each_platform(everywhere):
    assert everywhere[3] == {f"{name}/lugre{p.suffix}": content(name) for name, p in PLATFORMS.items()}


def test_fmi_2_has_one_universal_folder_for_macos_and_keeps_linux64_for_x86(everywhere):
    binaries = everywhere[2]
    assert {name.split("/")[0] for name in binaries} == {"linux64", "aarch64-linux", "win64", "darwin64"}
    assert binaries["linux64/lugre.so"] == content("x86_64-linux")
    assert binaries["aarch64-linux/lugre.so"] == content("aarch64-linux")
    assert binaries["win64/lugre.dll"] == content("x86_64-windows")
    assert set(slices_of(binaries["darwin64/lugre.dylib"]).values()) == {
        content("x86_64-darwin"),
        content("aarch64-darwin"),
    }


def test_fmi_2_for_aarch64_linux_alone_lies_where_importers_there_look(tmp_path):
    path = export_fmu(models.lugre(), tmp_path / "a.fmu", fmi=2, platforms=("aarch64-linux",))
    with zipfile.ZipFile(path) as archive:
        for folder in ("linux64", "aarch64-linux"):
            assert archive.read(f"binaries/{folder}/lugre.so") == content("aarch64-linux")


def test_the_command_gives_aarch64_linux_an_fmi_2_archive_of_its_own(tmp_path):
    assert call("export", "emps", "--fmi", "2", "--platform", "x86_64-linux,aarch64-linux", "--out", tmp_path) == 0
    plants = [tmp_path / "emps_plant_fmi2.fmu", tmp_path / "aarch64-linux" / "emps_plant_fmi2.fmu"]
    for path, machine in zip(plants, (62, 183), strict=True):
        with zipfile.ZipFile(path) as archive:
            assert elf_machine(archive.read("binaries/linux64/emps_plant.so")) == machine


def test_platforms_are_named_in_words_and_the_host_comes_first():
    assert platforms_of("host") == (host(),)
    assert set(platforms_of("all")) == set(PLATFORMS)
    assert platforms_of("all")[0] == host()
    assert platforms_of("x86_64-windows,aarch64-linux") == ("aarch64-linux", "x86_64-windows")
    with pytest.raises(ExportError, match='platform "vax" is unknown; there are: x86_64-linux, aarch64-linux'):
        platforms_of("host,vax")
