"""A closed form in the place of a learned table: the right one where there is one, none where there is none."""

import math
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from runpy import run_path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from commands import call
from learned_cases import droop, learned, parts, swerve, teeth, warm_place
from learned_told import TOLD
from report_example import diagnosis

import pyfmi_models
from cosim.delivery.proposal import Proposal, write_proposals
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.terms.learn import learn
from cosim.diagnosis.terms.partial import Partial
from cosim.estimation.blocks import Blocks
from cosim.report import terminal
from cosim.support import plugins
from cosim.support.errors import OutputError, PlugInError
from cosim_formulas.effect_file import EffectFile
from cosim_formulas.find import find
from cosim_formulas.forms import FADE, FORMS
from cosim_formulas.formula import Formula, Rows, Shape, Unseen, proposed
from cosim_formulas.spelled import Spelled
from pyfmi_models.card import read_card
from pyfmi_models.effects.base import Motion
from pyfmi_models.effects.learned import LearnedFriction, LearnedTorque, LearnedViscous
from pyfmi_models.effects.learned_drive import LearnedDrive, LearnedGain
from pyfmi_models.effects.learned_memory import LearnedAfterReversal

Array = np.ndarray
NOISE = 0.05
POSITION = LearnedTorque(over="position", seen=(-0.8, 1.0), torque=(0.0, 0.1))
WARM = LearnedFriction(
    over="position", seen=(-0.8, 1.0), by="temperature", by_seen=(10.0, 25.0), waves=(1, 1), level_change=(0.1,) * 4
)


def saw(x: Array) -> Array:
    """Of many corners at places of no order: no short formula has it."""
    corners = np.sort(np.random.default_rng(5).uniform(-0.8, 1.0, 14))
    return np.interp(x, corners, np.random.default_rng(6).uniform(-0.6, 0.6, 14))


LAWS = {
    "bump": lambda x: 0.7 * np.exp(-(((x - 0.3) / 0.12) ** 2)),
    "sine": lambda x: 0.4 * np.sin(2 * np.pi * (x - 0.1) / 0.37),
    "sine of many periods": lambda x: 0.4 * np.sin(2 * np.pi * x / 0.14),
    "exponential": lambda x: 0.2 * np.exp(x / 0.4),
    "cube": lambda x: 0.9 * x**3,
    "tanh": lambda x: 0.5 * np.tanh(x / 0.08),
    "pulse": lambda x: 2.0 * x * np.exp(-((x / 0.2) ** 2)),
    "power": lambda x: 0.6 * np.sign(x) * np.abs(x) ** 0.4,
}


def made(effect, law, seed: int, begins: float = -0.8) -> tuple[Partial, Array, Array]:
    """Rows of a term beside a base with an unknown level and slope, and the value of the law there."""
    rng, many = np.random.default_rng(seed), 4000
    x, y = begins + rng.uniform(0, 1.8, many), rng.uniform(10.0, 25.0, many)
    sign = np.sign(rng.standard_normal(many))
    two = isinstance(effect, LearnedFriction)
    unit, value = 2.0 * sign if two else np.ones(many), law(x, y) if two else law(x)
    noise = NOISE * rng.standard_normal(many)
    left = unit * value + 0.1 * sign + noise
    blocks = Blocks(tuple(np.array_split(np.arange(many), 20)), np.repeat([0, 1], 10))
    part = Partial(effect, x, y if two else None, left, unit, np.ones(many), blocks)
    return part, np.column_stack([sign, rng.standard_normal(many)]), noise


def case_of(effect, law, begins: float = -0.8) -> tuple[Partial, Rows, Unseen]:
    """A term that was learned of some rows, and others that judge what is proposed."""
    (part, slopes, _), (there, own, noise) = (made(effect, law, seed, begins) for seed in (1, 2))
    return part, Rows.of(part, slopes), Unseen(Rows.of(there, own), there.blocks, noise, there.left)


@cache
def found(name: str) -> Formula | None:
    if name == "warm":
        return proposed(*case_of(WARM, lambda x, y: 0.05 * (y - 18) * np.exp(-((x / 0.2) ** 2))))
    return proposed(*case_of(POSITION, LAWS[name]))


def forms(formula: Formula) -> set[str]:
    return {form.name for shape in formula.shapes for _, form in shape.parts}


@pytest.mark.parametrize("name", LAWS)
def test_the_right_form_is_found_with_its_numbers_in_their_ranges(name: str) -> None:
    formula = found(name)
    assert name.split()[0] in forms(formula)
    x = np.linspace(-0.75, 0.95, 200)
    told, true = formula.value([x]), LAWS[name](x)
    np.testing.assert_allclose(told - told.mean(), true - true.mean(), atol=0.03)


def test_a_product_that_begins_anywhere_is_read_as_one_of_lines() -> None:
    """0.05 (y - 18) (x - 0.3), which three coefficients hold and no product of two forms does."""
    formula = proposed(*case_of(WARM, lambda x, y: 0.05 * (y - 18) * (x - 0.3)))
    assert forms(formula) == {"line"}
    k1, k2, k3 = formula.coefficients  # of x, x y, y
    assert (-k1 / k2, -k3 / k2, k2) == pytest.approx((18.0, 0.3, 0.05), rel=0.05)


def test_what_fades_after_a_reversal_has_its_time() -> None:
    """0.7 exp(-t / 0.3 s): the memory's own form, whatever else would fit as well."""
    fading = LearnedAfterReversal(times=(0.1, 0.4), level_change=(0.1, 0.1))
    formula = proposed(*case_of(fading, lambda x: 0.7 * np.exp(-x / 0.3), begins=0.0))
    said = Spelled(fading, formula, False).as_json()
    assert said["equation"] == "friction × (1 + f), f = k1 exp(−t/fade)"
    assert said["parameters"]["fade"]["value"] == pytest.approx(0.3, rel=0.1)
    assert [said["parameters"][name]["unit"] for name in ("fade", "k1")] == ["s", "1"]


def test_where_no_form_fits_there_is_no_formula_nor_where_a_loss_of_all_torque_leaves_no_error() -> None:
    """What is linear in the command and taken out of the base again leaves no error, and says nothing."""
    part, train, unseen = case_of(POSITION, saw)
    assert proposed(part, train, unseen) is None
    much = 100.0 * float(np.std(unseen.rows.left))
    line = Formula((Shape(FORMS[0]),), (1.0,), (), (much,))
    assert not unseen.is_of_its_size(line)
    assert unseen.is_of_its_size(replace(line, coefficients=(0.01 * much,)))


def test_numbers_have_intervals_that_hold_them_and_units_that_fit() -> None:
    said = Spelled(POSITION, found("bump"), False).as_json()
    assert said["equation"] == "torque = k1 exp(−((q − centre)/width)²)"
    for name, true, unit in (("centre", 0.3, "rad"), ("width", 0.12, "rad"), ("k1", 0.7, "N.m")):
        told = said["parameters"][name]
        low, high = told["interval"]
        assert low - 0.02 < true < high + 0.02
        assert high - low < 0.1
        assert told["unit"] == unit
    assert Spelled(POSITION, found("cube"), True).as_json()["parameters"]["k1"]["unit"] == "N/m3"
    line, cube = (Formula((Shape(one),), (1.0,)) for one in FORMS if one.name in ("line", "cube"))
    assert line.length < cube.length, "of two forms of one number the lower power is the shorter"


# The formula that a diagnosis tells beside its table; without the package that searches it tells all else.


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch):
    """Say which entry points there are, by name."""

    def say(points: dict[str, object]) -> None:
        monkeypatch.setattr(plugins, "_points", lambda group: points if group == "cosim.formulas" else {})
        plugins.names.cache_clear()
        plugins.loaded.cache_clear()

    yield say
    monkeypatch.undo()
    plugins.names.cache_clear()
    plugins.loaded.cache_clear()


def test_the_formula_of_what_was_missing_is_proposed_for_its_table_by_the_names_of_its_quantities() -> None:
    """0.15 (T - 20) exp(-(q / 0.15)^2) N m beside 2 N m of friction."""
    whole = learned(warm_place)
    (said,), ((form, statement),) = whole.as_json()["formula"], whole.stated()
    numbers = {name: one["value"] for name, one in said["parameters"].items()}
    assert said["over"] == ["position", "temperature"]
    assert "exp(−((q − centre)/width)²)" in said["equation"]
    assert numbers["width"] == pytest.approx(0.15, rel=0.1)
    assert -numbers["k1"] / numbers["k2"] == pytest.approx(20.0, abs=0.5)
    assert numbers["k2"] == pytest.approx(0.075, rel=0.08)
    proposal = Proposal(form, statement)
    assert proposal.id == "proposed_friction_over_position_and_temperature"
    assert form.as_json()["equation"] in proposal.text()
    assert statement in proposal.text()


def test_a_formula_is_told_in_its_own_words() -> None:
    (drag,), (gain,) = (learned(extra).as_json()["formula"] for extra in (swerve, teeth))
    assert drag["equation"].startswith("added drag = v f, f = k1 |a|")
    assert drag["parameters"]["k1"]["value"] == pytest.approx(6.0, rel=0.05)
    assert gain["equation"].startswith("command × (1 + f), f = k1 sin(2π(q")
    # Over the recorded command a line would say all that a drive holds back: a line is a scale of the base.
    assert all(one["equation"] != "not given = k1 u" for one in learned(droop).as_json()["formula"])


def test_the_search_is_found_by_its_entry_point_and_without_one_all_is_said_but_the_formula(installed) -> None:
    assert [plugins.loaded("cosim.formulas", name) for name in plugins.names("cosim.formulas")] == [find]
    installed({})
    left = learn(*parts(warm_place))
    assert left.as_json() == {**learned(warm_place).as_json(), "formula": []}
    assert left.stated() == ()


def test_to_propose_without_a_search_or_with_one_that_cannot_be_loaded_is_refused_at_once(installed, tmp_path, capsys):
    installed({})
    run = tmp_path / "run.csv"
    run.write_text("t,q,tau\n0,0,0\n", "utf-8")
    assert call("diagnose", run, run, "--propose", tmp_path / "drafts") == 2
    assert "--propose: no installed package searches for formulas" in capsys.readouterr().err
    assert not (tmp_path / "drafts").exists()
    load = Mock(side_effect=ImportError("no module named my_search"))
    installed({"mine": SimpleNamespace(name="mine", value="my_search:find", dist=None, load=load)})
    with pytest.raises(PlugInError, match='"mine" of my_search:find cannot be loaded: ImportError'):
        diagnose([], [], read_card("paper_mount"))


# A formula as the file of an effect; added by a person, it gives what that gives.


PACKAGE = Path(str(pyfmi_models.__file__)).parent
TESTS = Path(__file__).parents[1]
NAMED = {form.name: form for form in FORMS}
COLUMN = LearnedTorque(over="input.load", seen=(0.0, 10.0), torque=(0.0, 0.1))
TURN = LearnedFriction(over="turn", level_change=(0.0, 0.1, 0.0))
DRAG = LearnedViscous(over="acceleration", seen=(-3.0, 3.0), viscous_torque=(0.0, 0.1))
GAIN = LearnedGain(over="temperature", seen=(10.0, 25.0), more_command=(0.0, 0.1))
KICK = LearnedAfterReversal(times=(0.1, 0.4), level_change=(0.1, 0.1))
DRIVE = LearnedDrive(command_seen=(-20.0, 20.0), missing=(0.0, 0.1))
SEEN = {"position": (-0.8, 1.0), "temperature": (10.0, 25.0), "command": (-20.0, 20.0), "turn": (-3.1, 3.1)}
SEEN |= {"acceleration": (-3.0, 3.0), "time since reversal": (0.0, 2.0)}
SAYS = {
    "torque": lambda effect, m: effect.load(m),
    "friction": lambda effect, m: effect.level(1.0, m) - 1,
    "friction after a reversal": lambda effect, m: effect.level(1.0, m) - 1,
    "viscous": lambda effect, m: (effect.viscous(10.0, m) - 10.0) / 0.1,
    "gain": lambda effect, m: 1 / effect.given(m).applied((), 1.0) - 1,
    "drive": lambda effect, m: m.inputs["command"] - effect.applied((), m.inputs["command"]),
}
"""What an effect of each kind makes of a motion at 0.1 rad/s, as its formula has it."""


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


def moved(row: dict[str, float], fade: float) -> Motion:
    """The motion in which the quantities of an effect have these values, with the states that it carries there."""
    states = [0.1 - 0.02 * row["acceleration"]] if "acceleration" in row else []
    if "time since reversal" in row:
        states = [1 - 2 * math.exp(-row["time since reversal"] / fade)]
    return Motion(0.0, row.get("position", 0.0), 0.1, row.get("turn", 0.0), row, 0.0, states)


@pytest.mark.parametrize("number", range(8))
def test_the_file_that_a_person_adds_gives_what_the_formula_gives(number: int, tmp_path: Path) -> None:
    """At places inside the range that was seen."""
    one, rng = proposals()[number], np.random.default_rng(3)
    spelled = one.formula.spelled
    names = [name.removeprefix("input.") for name in spelled.names]
    places = [rng.uniform(*SEEN.get(name, (0.0, 10.0)), 25) for name in names]
    (path,) = write_proposals([one], tmp_path)
    (form,) = (given for name, given in run_path(str(path)).items() if name.startswith("Proposed"))
    effect = form()
    motions = [
        moved(dict(zip(names, row, strict=True)), getattr(effect, "fade", 1.0)) for row in zip(*places, strict=True)
    ]
    told = [float(SAYS[spelled.effect.kind](effect, motion)) for motion in motions]
    np.testing.assert_allclose(told, np.maximum(spelled.formula.value(places), -1.0), atol=1e-12)


def test_the_property_tests_of_effects_hold_for_the_files_where_a_person_has_put_them(tmp_path: Path) -> None:
    shutil.copytree(PACKAGE, tmp_path / PACKAGE.name, ignore=shutil.ignore_patterns("__pycache__"))
    for path in write_proposals(proposals(), tmp_path / "proposed"):
        shutil.copy(path, tmp_path / PACKAGE.name / "effects" / path.name)
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{TESTS.parent}"}
    tests = str(TESTS / "effects" / "test_effect_properties.py")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-k", "Proposed", tests]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(re.findall(r"(\d+) passed", done.stdout)[-1]) >= 4 * len(proposals())


def test_a_person_reads_all_of_it_nothing_loads_it_and_none_is_written_over(tmp_path: Path) -> None:
    text = proposals()[0].text()
    for part in ("torque = k1 exp(−((q − centre)/width)²)", "Fitted; 95 % ", "SEEN_Q = (-0.8, 1.0)", "It was learned."):
        assert part in text
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
        assert terminal.proposed(found_, ()) == f"Nothing to propose: {reason}."
    assert terminal.proposed(table, [Path("a/b.py")]).startswith("Proposed, for you to review: a/b.py")
