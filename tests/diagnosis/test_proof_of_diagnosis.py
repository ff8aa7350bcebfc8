"""What proves a diagnosis beside its torque residual: the closed loop, a black box, the test for bias by the loop."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.delivery.closed_loop import LoopError, Loops
from cosim.diagnosis.answer.result import Trace
from cosim.diagnosis.measure.loop_bias import loop_bias
from cosim.diagnosis.measure.regression import black_box_rms
from cosim.estimation.prepare import Prepared, choose_cutoff, prepare
from cosim.estimation.problem import Problem
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.card import Card
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.mount import Mount


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Card, list[Recording], Recording, float]:
    folder = tmp_path_factory.mktemp("drag")
    made = make_case(5, ["quadratic_drag"], friction="lugre", duration=25.0)
    write_case(made, folder)
    return *given(str(folder)), float(made.truth["effects"][0]["parameters"]["coefficient"])


def fitted(card: Card, train: list[Recording], drag: float) -> tuple[Problem, Prepared]:
    prepared = prepare(train, choose_cutoff(train, card.mount.inertia))
    mount = replace(card.plant(), effects=(QuadraticDrag(coefficient=drag),))
    return Problem(mount, prepared, np.ones(len(prepared.recording_of)), 1e-3), prepared


def loop_errors(card: Card, recordings: list[Recording], **mounts: Mount) -> dict[str, LoopError]:
    with Loops(card, recordings) as loops:
        for key, mount in mounts.items():
            loops.close(key, mount)
        return loops.errors()


def test_the_true_model_follows_the_recorded_set_point_better(
    case: tuple[Card, list[Recording], Recording, float],
) -> None:
    card, train, held, drag = case
    problem, _ = fitted(card, train, drag)
    better = problem.fit(problem.mount, 25).mount
    found = loop_errors(card, [held], nominal=card.plant(), after=better)
    assert found["after"].position < 0.6 * found["nominal"].position
    assert found["after"].torque < 0.6 * found["nominal"].torque


def test_no_loop_is_closed_without_a_controller_or_a_set_point(
    case: tuple[Card, list[Recording], Recording, float],
) -> None:
    card, _, held, _ = case
    blind = replace(held, table={name: values for name, values in held.table.items() if name != "q_d"})
    assert loop_errors(card, [blind], nominal=card.plant()) == {}
    assert loop_errors(replace(card, controller=None), [held], nominal=card.plant()) == {}


def test_the_loop_does_not_bias_a_right_model_and_a_planted_bias_is_seen(
    case: tuple[Card, list[Recording], Recording, float],
) -> None:
    card, train, _, drag = case
    problem, prepared = fitted(card, train, drag)
    fit = problem.fit(problem.mount, 25)
    weight = np.ones(len(fit.residual))
    right = loop_bias(prepared, fit, weight)
    assert right["biased"] is False
    index = fit.free.index("friction.sigma2")
    noise = np.random.default_rng(1).standard_normal(len(fit.residual))
    # An error in the derivative that the residual knows too, and the set point does not: what noise does in a loop.
    slopes = fit.slopes.copy()
    size = 0.5 * slopes[:, index].std()
    slopes[:, index] += size * noise
    # Noise that is white over more rows (2.5 a cutoff, not 1.4) pushes a block's mean by less.
    push = 0.3 * abs(fit.values[index]) * size * noise
    biased = loop_bias(prepared, replace(fit, slopes=slopes, residual=fit.residual + push), weight)
    assert biased["p_value"] < 1e-3


def test_without_a_set_point_nothing_is_said_of_bias(case: tuple[Card, list[Recording], Recording, float]) -> None:
    card, train, _, drag = case
    blind = [replace(one, table={n: c for n, c in one.table.items() if n != "q_d"}) for one in train]
    problem, prepared = fitted(card, blind, drag)
    assert loop_bias(prepared, problem.fit(problem.mount, 5), np.ones(len(prepared.recording_of))) == {}


def traced(name: str, heldout: bool, seed: int, noise: float) -> Trace:
    rng, t = np.random.default_rng(seed), np.arange(0.0, 30.0, 1 / 240)
    q = np.sin(0.8 * t + seed)
    v, zero = 0.8 * np.cos(0.8 * t + seed), np.zeros_like(t)
    missing = np.sin(5 * q) + noise * rng.standard_normal(len(t))
    return Trace(
        name=name,
        heldout=heldout,
        t=t,
        q=q,
        v=v,
        tau=missing,
        before=zero,
        after=zero,
        missing=missing,
        band=zero,
    )


def test_a_black_box_learns_what_is_smooth_and_leaves_the_noise() -> None:
    learnt = black_box_rms([traced("a", False, 1, 0.1), traced("b", False, 2, 0.1), traced("c", True, 3, 0.1)])
    without = float(np.sqrt(np.mean(traced("c", True, 3, 0.1).missing ** 2)))
    assert 0.1 < learnt < 0.3 * without
