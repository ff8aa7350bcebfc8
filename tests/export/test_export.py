"""Archives: valid in an outside tool, right in both interfaces, self-contained, the same wherever they are made."""

import ctypes
import importlib
import os
import re
import shutil
import subprocess
import sys
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import export_models as models
import numpy as np
import pytest
from archives import EXPORTED, archive, of_case
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from fmu_tools import TOOLS
from scipy.integrate import solve_ivp

from pyfmi_models.card import read_card
from pyfmi_models.errors import ExportError
from pyfmi_models.export import build, build_library, export_fmu
from pyfmi_models.export.build import compile_shared, fmi_headers, sources_of
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.description import fmi2_description, fmi3_description
from pyfmi_models.export.platforms import PLATFORMS, host

__all__ = ["archive"]
ALL = (models.lugre, models.van_der_pol, models.oscillator, models.controller)
KINDS = ("CoSimulation", "ModelExchange")


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("make", ALL)
def test_the_archive_is_valid_and_for_one_machine_small(archive, make, fmi):
    assert validate_fmu(str(archive(make, fmi))) == []
    assert archive(make, fmi).stat().st_size < 200_000


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", EXPORTED)
def test_every_law_effect_and_case_has_a_valid_description(name, fmi, tmp_path):
    what = EXPORTED[name]
    generated = generate(of_case(what) if isinstance(what, str) else what.model())
    text = fmi2_description(generated, ["model.c"]) if fmi == 2 else fmi3_description(generated)
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as file:
        file.writestr("modelDescription.xml", text)
    assert validate_fmu(str(tmp_path / "a.fmu")) == []


# model: end, inputs, start values, sizes to compare with
CASES = {
    "slip": (models.lugre, 0.5, {"drive": 5.0}, {}, (1e-2, 1e-1, 1e-5)),
    "reversal": (models.lugre, 0.5, {"drive": -4.0}, {"speed": 0.05}, (1e-2, 1e-1, 1e-5)),
    "presliding": (models.lugre, 0.5, {"drive": 1.0}, {}, (1e-5, 1e-4, 1e-5)),
    "stiff": (models.van_der_pol, 70.0, {}, {}, (1.0, 1e-2)),
    "relaxation jumps": (models.van_der_pol, 12.0, {}, {"mu": 10.0}, (1.0, 1.0)),
    "explicit in time": (models.oscillator, 3.0, {"force": 0.3}, {}, (1.0, 1.0)),
}


@pytest.mark.parametrize(
    ("case", "kind", "fmi"),
    [(case, kind, 2 + (k + n) % 2) for n, case in enumerate(CASES) for k, kind in enumerate(KINDS)],
)
def test_both_interfaces_agree_with_a_tight_implicit_method(archive, case, kind, fmi):
    make, end, inputs, start, sizes = CASES[case]
    model = make()
    names, drive = [state.name for state in model.states], list(inputs.values())
    x, p = ([start.get(one.name, one.start) for one in group] for group in (model.states, model.parameters))
    exact = solve_ivp(
        lambda t, x: np.array(model.equations(t, x, drive, p)[0]).ravel(), (0, end), x, "Radau", rtol=1e-11, atol=1e-14
    ).y[:, -1]
    result = simulate_fmu(
        str(archive(make, fmi)), fmi_type=kind, stop_time=end, output_interval=end / 1000, output=names,
        start_values=inputs | start, relative_tolerance=1e-11 if kind == "ModelExchange" else 1e-9,
    )  # fmt: skip
    assert result["time"][-1] == pytest.approx(end)
    deviation = [(result[name][-1] - x) / size for name, x, size in zip(names, exact, sizes, strict=True)]
    assert np.abs(deviation).max() <= 1e-7


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_sampled_model_computes_what_its_equations_say_one_tick_later(archive, fmi):
    model, period = models.controller(), 1e-3
    table = np.array([(k * period, np.sin(k), 0.1) for k in range(51)],
                     dtype=[("time", float), ("measured", float), ("wanted", float)])  # fmt: skip
    result = simulate_fmu(str(archive(models.controller, fmi)), fmi_type="CoSimulation", input=table, stop_time=0.05,
                          output_interval=period, output=["command"])  # fmt: skip
    memory, expected = [0.0, 0.0, -1.0], [0.25]
    for t, measured, wanted in table[:-1]:
        memory, output = (np.array(part).ravel() for part in model.equations(t, memory, [measured, wanted], [10, 0.5]))
        expected.append(output[0])
    assert list(result["command"]) == expected


@pytest.mark.parametrize("fmi", [2, 3])
def test_in_model_exchange_ticks_are_time_events(archive, fmi):
    result = simulate_fmu(str(archive(models.controller, fmi)), fmi_type="ModelExchange", stop_time=0.0205,
                          output_interval=5e-4, output=["done", "count", "moment"], record_events=False,
                          start_values={"wanted": 1.0})  # fmt: skip
    ticks = np.floor(result["time"] / 1e-3 + 1e-6)
    assert np.array_equal(result["count"], ticks + 1)
    assert np.allclose(result["moment"], ticks * 1e-3, rtol=0, atol=1e-15)


# Built on this machine: from what, once, and refused in one sentence.


def test_the_binary_needs_libc_alone_and_exports_every_function_of_both_headers_and_nothing_else():
    library = build_library(models.lugre())

    def listed(*command):
        return subprocess.run([*command, str(library)], capture_output=True, text=True, check=True).stdout.splitlines()

    assert [line.split("[")[1].rstrip("]") for line in listed("readelf", "-d") if "NEEDED" in line] == ["libc.so.6"]
    assert [line for line in listed("nm", "-D", "--defined-only") if " fmi2" not in line and " fmi3" not in line] == []
    text = b"".join(fmi_headers()[f"fmi{n}FunctionTypes.h"] for n in (2, 3)).decode()
    names = re.findall(r"^\s*typedef \S.*?\b(fmi[23]\w+)TYPE\s*\(", text, re.M)
    assert len(names) == 119
    assert [name for name in names if not hasattr(ctypes.CDLL(str(library)), name)] == []


def test_our_c_compiles_without_a_warning():
    sources = sources_of(generate(models.lugre()))
    flags = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-Wno-unused-const-variable", "-c")
    headers = {name: text for name, text in sources.items() if name.endswith(".h")}
    for name in [name for name in sources if name.endswith(".c") and name not in ("model.c", "equations.c")]:
        compile_shared({**headers, name: sources[name]}, f"{name}.o", PLATFORMS[host()].target, flags)


def test_an_unchanged_model_is_only_looked_up(monkeypatch):
    built = build_library(models.lugre())
    monkeypatch.setattr(build, "_compile", None)
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


# In tools of others: they load, and compute the same bits.

CASES_OF_TOOLS = [(tool, fmi) for tool, (_, versions) in TOOLS.items() for fmi in versions]


@pytest.fixture(scope="module")
def mounts(tmp_path_factory):
    """Export plant or controller of the paper's mount once."""
    card, folder = read_card("paper_mount"), tmp_path_factory.mktemp("fmus")
    models = {"plant": card.plant().model(), "controller": card.controller_model()}
    return cache(lambda part, fmi: export_fmu(models[part], folder / f"{part}{fmi}.fmu", fmi=fmi))


def rows_in(tool, path, folder):
    try:
        importlib.import_module(TOOLS[tool][0])
    except (ImportError, OSError) as error:
        pytest.skip(f"{tool} is not installed: {error}")
    runner, out = Path(__file__).parents[2] / "bench" / "fmu_tools.py", folder / f"{tool}.npz"
    command = [sys.executable, str(runner), tool, str(path), "100", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return np.load(out)["rows"]


@pytest.mark.parametrize("part", ["plant", "controller"])
@pytest.mark.parametrize(("tool", "fmi"), CASES_OF_TOOLS)
def test_each_tool_loads_the_archive_and_finds_the_same_bits(mounts, tool, fmi, part, tmp_path):
    own = rows_in("fmpy", mounts(part, 3), tmp_path)
    assert np.ptp(own[:, 0]) > 0  # something moves
    assert rows_in(tool, mounts(part, fmi), tmp_path).tobytes() == own.tobytes()
