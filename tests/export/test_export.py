"""Archives: valid in an outside tool, right in both interfaces."""

import zipfile
from functools import cache

import export_models as models
import numpy as np
import pytest
from archives import EXPORTED, archive, of_case
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from pyfmi_models.export.codegen import generate
from pyfmi_models.export.description import fmi2_description, fmi3_description

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
