"""A structure from which an effect was taken is fitted once, whoever asks for it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.estimation import problem as problems
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import AT_HAND, Problem
from cosim.estimation.row_weights import weights
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.effects import TorqueOffset


@pytest.fixture
def problem(tmp_path: Path) -> Problem:
    write_case(make_case(5000, (), duration=15.0), tmp_path)
    card, train, _ = given(str(tmp_path))
    prepared = prepare(train, 20.0)
    return Problem(card.plant(), prepared, weights(card.friction, prepared), train[0].sample_time)


def test_what_is_left_without_an_effect_is_fitted_once(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    fit = problems.fit
    monkeypatch.setattr(problems, "fit", lambda *args, **more: made.append(1) or fit(*args, **more))
    whole = problem.fit(replace(problem.mount, effects=(*problem.mount.effects, TorqueOffset(torque=0.01))), 20)
    first = problem.without(whole, "torque_offset")
    assert problem.without(whole, "torque_offset") is first
    assert len(made) == 2
    assert first.mount.effects == problem.mount.effects


def test_another_weight_or_number_of_evaluations_is_another_fit(problem: Problem) -> None:
    found = problem.fit(problem.mount, 20)
    assert problem.fit(problem.mount, 20) is found
    assert problem.fit(problem.mount, 21) is not found
    half = replace(problem, weight=problem.weight * (problem.prepared.recording_of == 0))
    assert half.fit(problem.mount, 20) is not found


def test_fits_that_nobody_holds_take_no_memory(problem: Problem) -> None:
    kept: list[Fit] = [problem.fit(problem.mount, many) for many in range(1, 4)]
    assert len(problem._fits) == len(kept)
    kept.clear()
    for many in range(AT_HAND + 2):
        offset = TorqueOffset(torque=0.01 * (1 + many))
        found = problem.fit(replace(problem.mount, effects=(*problem.mount.effects, offset)), 1)
        problem.without(found, "torque_offset")
        del found
    assert len(problem._fits) <= AT_HAND
    assert np.isfinite(problem._last[0].residual).all()
