"""Archives: valid in an outside tool, right in both interfaces."""

import re
import xml.etree.ElementTree as ET
import zipfile
from functools import cache
from itertools import combinations
from pathlib import Path

import export_models as models
import fmpy
import numpy as np
import pytest
from archives import EXPORTED, archive, of_case
from effect_examples import EXAMPLES, mount
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from friction_laws import EXAMPLES as LAWS
from lxml import etree
from scipy.integrate import solve_ivp

from pyfmi_models.card import read_card
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.description import fmi2_description, fmi3_description
from pyfmi_models.export.diagram import diagram
from pyfmi_models.export.documentation import documentation
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.export.prose import formula, prose

__all__ = ["archive"]
ALL = (models.lugre, models.van_der_pol, models.oscillator, models.controller)
KINDS = ("CoSimulation", "ModelExchange")


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("make", ALL)
def test_the_archive_is_valid(archive, make, fmi):
    assert validate_fmu(str(archive(make, fmi))) == []


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


@pytest.mark.parametrize(
    ("case", "kind", "fmi"),
    [(case, kind, 2 + (k + n) % 2) for n, case in enumerate(CASES) for k, kind in enumerate(KINDS)],
)
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


# What an archive says of itself: sources, licences, icon, and a page with equations and a figure.


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
        tables = r"<h2>(\w+)</h2>\n<div class=\"wide\"[^>]*><table>(.*?)</table>"
        for title, body in re.findall(tables, page(model), re.S):
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


def test_licences_of_all_that_is_inside_are_inside(archive):
    with zipfile.ZipFile(archive(models.lugre, 3)) as file:
        ours, headers = (
            file.read(f"documentation/licenses/{name}.txt").decode() for name in ("license", "fmi-headers")
        )
    root = Path(__file__).parents[2]
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
