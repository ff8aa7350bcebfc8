"""Archives: valid in an outside tool, right in both interfaces, reproducible, self-contained."""

import ctypes
import os
import re
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path

import casadi as ca
import export_models as models
import fmpy
import numpy as np
import pytest
from effect_examples import EXAMPLES, mount
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from friction_laws import EXAMPLES as LAWS
from friction_laws import ONE_SIDED
from lxml import etree
from scipy.integrate import solve_ivp

from pyfmi_models.card import read_card
from pyfmi_models.controller_section import AdaptationSection, LearningSection
from pyfmi_models.errors import ExportError
from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.export.build import compile_shared, fmi_headers, sources_of
from pyfmi_models.export.codegen import SHIM, generate
from pyfmi_models.export.description import fmi2_description, fmi3_description
from pyfmi_models.export.diagram import diagram
from pyfmi_models.export.documentation import documentation
from pyfmi_models.export.layout import layout_of
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.export.prose import formula, prose
from pyfmi_models.export.structure import unknowns_of
from pyfmi_models.export.units import BASE, parse_unit

ALL = (models.lugre, models.van_der_pol, models.oscillator, models.controller)
KINDS = ("CoSimulation", "ModelExchange")


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    """Export a model of export_models once per session."""
    folder = tmp_path_factory.mktemp("fmus")
    return cache(lambda make, fmi: export_fmu(make(), folder / f"{make.__name__}{fmi}.fmu", fmi=fmi))


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("make", ALL)
def test_the_archive_is_valid(archive, make, fmi):
    assert validate_fmu(str(archive(make, fmi))) == []


CONTROLLERS = {
    **{case: {"compensation": case} for case in ("C1", "C2a", "C2b", "C3a", "C3b", "C2a+C3a")},
    "that identifies": {"adaptation": AdaptationSection()},
    "that learns": {"learning": LearningSection(period=1.0, knots=10)},
    "of order 4": {"observer_order": 4},
    "by differences": {"velocity": "difference"},
}


def of_case(case):
    card = read_card("paper_mount")
    return replace(card, controller=card.controller.model_copy(update=CONTROLLERS[case])).controller_model()


EXPORTED = {
    **{f"{key} friction": mount(friction=law) for key, law in LAWS.items()},
    **{f"one-sided {key} friction": mount(friction=law) for key, law in ONE_SIDED.items()},
    **{type(effect).__name__: mount(effect) for effect in EXAMPLES},
    "every effect": mount(*EXAMPLES),
    **{case: case for case in CONTROLLERS},
}


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", EXPORTED)
def test_every_law_effect_and_case_has_a_valid_description(name, fmi, tmp_path):
    what = EXPORTED[name]
    generated = generate(of_case(what) if isinstance(what, str) else what.model())
    text = fmi2_description(generated, ["model.c"]) if fmi == 2 else fmi3_description(generated)
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as file:
        file.writestr("modelDescription.xml", text)
    assert validate_fmu(str(tmp_path / "a.fmu")) == []


@cache
def reference(case):
    """The states at the end of a case by an implicit method at its tightest."""
    make, end, inputs, given, _ = CASES[case]
    model, drive = make(), list(inputs.values())
    start = [given.get(state.name, state.start) for state in model.states]
    parameters = [given.get(parameter.name, parameter.start) for parameter in model.parameters]

    def rates(t, x):
        return np.array(model.equations(t, x, drive, parameters)[0]).ravel()

    return solve_ivp(rates, (0, end), start, method="Radau", rtol=1e-11, atol=1e-14).y[:, -1]


# model: end, inputs, start values, sizes to compare with
CASES = {
    "slip": (models.lugre, 0.5, {"drive": 5.0}, {}, (1e-2, 1e-1, 1e-5)),
    "reversal": (models.lugre, 0.5, {"drive": -4.0}, {"speed": 0.05}, (1e-2, 1e-1, 1e-5)),
    "presliding": (models.lugre, 0.5, {"drive": 1.0}, {}, (1e-5, 1e-4, 1e-5)),
    "stiff": (models.van_der_pol, 70.0, {}, {}, (1.0, 1e-2)),
    "relaxation jumps": (models.van_der_pol, 12.0, {}, {"mu": 10.0}, (1.0, 1.0)),
    "explicit in time": (models.oscillator, 3.0, {"force": 0.3}, {}, (1.0, 1.0)),
}


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", CASES)
def test_both_interfaces_agree_with_a_tight_implicit_method(archive, case, kind, fmi):
    make, end, inputs, start, sizes = CASES[case]
    model = make()
    names = [state.name for state in model.states]
    exact = reference(case)
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


@pytest.mark.parametrize("fmi", [2, 3])
def test_two_exports_give_the_same_bytes(archive, tmp_path, fmi):
    again = export_fmu(models.lugre(), tmp_path / "again.fmu", fmi=fmi)
    assert again.read_bytes() == archive(models.lugre, fmi).read_bytes()
    with zipfile.ZipFile(again) as file:
        assert {entry.date_time for entry in file.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert file.namelist() == sorted(file.namelist())


def test_two_compilations_give_the_same_binary():
    sources = {path.name: path.read_bytes() for path in SHIM.glob("detmath*")}
    flags = ("-std=c11", "-O2", "-g0", "-s", "-shared", "-fPIC")
    target = PLATFORMS[host()].target
    built = compile_shared(sources, "twice.so", target, flags)
    first = built.read_bytes()
    built.unlink()
    assert compile_shared(sources, "twice.so", target, flags).read_bytes() == first


def test_an_unchanged_model_is_only_looked_up():
    build_library(models.lugre())
    start = time.process_time()
    build_library(models.lugre())
    assert time.process_time() - start <= 0.1


def test_several_builds_at_once_agree():
    fresh = replace(models.oscillator(), description=f"Built at {time.time_ns()}.")
    with ThreadPoolExecutor(2) as pool:
        libraries = list(pool.map(build_library, [fresh] * 2))
    assert len(set(libraries)) == 1
    assert list(libraries[0].parent.iterdir()) == [libraries[0]]
    assert models.Driver(fresh, libraries[0], 3).start().step(0, 0.1) == "ok"
    libraries[0].unlink()
    libraries[0].parent.rmdir()


def test_the_archive_holds_sources_and_a_page(archive):
    with zipfile.ZipFile(archive(models.lugre, 3)) as file:
        names = set(file.namelist())
        page = file.read("documentation/index.html").decode()
    binary = f"lugre{PLATFORMS[host()].suffix}"
    sources = {"model.c", "equations.c", "fmi3Functions.h", "buildDescription.xml", "detmath.c"}
    assert {f"binaries/{host()}/{binary}", *(f"sources/{name}" for name in sources)} <= names
    assert "friction.sigma0" in page
    with zipfile.ZipFile(archive(models.lugre, 2)) as file:
        assert f"binaries/{PLATFORMS[host()].fmi2}/{binary}" in file.namelist()


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
    subprocess.run([sys.executable, "-c", code, tests], cwd=tmp_path, env=environment, check=True)
    assert (tmp_path / "here.fmu").read_bytes() == archive(models.lugre, 3).read_bytes()


def page(model):
    return documentation(generate(model), ("x86_64-linux",))["documentation/index.html"].decode()


def test_the_page_shows_equations_parameters_units_and_a_figure_and_needs_no_network():
    text = page(read_card("paper_mount").plant().model())
    assert "dz/dt = v − σ<sub>0</sub> |v| z / g(v)" in text
    assert "<svg" in text
    for name, value in {"friction.sigma0": "92300", "friction.Vs": "0.04129"}.items():
        assert re.search(rf"<code>{re.escape(name)}</code></td><td>[^<]+</td><td class=\"number\">{value}<", text)
    assert "kg m² s⁻² rad⁻¹" in text
    for heading in ("Solver and time", "Limits", "How it was validated", "Build it from its sources", "Licences"):
        assert f"<h2>{heading}</h2>" in text
    assert re.findall(r"(?:src|href)=|@import|url\((?!#)", text) == []


def test_the_description_of_a_plant_names_its_parts():
    chosen = [one for one in EXAMPLES if one.id in ("backlash", "torque_offset")]
    assert mount(
        *chosen, friction=LAWS["lugre"]
    ).model().description == "m: one axis with lugre friction, " + ", ".join(one.id.replace("_", " ") for one in chosen)
    assert mount(friction=LAWS["none"]).model().description == "m: one axis with no friction"


def test_the_page_says_only_starts_and_ranges_that_there_are():
    """Outputs of a plant are calculated, those of a controller hold their start value until the first tick."""
    heads = {}
    for part, model in (("plant", mount(*EXAMPLES).model()), ("controller", of_case("C2a"))):
        for title, body in re.findall(r"<h2>(\w+)</h2>\n<div class=\"wide\"><table>(.*?)</table>", page(model), re.S):
            rows = body.strip().split("</tr>")
            heads[part, title] = re.findall(r"<th[^>]*>(\w+)", rows[0])
            assert {row.count("<td") for row in rows[1:-1]} == {len(heads[part, title])} or title == "Units"
    assert heads["plant", "Outputs"] == ["Name", "Unit", "Description"]
    assert heads["controller", "Outputs"] == ["Name", "Unit", "Start", "Description"]
    assert heads["plant", "Parameters"] == ["Name", "Unit", "Start", "Range", "Description"]
    assert f"more than {generate(of_case('C2a')).most_steps:,} ticks".replace(",", " ") in page(of_case("C2a"))


@pytest.mark.parametrize("name", EXPORTED)
def test_every_part_of_a_model_has_a_chapter_and_a_place_in_the_figure(name):
    what = EXPORTED[name]
    model = of_case(what) if isinstance(what, str) else what.model()
    figure = ET.fromstring(diagram(model))
    shown = [text.text for text in figure.iter("{http://www.w3.org/2000/svg}text")]
    assert {chapter.title for chapter in model.chapters} | {chapter.place for chapter in model.chapters} <= set(shown)
    assert len(model.chapters) >= (2 if isinstance(what, str) else 2 + len(what.effects))
    assert all(chapter.text for chapter in model.chapters)


def test_boxes_of_the_figure_do_not_overlap():
    figure = ET.fromstring(diagram(mount(*EXAMPLES).model()))
    boxes = [[float(box.get(key)) for key in ("x", "y", "width", "height")]
             for box in figure.iter("{http://www.w3.org/2000/svg}rect")]  # fmt: skip
    assert len(boxes) == 7
    for (x, y, w, h), (p, q, v, g) in combinations(boxes, 2):
        assert x + w <= p or p + v <= x or y + h <= q or q + g <= y


FORMULAS = {
    "sigma0 z + sigma1 dz/dt": "σ<sub>0</sub> z + σ<sub>1</sub> dz/dt",
    "exp(-|v/Vs|^delta)": "exp(−|v/Vs|<sup>δ</sup>)",
    "J_far (2 pi fa)^2": "J<sub>far</sub> (2 π fa)<sup>2</sup>",
    "warm_up_degC - rise <= 1e4": "warm_up_degC − rise ≤ 1e4",
    "(1 - b)^3/h^2 r": "(1 − b)<sup>3</sup>/h<sup>2</sup> r",
}


@pytest.mark.parametrize("text", FORMULAS)
def test_formulas_are_set_to_be_read(text):
    assert formula(text) == FORMULAS[text]


def test_prose_shows_symbols_as_formulas_do_and_leaves_names_and_words():
    text = "The sigma0 of `friction.sigma0` < tau_f; delta and zeta1_last are words, mu2 is not."
    assert prose(text) == (
        "<p>The σ₀ of <code>friction.sigma0</code> &lt; tau_f; delta and zeta1_last are words, μ₂ is not.</p>"
    )


LICENCES = ("license", "fmi-headers")


def test_licences_of_all_that_is_inside_are_inside(archive):
    with zipfile.ZipFile(archive(models.lugre, 3)) as file:
        ours, headers = (
            file.read(f"documentation/licenses/{name}.txt").decode() for name in ("license", "fmi-headers")
        )
    root = Path(__file__).parents[1]
    assert ours == (root / "LICENSE").read_text()
    assert "Modelica Association" in headers
    assert "Redistributions of source code must retain" in headers


def test_the_archive_shows_an_icon_that_other_tools_find(archive):
    with zipfile.ZipFile(archive(models.lugre, 2)) as file:
        assert file.read("model.png").startswith(b"\x89PNG")
    with zipfile.ZipFile(archive(models.lugre, 3)) as file:
        icon, text = (file.read(f"terminalsAndIcons/{name}") for name in ("icon.png", "terminalsAndIcons.xml"))
    assert icon.startswith(b"\x89PNG")
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(etree.fromstring(text))


def test_an_archive_for_one_machine_is_small(archive):
    assert all(archive(models.lugre, fmi).stat().st_size < 200_000 for fmi in (2, 3))


def test_the_archive_for_another_platform_is_refused_by_name(tmp_path):
    with pytest.raises(ExportError, match=r'platform "vax-vms" is unknown; there are: x86_64-linux'):
        export_fmu(models.lugre(), tmp_path / "a.fmu", platforms=("vax-vms",))
    assert list(tmp_path.iterdir()) == []


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


def structure(path):
    description = read_model_description(str(path))
    groups = {"outputs": description.outputs, "derivatives": description.derivatives,
              "initial": description.initialUnknowns}  # fmt: skip
    return {
        group: {
            u.variable.name: dict(zip([d.name for d in u.dependencies], u.dependenciesKind, strict=True))
            for u in unknowns
        }
        for group, unknowns in groups.items()
    }


CONSTANT, FIXED, TUNABLE, DEPENDENT = "constant", "fixed", "tunable", "dependent"


@pytest.mark.parametrize("fmi", [2, 3])
def test_dependencies_are_the_true_ones_and_say_how(archive, fmi):
    outputs = {"where": {"position": CONSTANT}, "direct": {"force": CONSTANT}, "clock": {"time": CONSTANT}}
    speed = {"time": DEPENDENT, "force": CONSTANT}
    rates = {"der(position)": {"velocity": CONSTANT}, "der(velocity)": speed | {"position": TUNABLE}}
    initial = {"direct": {"force": CONSTANT, "stiffness": CONSTANT},
               "der(velocity)": speed | {"stiffness": DEPENDENT, "position": DEPENDENT}}  # fmt: skip
    found = structure(archive(models.oscillator, fmi))
    assert (found["outputs"], found["derivatives"]) == (outputs, rates)
    assert found["initial"] == outputs | rates | initial


def test_a_factor_that_is_fixed_or_jumps_is_told_from_one_that_can_be_tuned(tmp_path):
    model = models.oscillator()
    t, x, u, p = models.symbols(2, 1, 1)
    rates = [ca.if_else(x[0] > 0, 1, 2) * x[1], 3 * u / p]
    shown = [ca.if_else(x[0] > 0, 1, 2), ca.sign(u) + 2 * u, p * x[1] + ca.fabs(x[0])]
    equations = ca.Function("equations", [t, x, u, p], [ca.vertcat(*rates), ca.vertcat(*shown)])
    fixed = (replace(model.parameters[0], tunable=False, low=0.5),)
    path = export_fmu(replace(model, equations=equations, parameters=fixed), tmp_path / "a.fmu")
    found = structure(path)
    assert found["derivatives"] == {
        "der(position)": {"position": DEPENDENT, "velocity": DEPENDENT},
        "der(velocity)": {"force": FIXED},
    }
    assert found["outputs"] == {
        "where": {"position": DEPENDENT},
        "direct": {"force": DEPENDENT},
        "clock": {"position": DEPENDENT, "velocity": FIXED},
    }
    assert validate_fmu(str(path)) == []


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("part", ["plant", "controller"])
def test_what_is_said_of_dependencies_holds_in_numbers(part, seed):
    card = read_card("paper_mount")
    model = card.plant().model() if part == "plant" else card.controller_model()
    layout, random = layout_of(model), np.random.default_rng(seed)
    groups = ("time", "state", "input", "parameter")
    rows = [row for group in groups for row in layout.of(group)]
    sizes = np.cumsum([len(layout.of(group)) for group in groups])[:-1]

    def evaluate(column):
        return np.concatenate([np.array(part).ravel() for part in model.equations(*np.split(column, sizes))])

    starts = np.array([row.variable.start for row in rows])
    first, second = (starts + random.normal(size=len(rows)) * (np.abs(starts) + 0.01) / 10 for _ in range(2))
    offset = len(model.states) if model.period else 0
    for i, unknown in enumerate(unknowns_of(layout)):
        for j, row in enumerate(rows):
            kind = unknown.dependencies.get(row.reference, "none" if row.kind in ("time", "input") else "hidden")
            if kind == "none":
                moved = first.copy()
                moved[j] += 0.01
                assert evaluate(moved)[offset + i] == evaluate(first)[offset + i]
            if kind in (CONSTANT, TUNABLE, FIXED):
                slopes = []
                for point in (first, np.where([r.kind == "parameter" for r in rows], first, second)):
                    moved = point.copy()
                    moved[j] += 0.01
                    slopes.append((evaluate(moved) - evaluate(point))[offset + i] / 0.01)
                assert slopes[0] == pytest.approx(slopes[1], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("fmi", [2, 3])
def test_variables_say_what_they_are(archive, fmi):
    description = read_model_description(str(archive(models.lugre, fmi)))
    found = {v.name: v for v in description.modelVariables}
    assert [(v.causality, v.variability, v.initial) for v in (found["friction.Fc"], found["z"], found["torque"])] == [
        ("parameter", "tunable", "exact"),
        ("local", "continuous", "exact"),
        ("output", "continuous", "calculated"),
    ]
    assert (found["friction.Fc"].unit, found["friction.Fc"].start, found["friction.Fc"].min) == ("N.m", "2.32", "1e-09")
    assert (found["drive"].min, found["drive"].max, found["z"].nominal) == ("-100.0", "100.0", "1e-05")
    assert found["der(z)"].derivative.name == "z"
    assert (found["der(speed)"].unit, found["der(angle)"].unit) == ("rad/s2", "rad/s")
    assert (description.defaultExperiment.stepSize, description.defaultExperiment.tolerance) == ("0.0001", "1e-08")


@pytest.mark.parametrize("fmi", [2, 3])
def test_time_is_the_one_independent_variable_and_has_no_start(archive, fmi):
    description = read_model_description(str(archive(models.controller, fmi)))
    independent = [v for v in description.modelVariables if v.causality == "independent"]
    assert [(v.name, v.unit, v.variability, v.start) for v in independent] == [("time", "s", "continuous", None)]


DISPLAYED = {
    "paper_mount": {"q": "deg", "v": "deg/s", "der(speed)": "deg/s2", "tau": None, "friction.Vs": "deg/s"},
    "emps": {"q": None, "v": None, "friction.smoothing": "um/s"},
}


@pytest.mark.parametrize("card", DISPLAYED)
@pytest.mark.parametrize("fmi", [2, 3])
def test_display_units_are_those_of_the_field(tmp_path, card, fmi):
    path = export_fmu(read_card(card).plant().model(), tmp_path / "a.fmu", fmi=fmi)
    description = read_model_description(str(path))
    found = {v.name: v.displayUnit for v in description.modelVariables}
    assert {name: found.get(name) for name in DISPLAYED[card]} == DISPLAYED[card]
    assert validate_fmu(str(path)) == []


def test_small_angles_are_shown_in_arcseconds(archive):
    description = read_model_description(str(archive(models.lugre, 3)))
    units = {unit.name: {d.name: float(d.factor) for d in unit.displayUnits} for unit in description.unitDefinitions}
    assert {v.name: v.displayUnit for v in description.modelVariables}["z"] == "arcsec"
    assert units["rad"]["arcsec"] * np.pi / 180 == pytest.approx(3600, rel=1e-15)


@pytest.mark.parametrize("kind", ["CS", "ME"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_fixed_parameter_is_settled_by_the_end_of_initialization(fmi, kind):
    model = models.oscillator()
    fixed = replace(model, parameters=(replace(model.parameters[0], tunable=False),))
    driver = models.Driver(fixed, build_library(fixed), fmi, kind).start(stiffness=2.0)
    assert driver.set("stiffness", 3.0) == "error"
    assert driver.messages[-1][2] == 'fixed parameter "stiffness" can be set before the end of initialization only'
    assert driver.get("stiffness")[0] == 2.0


def test_the_token_follows_the_content():
    model = models.lugre()
    assert generate(model).token == generate(models.lugre()).token
    assert generate(model).token != generate(replace(model, name="other")).token
    harder = (replace(model.parameters[0], start=31.0), *model.parameters[1:])
    assert generate(model).token != generate(replace(model, parameters=harder)).token


UNITS = {
    "N.m": ({"kg": 1, "m": 2, "s": -2}, 1.0),
    "N.m.s/rad": ({"kg": 1, "m": 2, "s": -1, "rad": -1}, 1.0),
    "kg.m2": ({"kg": 1, "m": 2}, 1.0),
    "rad/s2": ({"rad": 1, "s": -2}, 1.0),
    "N.s/m": ({"kg": 1, "s": -1}, 1.0),
    "kg/(m.s2)": ({"kg": 1, "m": -1, "s": -2}, 1.0),
    "1": ({}, 1.0),
    "1/s": ({"s": -1}, 1.0),
    "1/degC": ({"K": -1}, 1.0),
    "s-1": ({"s": -1}, 1.0),
    "deg": ({"rad": 1}, np.pi / 180),
    "mm/s": ({"m": 1, "s": -1}, 1e-3),
    "V": ({"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
}


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_is_a_product_of_base_units(name):
    powers, factor = UNITS[name]
    unit = parse_unit(name)
    assert dict(zip(BASE, unit.exponents, strict=True)) == dict.fromkeys(BASE, 0) | powers
    assert unit.factor == pytest.approx(factor, rel=1e-15)
    assert unit.offset == 0


def test_a_temperature_has_an_offset():
    assert parse_unit("degC").offset == 273.15


@pytest.mark.parametrize(
    ("name", "culprit"), [("furlong", '"furlong"'), ("N.m/rad.s", "brackets"), ("N..m", '""'), ("", '""')]
)
def test_an_unknown_unit_is_named(name, culprit):
    with pytest.raises(ExportError, match=culprit):
        parse_unit(name)


def test_an_unknown_unit_in_a_model_stops_the_export(tmp_path):
    model = models.oscillator()
    with pytest.raises(ExportError, match='"furlong"'):
        export_fmu(replace(model, inputs=(models.variable("force", "furlong"),)), tmp_path / "a.fmu")
    assert list(tmp_path.iterdir()) == []


BROKEN = {
    "two variables": {"outputs": (models.variable("force"), models.variable("b"), models.variable("c"))},
    'called "time"': {"inputs": (models.variable("time"),)},
    "start value": {"parameters": (models.variable("stiffness", start=-1.0, low=0.0),)},
    "nominal value": {"states": (models.variable("a", nominal=0.0), models.variable("b"))},
    "1 inputs, but 0": {"inputs": ()},
    "period": {"period": -1.0},
}


@pytest.mark.parametrize("message", BROKEN)
def test_a_broken_model_is_refused_in_one_sentence(message):
    with pytest.raises(ExportError, match=message):
        generate(replace(models.oscillator(), **BROKEN[message]))


def test_a_function_without_a_deterministic_version_is_named():
    model = models.oscillator()
    arguments = models.symbols(2, 1, 1)
    rates = ca.vertcat(ca.erf(arguments[1][0]), 0)
    equations = ca.Function("equations", arguments, [rates, ca.vertcat(0, 0, 0)])
    with pytest.raises(ExportError, match="uses erf"):
        generate(replace(model, equations=equations))


def test_equations_may_also_be_matrix_expressions():
    scalar = models.oscillator()
    arguments = [ca.MX.sym(name, size) for name, size in zip("txup", (1, 2, 1, 1), strict=True)]
    model = replace(
        scalar, name="matrix", equations=ca.Function("equations", arguments, scalar.equations.call(arguments))
    )
    runs = [models.Driver(m, build_library(m), 3).start(force=0.2).run(0, 50, 0.02) for m in (scalar, model)]
    assert np.array_equal(runs[0].get("position", "velocity"), runs[1].get("position", "velocity"))


def test_the_export_runs_in_a_fresh_process(tmp_path):
    code = "from pyfmi_models.export import export_fmu, build_library; print(export_fmu.__name__)"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "export_fmu"
