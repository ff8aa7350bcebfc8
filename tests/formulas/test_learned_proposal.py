"""`cosim diagnose --propose`: a formula as the file of an effect; added by a person, it gives what that gives."""

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from learned_told import TOLD
from report_example import diagnosis
from test_learned_formula import POSITION, WARM, found

import pyfmi_models
from cosim.delivery.proposal import Proposal, write_proposals
from cosim.report.terminal import proposed
from cosim.support.errors import OutputError
from cosim_formulas.effect_file import EffectFile
from cosim_formulas.forms import FADE, FORMS
from cosim_formulas.formula import Formula, Shape
from cosim_formulas.spelled import Spelled
from pyfmi_models.effects.learned import LearnedFriction, LearnedTorque, LearnedViscous
from pyfmi_models.effects.learned_drive import LearnedDrive, LearnedGain
from pyfmi_models.effects.learned_memory import LearnedAfterReversal

PACKAGE = Path(str(pyfmi_models.__file__)).parent
TESTS = Path(__file__).parents[1]
NAMED = {form.name: form for form in FORMS}
COLUMN = LearnedTorque(over="input.load", seen=(0.0, 10.0), torque=(0.0, 0.1))
TURN = LearnedFriction(over="turn", level_change=(0.0, 0.1, 0.0))
DRAG = LearnedViscous(over="acceleration", seen=(-3.0, 3.0), viscous_torque=(0.0, 0.1))
GAIN = LearnedGain(over="temperature", seen=(10.0, 25.0), more_command=(0.0, 0.1))
KICK = LearnedAfterReversal(times=(0.1, 0.4), level_change=(0.1, 0.1))
DRIVE = LearnedDrive(command_seen=(-20.0, 20.0), missing=(0.0, 0.1))
ASK = """
import json, math, sys
from pyfmi_models.card import parse_card
from pyfmi_models.effects.base import Motion
asked = json.load(open("asked.json"))
told = {}
for name, (kind, quantities) in asked.items():
    base = '[mount]\\ninertia = 2.0\\n[friction]\\nmodel = "coulomb"\\nFc = 1.0\\nsigma2 = 3.0\\n'
    card = parse_card(f'{base}[[effects]]\\neffect = "{name}"\\n', "a.toml")
    card.plant().model()
    (effect,) = card.effects
    rows = [dict(zip(quantities, row)) for row in zip(*quantities.values())]
    def state(r):
        if "time since reversal" in r:
            return [1 - 2 * math.exp(-r["time since reversal"] / effect.fade)]
        return [0.1 - 0.02 * r["acceleration"]] if "acceleration" in r else []
    motions = [Motion(0.0, r.get("position", 0.0), 0.1, r.get("turn", 0.0), r, 0.0, state(r)) for r in rows]
    says = {
        "torque": lambda m, r: effect.load(m),
        "friction": lambda m, r: effect.level(1.0, m) - 1,
        "friction after a reversal": lambda m, r: effect.level(1.0, m) - 1,
        "viscous": lambda m, r: (effect.viscous(10.0, m) - 10.0) / 0.1,
        "gain": lambda m, r: 1 / effect.given(m).applied((), 1.0) - 1,
        "drive": lambda m, r: r["command"] - effect.applied((), r["command"]),
    }
    told[name] = [float(says[kind](m, r)) for m, r in zip(motions, rows)]
print(json.dumps(told))
"""


def simple(*shapes: Shape, inner: tuple[float, ...], coefficients: tuple[float, ...], top: float) -> Formula:
    return Formula(shapes, (top,), inner, coefficients, (0.01,) * (len(inner) + len(coefficients)))


@cache
def proposals() -> tuple[Proposal, ...]:
    """A torque, a level over two quantities, a drive, a column of the user's, a turn."""
    tanh, power, sine = (Shape(NAMED[name]) for name in ("tanh", "power", "sine"))
    formulas = [
        (POSITION, found("bump")),
        (WARM, found("warm")),
        (DRIVE, simple(tanh, inner=(0.7,), coefficients=(0.4,), top=20.0)),
        (COLUMN, simple(power, Shape(None), inner=(0.6,), coefficients=(0.3, -0.1), top=10.0)),
        (TURN, simple(sine, inner=(0.2, 1.3), coefficients=(0.3,), top=3.1)),
        (DRAG, simple(Shape(NAMED["size"]), inner=(), coefficients=(2.0,), top=3.0)),
        (GAIN, simple(Shape(NAMED["line"]), inner=(), coefficients=(0.02,), top=25.0)),
        (KICK, simple(Shape(FADE), inner=(0.3,), coefficients=(0.7,), top=2.0)),
    ]
    return tuple(
        Proposal(EffectFile(Spelled(effect, formula, False)), "It was learned.") for effect, formula in formulas
    )


@pytest.fixture(scope="module")
def added(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the physics in which a person has put the files where effects are."""
    folder = tmp_path_factory.mktemp("added")
    shutil.copytree(PACKAGE, folder / PACKAGE.name, ignore=shutil.ignore_patterns("__pycache__"))
    for path in write_proposals(proposals(), folder / "proposed"):
        shutil.copy(path, folder / PACKAGE.name / "effects" / path.name)
    return folder


def run(folder: Path, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{TESTS.parent}"}
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def asked(one: Proposal) -> dict[str, list[float]]:
    """Places inside the range that was seen, by the name of the quantity."""
    rng = np.random.default_rng(3)
    edges = {"position": (-0.8, 1.0), "temperature": (10.0, 25.0), "command": (-20.0, 20.0), "turn": (-3.1, 3.1)}
    edges |= {"acceleration": (-3.0, 3.0), "time since reversal": (0.0, 2.0)}
    return {
        name.removeprefix("input."): rng.uniform(*edges.get(name, (0.0, 10.0)), 25).tolist()
        for name in one.formula.spelled.names
    }


def test_the_file_that_a_person_adds_gives_what_the_formula_gives(added: Path) -> None:
    quantities = {one.id: (one.formula.spelled.effect.kind, asked(one)) for one in proposals()}
    (added / "asked.json").write_text(json.dumps(quantities), "utf-8")
    told = json.loads(run(added, "-c", ASK))
    for one in proposals():
        expected = one.formula.spelled.formula.value([np.array(x) for x in asked(one).values()])
        np.testing.assert_allclose(told[one.id], np.maximum(expected, -1.0), atol=1e-12)


def test_the_property_tests_of_effects_hold_for_it(added: Path) -> None:
    chosen = ("-p", "no:cacheprovider", "-k", "Proposed", str(TESTS / "effects" / "test_effect_properties.py"))
    out = run(added, "-m", "pytest", *chosen)
    assert int(re.findall(r"(\d+) passed", out)[-1]) >= 4 * len(proposals())


def test_nothing_loads_it_and_none_is_written_over(tmp_path: Path) -> None:
    first = write_proposals(proposals()[:1], tmp_path / "new")
    assert [path.name for path in first] == ["proposed_torque_over_position.py"]
    with pytest.raises(OutputError, match="exists already; give --force"):
        write_proposals(proposals()[1:2], tmp_path / "new")
    assert write_proposals(proposals()[:1], tmp_path / "new", force=True) == first
    with pytest.raises(OutputError, match="where effects are loaded from"):
        write_proposals(proposals(), PACKAGE / "effects", force=True)
    assert not list((PACKAGE / "effects").glob("proposed*"))


def test_where_there_is_nothing_to_propose_one_sentence_says_why(tmp_path: Path) -> None:
    assert write_proposals((), tmp_path / "none") == ()
    assert not (tmp_path / "none").exists()
    table = replace(diagnosis("unknown"), learned=TOLD)
    for found_, reason in (
        (diagnosis("none"), "nothing is left outside the catalogue"),
        (diagnosis("unknown"), "nothing was learned outside the catalogue"),
        (table, "no formula is as good as what was learned"),
    ):
        assert proposed(found_, ()) == f"Nothing to propose: {reason}."
    assert proposed(table, [Path("a/b.py")]).startswith("Proposed, for you to review: a/b.py")


def test_a_person_reads_equation_numbers_with_ranges_and_the_range_that_was_seen() -> None:
    text = proposals()[0].text()
    for part in ("torque = k1 exp(−((q − centre)/width)²)", "Fitted; 95 % ", "SEEN_Q = (-0.8, 1.0)", "It was learned."):
        assert part in text
