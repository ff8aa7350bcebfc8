"""Units are products of base units; what cannot be exported is refused by name."""

from dataclasses import replace

import casadi as ca
import export_models as models
import numpy as np
import pytest

from pyfmi_models.errors import ExportError
from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.units import BASE, parse_unit

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
