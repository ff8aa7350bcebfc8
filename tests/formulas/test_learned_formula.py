"""A closed form in the place of a learned table: the right one where there is one, none where there is none."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from cosim.diagnosis.terms.partial import Partial
from cosim.estimation.blocks import Blocks
from cosim_formulas.forms import FORMS
from cosim_formulas.formula import Formula, Rows, Shape, Unseen, proposed
from cosim_formulas.spelled import Spelled
from pyfmi_models.effects.learned import LearnedFriction, LearnedTorque
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
    "exponential": lambda x: 0.2 * np.exp(x / 0.4),
    "cube": lambda x: 0.9 * x**3,
    "tanh": lambda x: 0.5 * np.tanh(x / 0.08),
    "pulse": lambda x: 2.0 * x * np.exp(-((x / 0.2) ** 2)),
    "power": lambda x: 0.6 * np.sign(x) * np.abs(x) ** 0.4,
}


@dataclass(frozen=True, eq=False)
class Case:
    part: Partial
    train: Rows
    unseen: Unseen


def blocks(many: int) -> Blocks:
    return Blocks(tuple(np.array_split(np.arange(many), 20)), np.repeat([0, 1], 10))


def made(effect, law, seed: int, begins: float = -0.8) -> tuple[Partial, Array, Array]:
    """Rows of a term beside a base with an unknown level and slope, and the value of the law there."""
    rng, many = np.random.default_rng(seed), 4000
    x, y = begins + rng.uniform(0, 1.8, many), rng.uniform(10.0, 25.0, many)
    sign = np.sign(rng.standard_normal(many))
    two = isinstance(effect, LearnedFriction)
    unit, value = 2.0 * sign if two else np.ones(many), law(x, y) if two else law(x)
    noise = NOISE * rng.standard_normal(many)
    left = unit * value + 0.1 * sign + noise
    part = Partial(effect, x, y if two else None, left, unit, np.ones(many), blocks(many))
    return part, np.column_stack([sign, rng.standard_normal(many)]), noise


def case_of(effect, law, begins: float = -0.8) -> Case:
    """A term that was learned of some rows, and others that judge what is proposed."""
    (part, slopes, _), (there, own, noise) = (made(effect, law, seed, begins) for seed in (1, 2))
    return Case(part, Rows.of(part, slopes), Unseen(Rows.of(there, own), there.blocks, noise, there.left))


@cache
def case(name: str) -> Case:
    if name == "warm":
        return case_of(WARM, lambda x, y: 0.05 * (y - 18) * np.exp(-((x / 0.2) ** 2)))
    return case_of(POSITION, saw if name == "saw" else LAWS[name])


def formula_of(now: Case) -> Formula | None:
    return proposed(now.part, now.train, now.unseen)


@cache
def found(name: str) -> Formula | None:
    return formula_of(case(name))


def forms(formula: Formula) -> set[str]:
    return {form.name for shape in formula.shapes for _, form in shape.parts}


@pytest.mark.parametrize("name", LAWS)
def test_the_right_form_is_found_with_its_numbers_in_their_ranges(name: str) -> None:
    formula = found(name)
    assert formula is not None
    assert name in forms(formula)
    x = np.linspace(-0.75, 0.95, 200)
    np.testing.assert_allclose(
        formula.value([x]) - formula.value([x]).mean(), LAWS[name](x) - LAWS[name](x).mean(), atol=0.03
    )


def test_a_product_of_two_quantities_has_both_and_where_the_line_begins() -> None:
    formula = found("warm")
    assert formula is not None
    assert forms(formula) == {"bump", "line"}
    told = {name: (value, error) for name, value, error, _ in Spelled(WARM, formula, False).numbers()}
    assert abs(told["centre"][0]) < 4 * told["centre"][1]
    assert abs(told["width"][0] - 0.2) < 4 * told["width"][1]
    assert -told["k1"][0] / told["k2"][0] == pytest.approx(18.0, abs=0.3)


def test_a_product_that_begins_anywhere_is_read_as_one_of_lines() -> None:
    """0.05 (y - 18) (x - 0.3), which three coefficients hold and no product of two forms does."""
    formula = formula_of(case_of(WARM, lambda x, y: 0.05 * (y - 18) * (x - 0.3)))
    assert formula is not None
    assert forms(formula) == {"line"}
    k1, k2, k3 = formula.coefficients  # of x, x y, y
    assert (-k1 / k2, -k3 / k2, k2) == pytest.approx((18.0, 0.3, 0.05), rel=0.05)


def test_a_sine_of_many_periods_is_found() -> None:
    formula = formula_of(case_of(POSITION, lambda x: 0.4 * np.sin(2 * np.pi * x / 0.14)))
    assert formula is not None
    assert formula.inner[1] == pytest.approx(0.14, rel=0.01)


def test_what_fades_after_a_reversal_has_its_time() -> None:
    """0.7 exp(-t / 0.3 s): the memory's own form, whatever else would fit as well."""
    fading = LearnedAfterReversal(times=(0.1, 0.4), level_change=(0.1, 0.1))
    formula = formula_of(case_of(fading, lambda x: 0.7 * np.exp(-x / 0.3), begins=0.0))
    assert formula is not None
    said = Spelled(fading, formula, False).as_json()
    assert said["equation"] == "friction × (1 + f), f = k1 exp(−t/fade)"
    assert said["parameters"]["fade"]["value"] == pytest.approx(0.3, rel=0.1)
    assert [said["parameters"][name]["unit"] for name in ("fade", "k1")] == ["s", "1"]


def test_of_two_forms_of_one_number_the_lower_power_is_the_shorter() -> None:
    line, cube = (Formula((Shape(one),), (1.0,)) for one in FORMS if one.name in ("line", "cube"))
    assert line.length < cube.length


def test_where_no_form_fits_there_is_no_formula() -> None:
    assert found("saw") is None


def test_numbers_have_intervals_that_hold_them_and_units_that_fit() -> None:
    said = Spelled(POSITION, found("bump"), False).as_json()
    assert said["equation"] == "torque = k1 exp(−((q − centre)/width)²)"
    for name, true, unit in (("centre", 0.3, "rad"), ("width", 0.12, "rad"), ("k1", 0.7, "N.m")):
        told = said["parameters"][name]
        low, high = told["interval"]
        assert low - 0.02 < true < high + 0.02
        assert high - low < 0.1
        assert told["unit"] == unit
    cubed = Spelled(POSITION, found("cube"), True).as_json()
    assert cubed["parameters"]["k1"]["unit"] == "N/m3"


def test_a_loss_of_all_torque_in_a_machine_that_needs_none_is_no_formula() -> None:
    """What is linear in the command and taken out of the base again leaves no error, and says nothing."""
    now = case("saw")
    much = 100.0 * float(np.std(now.unseen.rows.left))
    line = Formula((Shape(FORMS[0]),), (1.0,), (), (much,))
    assert not now.unseen.is_of_its_size(line)
    assert now.unseen.is_of_its_size(replace(line, coefficients=(0.01 * much,)))
