"""Is anything missing at all: the largest score of the catalogue, and what a null would give."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.global_test import Scores, _groups, global_test
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given


def told(effects: list[str], folder: Path) -> dict[str, float]:
    """The test on a case of the home generator."""
    folder.mkdir()
    write_case(make_case(5101, effects, duration=20), folder)
    card, train, _ = given(str(folder))
    problem = _problem(train, card)
    base = problem.fit(problem.mount, 25)
    return global_test(Comparison.of(problem, base, POLICY), base)


def test_what_is_missing_has_a_score_that_no_null_reaches(tmp_path: Path) -> None:
    concealed, nothing = told(["cogging"], tmp_path / "cogging"), told([], tmp_path / "nothing")
    assert concealed["p"] == 1 / 200
    assert concealed["statistic"] > 3 * concealed["threshold"]
    assert nothing["statistic"] < concealed["statistic"] / 2  # friction laws that disagree are something, too


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
