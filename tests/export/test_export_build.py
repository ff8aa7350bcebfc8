"""Archives: reproducible, self-contained, for any platform, and refused in one sentence."""

import ctypes
import os
import re
import shutil
import subprocess
import sys
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import export_models as models
import numpy as np
import pytest
from archives import archive
from fmpy import read_model_description, simulate_fmu

from pyfmi_models.errors import ExportError
from pyfmi_models.export import build, build_library, export_fmu
from pyfmi_models.export.build import compile_shared, fmi_headers, sources_of
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.platforms import PLATFORMS, host

__all__ = ["archive"]


def test_only_libc_is_needed():
    library = build_library(models.lugre())
    dynamic = subprocess.run(["readelf", "-d", str(library)], capture_output=True, text=True, check=True).stdout
    assert [line.split("[")[1].rstrip("]") for line in dynamic.splitlines() if "NEEDED" in line] == ["libc.so.6"]


def test_the_binary_exports_nothing_but_both_api_sets():
    library = build_library(models.lugre())
    listing = subprocess.run(["nm", "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True)
    names = {line.split()[-1] for line in listing.stdout.splitlines()}
    assert {"fmi2DoStep", "fmi3DoStep", "fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives"} <= names
    assert {name for name in names if not name.startswith(("fmi2", "fmi3"))} == set()


def test_every_function_of_the_headers_is_there():
    library = ctypes.CDLL(str(build_library(models.lugre())))
    text = b"".join(fmi_headers()[f"fmi{n}FunctionTypes.h"] for n in (2, 3)).decode()
    names = re.findall(r"^\s*typedef \S.*?\b(fmi[23]\w+)TYPE\s*\(", text, re.M)
    assert len(names) == 119
    assert [name for name in names if not hasattr(library, name)] == []


def test_our_c_compiles_without_a_warning():
    sources = {name: text for name, text in sources_of(generate(models.lugre())).items() if name != "model.c"}
    sources["equations.c"] = b""
    flags = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-Wno-unused-const-variable", "-c")
    objects = {name: text for name, text in sources.items() if name.endswith(".h")}
    for name in [name for name in sources if name.endswith(".c") and name != "equations.c"]:
        compile_shared({**objects, name: sources[name]}, f"{name}.o", PLATFORMS[host()].target, flags)


def test_an_unchanged_model_is_only_looked_up(monkeypatch):
    built = build_library(models.lugre())
    monkeypatch.setattr(build, "_build", None)
    assert build_library(models.lugre()) == built


def test_several_builds_at_once_agree():
    fresh = replace(models.oscillator(), description=f"Built at {time.time_ns()}.")
    with ThreadPoolExecutor(2) as pool:
        libraries = list(pool.map(build_library, [fresh] * 2))
    assert len(set(libraries)) == 1
    assert list(libraries[0].parent.iterdir()) == [libraries[0]]
    assert models.Driver(fresh, libraries[0], 3).start().step(0, 0.1) == "ok"
    libraries[0].unlink()
    libraries[0].parent.rmdir()


@pytest.mark.parametrize("fmi", [2, 3])
def test_plain_gcc_makes_the_same_fmu_of_the_sources(archive, tmp_path, fmi):
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("gcc is not installed")
    with zipfile.ZipFile(archive(models.lugre, fmi)) as file:
        file.extractall(tmp_path)
    (configuration,) = read_model_description(str(tmp_path)).buildConfigurations
    names = [name for group in configuration.sourceFileSets for name in group.sourceFiles]
    (binary,) = (tmp_path / "binaries").glob("*/*")
    before = binary.read_bytes()
    subprocess.run([compiler, "-std=c11", "-O2", "-fPIC", "-shared", *names, "-o", str(binary), "-lm"], check=True,
                   cwd=tmp_path / "sources")  # fmt: skip
    assert binary.read_bytes() != before
    runs = [simulate_fmu(str(path), stop_time=0.2, output_interval=1e-3, start_values={"drive": 5.0})
            for path in (archive(models.lugre, fmi), tmp_path)]  # fmt: skip
    assert np.abs(runs[0]["torque"]).max() > 2
    assert runs[0].tobytes() == runs[1].tobytes()


def test_an_archive_made_elsewhere_by_an_empty_cache_is_the_same(archive, tmp_path):
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import export_models as models;"
        "from pyfmi_models.export import export_fmu; from pathlib import Path;"
        "export_fmu(models.lugre(), Path('here.fmu'), fmi=3)"
    )
    environment = os.environ | {
        "PYTHONHASHSEED": "77", "MOUNT_COSIM_CACHE": str(tmp_path / "cache"), "TZ": "Asia/Tokyo", "LC_ALL": "C",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }  # fmt: skip
    tests = str(Path(models.__file__).parent)
    subprocess.run([sys.executable, "-W", "error", "-c", code, tests], cwd=tmp_path, env=environment, check=True)
    assert (tmp_path / "here.fmu").read_bytes() == archive(models.lugre, 3).read_bytes()
    with zipfile.ZipFile(tmp_path / "here.fmu") as file:
        assert {entry.date_time for entry in file.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert file.namelist() == sorted(file.namelist())


def test_an_archive_for_one_machine_is_small(archive):
    assert all(archive(models.lugre, fmi).stat().st_size < 200_000 for fmi in (2, 3))


def test_a_cache_that_cannot_be_written_is_named(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "file"))
    with pytest.raises(ExportError, match=r"cannot build in .*file.*set MOUNT_COSIM_CACHE"):
        build_library(models.oscillator())


def test_a_compiler_error_is_passed_on():
    with pytest.raises(ExportError, match=r"the C compiler failed on broken\.so .*error: "):
        compile_shared({"broken.c": b"int main(void) { return missing; }"}, "broken.so", PLATFORMS[host()].target)


def test_nothing_is_overwritten_without_force(tmp_path):
    path = export_fmu(models.oscillator(), tmp_path / "a.fmu")
    with pytest.raises(ExportError, match="exists; use force"):
        export_fmu(models.oscillator(), path)
    assert export_fmu(models.oscillator(), path, force=True) == path
    assert list(tmp_path.iterdir()) == [path]
