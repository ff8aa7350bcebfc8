"""Another friction law is proposed where a row of elements rubs, and none where the base's own bristle does."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from problems import problem_of
from wandering import axis, recorded

from cosim.diagnosis.measure.law_selection import FOLDS, LEAST, proposed_law
from cosim.estimation.blocks import Blocks
from cosim.estimation.problem import Problem
from pyfmi_models.friction import Coulomb, Dahl, FrictionLaw, LuGre, MaxwellSlip

Array = npt.NDArray[np.float64]
Truth = Callable[[Array], Array]
REACH = np.geomspace(2e-3, 0.1, 6)
"""Distances over which the elements slip [rad]."""


def bristle(q: Array) -> Array:
    """Dahl's curve, solved from row to row: 1 N m over 0.01 rad."""
    out, state = np.empty_like(q), 0.0
    for row, step in enumerate(np.diff(q, prepend=q[0])):
        state = np.sign(step) + (state - np.sign(step)) * np.exp(-abs(step) / 0.01) if step else state
        out[row] = state
    return out


def row_of_elements(q: Array) -> Array:
    """Jenkin elements with equal levels, 1 N m together."""
    out, state = np.empty_like(q), np.zeros(len(REACH))
    for row, step in enumerate(np.diff(q, prepend=q[0])):
        state = np.clip(state + step / REACH, -1, 1)
        out[row] = state.mean()
    return out


def problem(friction: FrictionLaw, truth: Truth) -> Problem:
    """Two recordings of an axis that turns over and over after distances of 2e-3 to 0.3 rad."""
    rng, t = np.random.default_rng(5), np.arange(30_000) / 1000
    recordings = []
    for name, phase in (("one", 0.0), ("two", 1.0)):
        size = 0.15 * np.exp(-2.0 * (1 + np.sin(0.5 * t + phase)))
        q = size * np.sin(2 * np.pi * 0.7 * t + phase)
        a = np.gradient(np.gradient(q, t), t)
        recordings.append(recorded(5 * a + truth(q) + 0.01 * rng.standard_normal(len(t)), t, q, name))
    return problem_of(replace(axis(), friction=friction), *recordings, cutoff=15.0, slow=-1.0, sample=1e-3)


def proposed(friction: FrictionLaw, truth: Truth) -> dict[str, object]:
    this = problem(friction, truth)
    return proposed_law(this, this.fit(this.mount, 25))


LUGRE, DAHL = LuGre(sigma0=100.0, Fc=1.0, sigma1=0.1), Dahl(sigma0=100.0, Fc=1.0)


@pytest.mark.parametrize(
    ("law", "truth", "other"),
    [
        pytest.param(LUGRE, row_of_elements, "maxwell_slip", id="a row of elements is told from one bristle"),
        pytest.param(DAHL, row_of_elements, "maxwell_slip", id="also from one without damping"),
        pytest.param(MaxwellSlip(sigma0=100.0, Fc=1.0), bristle, "lugre", id="a row of elements that is none"),
    ],
)
def test_the_law_that_predicts_is_proposed(law: FrictionLaw, truth: Truth, other: str) -> None:
    found = proposed(law, truth)
    assert found["proposed"] == other
    assert LEAST < float(found["gain"]) < 1  # type: ignore[arg-type]


@pytest.mark.parametrize("law", [LUGRE, DAHL])
def test_no_law_is_proposed_where_the_own_bristle_rubs(law: FrictionLaw) -> None:
    assert proposed(law, bristle) == {"base": law.key, "proposed": law.key, "gain": 0.0, "curve": 0.0}


def test_a_law_without_memory_keeps_its_name_as_its_memory_is_an_effect() -> None:
    assert proposed(Coulomb(Fc=1.0), row_of_elements)["proposed"] == "coulomb"


@pytest.mark.parametrize("fold", [0, 3])
def test_where_one_fold_holds_all_rows_that_count_nothing_is_predicted_and_no_law_proposed(fold: int) -> None:
    """The others are fitted to no row at all."""
    this = problem(LUGRE, row_of_elements)
    only = np.zeros(len(this.weight))
    only[np.concatenate(Blocks.of(this.prepared).rows[fold::FOLDS])] = 1.0
    weighed = replace(this, weight=only)
    found = proposed_law(weighed, weighed.fit(this.mount, 10))
    assert found == {"base": "lugre", "proposed": "lugre", "gain": 0.0, "curve": 0.0}
