"""The Modelica text is parsed by an outside parser, and its equations are those of the model."""

import math
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from commands import call
from effect_examples import EXAMPLES, mount
from export_models import controller, finish, lugre, oscillator, symbols, van_der_pol, variable
from friction_laws import ONE_SIDED, VARIANTS
from modelica_flat import Flat, at_random, in_modelica

from pyfmi_models.card import read_card
from pyfmi_models.derivation import derivation_of
from pyfmi_models.errors import ExportError
from pyfmi_models.export.expressions import Node, Writer
from pyfmi_models.export.modelica import export_modelica, modelica_text, package_name
from pyfmi_models.model import Model

MOUNTS = (
    {f"law {key}": mount(friction=law) for key, law in VARIANTS.items()}
    | {f"one-sided {key}": mount(friction=law) for key, law in ONE_SIDED.items()}
    | {f"effect {type(effect).__name__}": mount(effect) for effect in EXAMPLES}
    | {"two of a kind": mount(*2 * [one for one in EXAMPLES if one.id == "cogging"], motion="linear")}
    | {"everything": mount(*EXAMPLES, friction=VARIANTS["lugre"])}
)


def compare(model: Model, text: str, package: str, points: int = 5) -> None:
    """The package's rates and outputs are the model's, to 1e-12 of the largest term of their kind."""
    flat = Flat(text, package)
    wanted = [f"der({in_modelica(model, state.name)})" for state in model.states]
    wanted += [in_modelica(model, output.name) for output in model.outputs]
    for seed in range(points):
        t, columns = at_random(model, seed)
        names = [one.name for group in (model.states, model.inputs, model.parameters) for one in group]
        given = dict(
            zip((in_modelica(model, name) for name in names), map(float, np.concatenate(columns)), strict=True)
        )
        found = flat.values({"time": t} | given)
        own = np.concatenate([part.full().ravel() for part in model.equations(t, *columns)])
        error = np.array([found[name] for name in wanted]) - own
        assert np.abs(error / np.maximum(1, np.abs(own))).max() < 1e-12, dict(zip(wanted, error, strict=True))


@pytest.mark.parametrize("case", MOUNTS)
def test_the_equations_of_every_law_and_effect_are_those_of_the_model(case: str) -> None:
    model = MOUNTS[case].model()
    compare(model, modelica_text(model, "Test", derivation_of(MOUNTS[case])), "Test")


def test_a_model_without_derivation_is_written_from_its_equations_alone() -> None:
    for model in (lugre(), oscillator(), van_der_pol()):
        compare(model, modelica_text(model, "Test"), "Test")


def test_names_of_the_language_and_of_others_are_evaded() -> None:
    t, x, u, p = symbols(2, 1, 2)
    states = (variable("end"), variable("part.der", nominal=2.0))
    rates = [p[0] * x[1] + t, p[1] * u - x[0]]
    model = finish("odd", [t, x, u, p], rates, [x[0] + x[1]], inputs=(variable("model"),),
                   parameters=(variable("part.end", start=2.0), variable("part.part", start=3.0)), states=states,
                   outputs=(variable("part"),))  # fmt: skip
    text = modelica_text(model, "Test")
    flat = Flat(text, "Test")
    assert {"part_output", "part.end_parameter", "part.der_state", "model_input"} <= flat.symbols.keys()
    given = {"time": 1.0, "end_state": 5.0, "part.der_state": 7.0, "model_input": 11.0}
    found = flat.values(given)
    assert found["der(end_state)"] == 2.0 * 7.0 + 1.0
    assert found["der(part.der_state)"] == 3.0 * 11.0 - 5.0


def test_the_text_reads_like_the_book() -> None:
    mount = read_card("paper_mount").plant()
    text = modelica_text(mount.model(), "PaperMount", derivation_of(mount))
    lines = [line.strip() for line in text.splitlines()]
    assert "level = Fc + (Fs - Fc)*exp(-(abs(v)/Vs + 1e-12)^delta);" in lines
    assert "contact = bristle + sigma1*(v - abs(v)*bristle/level);" in lines
    assert "axis.inertia*der(speed) = applied - disturbance - friction_output;" in lines
    assert 'parameter Real sigma1(unit = "N.m.s/rad", min = 0, nominal = 100) = 497 "Bristle damping";' in lines
    assert "LuGre friction(v = speed)" in text
    assert max(map(len, lines)) <= 120


@pytest.mark.parametrize(("value", "text"), [(math.pi, "u/pi"), (2 * math.pi, "u/(2*pi)"), (math.pi / 2, "u/(pi/2)")])
def test_a_quotient_by_a_multiple_of_pi_has_it_in_brackets(value: float, text: str) -> None:
    number = Node(ca.OP_CONST, value=value)
    u = Node(ca.OP_INPUT, place=(0, 0))
    assert Writer({u: "u"}).text(Node(ca.OP_DIV, (u, number))) == text


def test_a_modelica_compiler_finds_every_package_whole() -> None:
    rumoca = pytest.importorskip("rumoca", reason="the Modelica compiler rumoca is not installed")
    for case, plant in MOUNTS.items():
        text = modelica_text(plant.model(), "Test", derivation_of(plant))
        assert rumoca.validate_source(text) == [], case
        structure = rumoca.Session().loads(text, model="Test.Plant", filename="Test.mo").structure()
        found = (structure.is_balanced, structure.is_matched, structure.n_algebraic_loops, structure.n_states)
        assert found == (True, True, 0, len(plant.model().states)), case


def test_what_modelica_cannot_say_is_refused(tmp_path: Path) -> None:
    t, x, u, p = symbols(1, 0, 0)
    strange = finish("strange", [t, x, u, p], [ca.erf(x)], [x], states=(variable("x"),), outputs=(variable("y"),))
    with pytest.raises(ExportError, match="OP_ERF cannot be written in Modelica"):
        modelica_text(strange, "Test")
    with pytest.raises(ExportError, match='"pd" is sampled, and only continuous models'):
        modelica_text(controller(), "Test")
    with pytest.raises(ExportError, match='"2nd" is no name of a Modelica package'):
        modelica_text(lugre(), "2nd")
    (tmp_path / "There.mo").write_text("mine")
    with pytest.raises(ExportError, match=r"There\.mo exists; use force to replace it"):
        export_modelica(lugre(), tmp_path / "There.mo")
    assert (tmp_path / "There.mo").read_text() == "mine"


def test_export_writes_a_package_called_as_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert [package_name(name) for name in ("paper_mount", "my axis-2", "2nd")] == ["PaperMount", "MyAxis2", "M2nd"]
    assert call("export", "emps", "--fmi", "2", "--modelica", "--out", tmp_path) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(tmp_path / "Emps.mo")
    compare(read_card("emps").plant().model(), (tmp_path / "Emps.mo").read_text(), "Emps")
