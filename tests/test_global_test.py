"""Is anything missing at all: the largest score of the catalogue, and what a null would give."""

from dataclasses import dataclass

import numpy as np
import pytest

from cosim.diagnosis.comparison import Comparison
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.global_test import Scores, _groups, global_test
from cosim.diagnosis.policy import POLICY
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given


@pytest.mark.parametrize(("effects", "seen"), [(["cogging"], True), ([], False)])
def test_what_is_missing_has_a_score_that_no_null_reaches(effects: list[str], seen: bool, tmp_path) -> None:
    case = make_case(5101, effects, duration=20)
    write_case(case, tmp_path)
    card, train, _ = given(str(tmp_path))
    problem = _problem(train, card)
    base = problem.fit(problem.mount, 25)
    told = global_test(Comparison.of(problem, base, POLICY), base)
    assert 0 < told.p <= 1
    if seen:
        assert told.statistic > 3 * told.threshold
        assert told.p == 1 / 200
    else:
        assert told.statistic < 3 * told.threshold


@dataclass(frozen=True)
class Column:
    """As much of a candidate as its score asks for."""

    instances: tuple[object, ...] = (object(),)
    finite: bool = False


@pytest.mark.filterwarnings("error")
def test_columns_that_are_nothing_or_known_already_score_nothing() -> None:
    """What the base explains leaves rounding, of either sign; a column of zeros has a prior without end."""
    columns = [np.zeros((50, 1)), np.full((50, 2), 1e-3)]
    scores = object.__new__(Scores)
    scores._tests = np.column_stack([np.zeros(50), np.full(50, 1e-19), -np.full(50, 1e-19)])
    scores._gram = np.array([[0, 0, 0], [0, -1e-17, -1e-17], [0, -1e-17, -1e-17]])
    scores._groups = list(_groups([Column(), Column()], columns, 1.0))
    assert np.abs(scores.of(np.ones((50, 3)))).max() < 1
