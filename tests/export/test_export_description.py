"""What an archive says of itself is true: dependencies, kinds, units; sources, licences, a page with a figure."""

import re
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path

import casadi as ca
import export_models as models
import fmpy
import numpy as np
import pytest
from archives import EXPORTED, archive, of_case
from effect_examples import EXAMPLES, mount
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from friction_laws import EXAMPLES as LAWS
from lxml import etree
from scipy import constants

from pyfmi_models.card import read_card
from pyfmi_models.errors import ExportError
from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.diagram import diagram
from pyfmi_models.export.documentation import documentation
from pyfmi_models.export.layout import layout_of
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.export.prose import formula, prose
from pyfmi_models.export.structure import unknowns_of
from pyfmi_models.export.units import BASE, parse_unit

__all__ = ["archive"]


def structure(path):
    read = read_model_description(str(path))
    groups = {"outputs": read.outputs, "derivatives": read.derivatives, "initial": read.initialUnknowns}

    def said(unknown):
        return dict(zip([one.name for one in unknown.dependencies], unknown.dependenciesKind, strict=True))

    return {group: {one.variable.name: said(one) for one in unknowns} for group, unknowns in groups.items()}


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
    rates = {"der(position)": {"position": DEPENDENT, "velocity": DEPENDENT}, "der(velocity)": {"force": FIXED}}
    outputs = {"where": {"position": DEPENDENT}, "direct": {"force": DEPENDENT}}
    assert found["derivatives"] == rates
    assert found["outputs"] == outputs | {"clock": {"position": DEPENDENT, "velocity": FIXED}}
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

    def slope(point, i, j):
        moved = point.copy()
        moved[j] += 0.01
        return ((evaluate(moved) - evaluate(point)) / 0.01)[i + (len(model.states) if model.period else 0)]

    starts = np.array([row.variable.start for row in rows])
    first, second = (starts + random.normal(size=len(rows)) * (np.abs(starts) + 0.01) / 10 for _ in range(2))
    elsewhere = np.where([row.kind == "parameter" for row in rows], first, second)
    for (i, unknown), (j, row) in product(enumerate(unknowns_of(layout)), enumerate(rows)):
        kind = unknown.dependencies.get(row.reference, "none" if row.kind in ("time", "input") else "hidden")
        if kind == "none":
            assert slope(first, i, j) == 0
        if kind in (CONSTANT, TUNABLE, FIXED):
            assert slope(first, i, j) == pytest.approx(slope(elsewhere, i, j), rel=1e-6, abs=1e-6)


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
    independent = [v for v in description.modelVariables if v.causality == "independent"]
    assert [(v.name, v.unit, v.variability, v.start) for v in independent] == [("time", "s", "continuous", None)]
    units = {unit.name: {d.name: float(d.factor) for d in unit.displayUnits} for unit in description.unitDefinitions}
    assert found["z"].displayUnit == "arcsec", "small angles"
    assert units["rad"]["arcsec"] * np.pi / 180 == pytest.approx(3600, rel=1e-15)


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
    assert re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", generate(model).token)
    assert generate(model).token == generate(models.lugre()).token
    assert generate(model).token != generate(replace(model, name="other")).token
    harder = (replace(model.parameters[0], start=31.0), *model.parameters[1:])
    assert generate(model).token != generate(replace(model, parameters=harder)).token


# Units are products of base units; what cannot be exported is refused by name.

UNITS = {
    "N.m": ({"kg": 1, "m": 2, "s": -2}, 1.0),
    "N.m.s/rad": ({"kg": 1, "m": 2, "s": -1, "rad": -1}, 1.0),
    "kg/(m.s2)": ({"kg": 1, "m": -1, "s": -2}, 1.0),
    "1": ({}, 1.0),
    "1/s": ({"s": -1}, 1.0),
    "1/degC": ({"K": -1}, 1.0),
    "s-1": ({"s": -1}, 1.0),
    "deg": ({"rad": 1}, np.pi / 180),
    "arcmin": ({"rad": 1}, constants.arcmin),
    "arcsec": ({"rad": 1}, constants.arcsec),
    "h": ({"s": 1}, constants.hour),
    "degC": ({"K": 1}, 1.0),
    "mm/s": ({"m": 1, "s": -1}, 1e-3),
    "V": ({"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
}


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_is_a_product_of_base_units(name):
    powers, factor = UNITS[name]
    unit = parse_unit(name)
    assert dict(zip(BASE, unit.exponents, strict=True)) == dict.fromkeys(BASE, 0) | powers
    assert unit.factor == pytest.approx(factor, rel=1e-15)
    assert unit.offset == (273.15 if name == "degC" else 0)


@pytest.mark.parametrize(
    ("name", "culprit"), [("furlong", '"furlong"'), ("N.m/rad.s", "brackets"), ("N..m", '""'), ("", '""')]
)
def test_an_unknown_unit_is_named(name, culprit):
    with pytest.raises(ExportError, match=culprit):
        parse_unit(name)


OF_NO_BIT = ca.Function("f", one := models.symbols(2, 1, 1), [ca.vertcat(ca.erf(one[1][0]), 0), ca.vertcat(0, 0, 0)])
"""A function without a deterministic version."""
BROKEN = {
    "uses erf": {"equations": OF_NO_BIT},
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


def test_equations_may_also_be_matrix_expressions():
    scalar = models.oscillator()
    arguments = [ca.MX.sym(name, size) for name, size in zip("txup", (1, 2, 1, 1), strict=True)]
    model = replace(
        scalar, name="matrix", equations=ca.Function("equations", arguments, scalar.equations.call(arguments))
    )
    runs = [models.Driver(m, build_library(m), 3).start(force=0.2).run(0, 50, 0.02) for m in (scalar, model)]
    assert np.array_equal(runs[0].get("position", "velocity"), runs[1].get("position", "velocity"))


# Sources, licences, icon, and a page with equations and a figure.


def test_the_archive_holds_sources_a_page_and_the_licences_of_all_that_is_inside(archive):
    with zipfile.ZipFile(archive(models.lugre, 3)) as file:
        names = set(file.namelist())
        page, ours, headers = (
            file.read(f"documentation/{name}").decode()
            for name in ("index.html", "licenses/license.txt", "licenses/fmi-headers.txt")
        )
    binary = f"lugre{PLATFORMS[host()].suffix}"
    sources = {"model.c", "equations.c", "fmi3Functions.h", "buildDescription.xml", "detmath.c"}
    assert {f"binaries/{host()}/{binary}", *(f"sources/{name}" for name in sources)} <= names
    assert "friction.sigma0" in page
    assert ours == (Path(__file__).parents[2] / "LICENSE").read_text()
    assert "Modelica Association" in headers
    assert "Redistributions of source code must retain" in headers
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
    said = ", ".join(one.id.replace("_", " ") for one in chosen)
    assert mount(*chosen, friction=LAWS["lugre"]).model().description == f"m: one axis with lugre friction, {said}"
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


def test_the_archive_shows_an_icon_that_other_tools_find(archive):
    with zipfile.ZipFile(archive(models.lugre, 2)) as file:
        assert file.read("model.png").startswith(b"\x89PNG")
    with zipfile.ZipFile(archive(models.lugre, 3)) as file:
        icon, text = (file.read(f"terminalsAndIcons/{name}") for name in ("icon.png", "terminalsAndIcons.xml"))
    assert icon.startswith(b"\x89PNG")
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(etree.fromstring(text))
