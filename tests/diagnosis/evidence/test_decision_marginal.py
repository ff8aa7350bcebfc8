"""The marginal likelihood of a structure, against the dense Gaussian density that it stands for."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from wandering import axis, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.discrepancy import WAVES, Discrepancy, discrepancy
from cosim.diagnosis.evidence.marginal import Group, Marginal, marginal
from cosim.diagnosis.evidence.structure import Structure
from cosim.estimation.prepare import Prepared, prepare

Array = npt.NDArray[np.float64]
DICE = np.random.default_rng(18)
FREE = np.array([2.0, 0.5, 9.0, 9.0])
"""Prior standard deviations; those of the last two columns are of a group, so that they do not count."""
START = Marginal(0.0, np.array([0.3, 2.0]), np.array([0.7]), np.zeros(4))


def bands(noise: Array, *rows: int) -> list[tuple[Array, Array]]:
    """Targets and columns of each band, drawn from the model."""
    beta = np.array([1.0, -0.4, *0.4 * DICE.standard_normal(2)])
    drawn = []
    for many, variance in zip(rows, noise, strict=True):
        x = DICE.standard_normal((many, 4))
        drawn.append((x @ beta + np.sqrt(variance) * DICE.standard_normal(many), x))
    return drawn


def found(drawn: list[tuple[Array, Array]], free: Array = FREE, floor: float = 0.0, **more: Any) -> Marginal:
    grams = np.array([np.column_stack([y, x]).T @ np.column_stack([y, x]) for y, x in drawn])
    count = np.array([float(len(y)) for y, _ in drawn])
    return marginal(grams, free, (Group([2, 3], 0.5),), count, count, np.full(len(drawn), floor), **more)


def test_noise_and_sizes_that_are_renewed_explain_the_data_better_and_come_near_the_truth() -> None:
    true = np.array([0.25, 4.0])
    drawn = bands(true, 4000, 4000)
    likelihoods = [found(drawn, rounds=rounds).log_likelihood for rounds in (0, 1, 2, 6)]
    assert likelihoods == sorted(likelihoods)
    assert likelihoods[0] < likelihoods[1]
    assert found(drawn).noise == pytest.approx(true, rel=0.1)
    assert found(drawn, floor=5.0).noise == pytest.approx([5.0, 5.0])


def test_renewed_noise_is_the_mean_square_left_with_the_uncertainty_of_the_fit() -> None:
    drawn = bands(START.noise, 40, 70)
    begun, renewed = (found(drawn, start=START, rounds=rounds) for rounds in (0, 1))
    prior = np.diag(1 / np.array([2.0, 0.5, 0.7, 0.7]) ** 2)
    normal = sum((x.T @ x / variance for (_, x), variance in zip(drawn, START.noise, strict=True)), prior)
    covariance = np.linalg.inv(normal)
    expected = [
        (float(np.sum((y - x @ begun.beta) ** 2)) + float(np.trace(covariance @ x.T @ x))) / len(y) for y, x in drawn
    ]
    assert renewed.noise == pytest.approx(expected, rel=1e-9)
    mean = float(np.mean(begun.beta[2:] ** 2 + np.diag(covariance)[2:]))
    size = renewed.sizes[0]
    assert size**2 / mean + size**4 / (2 * mean * 0.5**2) == pytest.approx(1.0, rel=1e-9), "the slope is zero there"


def test_priors_without_bound_are_numbers_all_the_same() -> None:
    told = found(bands(START.noise, 40, 70), np.array([1e300, 1e-300, 1.0, 1.0]))
    assert np.isfinite(told.log_likelihood)
    assert abs(told.beta[1]) < 1e-12


def dense(
    grams: Array, free: Array, group: Group, size: float, count: Array, effective: Array, floor: Array
) -> tuple[float, Array, Array]:
    """`marginal` without its rounds: noise and sizes as they begin, by inverses and determinants."""
    noise = np.maximum(grams[:, 0, 0] / count, floor)
    variance = np.square(free)
    variance[group.columns] = max(size, 1e-6 * group.prior) ** 2
    weight = effective / count / noise
    normal = np.tensordot(weight, grams[:, 1:, 1:], 1) + np.diag(1 / variance)
    target = weight @ grams[:, 1:, 0]
    beta = np.linalg.solve(normal, target)
    energy = weight @ grams[:, 0, 0] - target @ beta
    penalty = (size / group.prior) ** 2 / 2
    sizes = np.linalg.slogdet(normal)[1] + np.log(variance).sum()
    return -(effective @ np.log(noise) + energy + sizes) / 2 - penalty, noise, beta


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("relative", [1.0, 0.01, 1e-4, 1e-9])
def test_a_marginal_likelihood_without_rounds_is_the_gaussian_integral(
    compiled: bool, relative: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From sizes that are given too, down to a millionth of the prior, where a size counts as that."""
    rng = np.random.default_rng(1)
    bands = [rng.normal(0, 1, (50, 5)) for _ in range(2)]
    grams = np.array([one.T @ one for one in bands])
    count, effective, floor = np.array([50.0, 50.0]), np.array([50.0, 11.0]), np.array([1e-9, 2.0])
    free, group = np.array([3.0, 0.5, 1.0, 1.0]), Group(np.array([2, 3]), 0.7)
    if not compiled:
        monkeypatch.setattr("cosim.diagnosis.evidence.marginal.library", lambda: None)
    expected, noise, beta = dense(grams, free.copy(), group, size := relative * 0.7, count, effective, floor)
    start = None if relative == 1.0 else Marginal(0.0, noise, np.array([size]), beta)
    found = marginal(grams, free.copy(), [group], count, effective, floor, start, rounds=0)
    assert found.log_likelihood == pytest.approx(expected, rel=1e-8)
    np.testing.assert_allclose(found.noise, noise)
    np.testing.assert_allclose(found.beta, beta, rtol=1e-7, atol=1e-14)
    np.testing.assert_allclose(found.sizes, [size])


# Nuisances of a comparison: how many there are, and that holes in time do not make more of them.


def holed(name: str, holes: tuple[float, ...] = ()) -> Recording:
    """A minute of motion at 200 Hz, half a second left out at each of `holes` [s]."""
    t = np.arange(12_000) / 200
    t = t[[not any(hole <= one < hole + 0.5 for hole in holes) for one in t]]
    q, v, a = swing(t, [(0.3, 0.9, 0.0)], per=1)
    return recorded(2 * np.sign(v) + v + 5 * a, t, q, name)


def made(*recordings: Recording) -> tuple[Prepared, Discrepancy]:
    prepared = prepare(recordings, 10.0)
    return prepared, discrepancy(axis(), prepared, POLICY)


def test_a_level_is_one_before_a_hole_and_after_it() -> None:
    whole, cut = (made(holed("a", holes)) for holes in ((), (20.0, 40.0)))
    rows = [
        np.flatnonzero(np.isin(np.round(w.stacked("t"), 6), np.round(o.stacked("t"), 6)))
        for w, o in ((whole[0], cut[0]), (cut[0], whole[0]))
    ]
    columns = [one.columns[:, one.groups[-1].columns] for _, one in (whole, cut)]
    smooth = np.abs(whole[0].stacked("v")[rows[0]]) > 0.1  # filters remember the ends of a piece where friction turns
    assert columns[0][rows[0]][smooth] == pytest.approx(columns[1][rows[1]][smooth], abs=0.05)
    assert np.abs(columns[0]).max() > 1


def test_a_recording_has_no_share_in_the_wander_of_another() -> None:
    prepared, found = made(holed("a"), holed("b", (30.0,)))
    wander = found.columns[:, found.groups[-1].columns]
    assert not wander[prepared.recording_of == 1, :WAVES].any()
    assert not wander[prepared.recording_of == 0, WAVES:].any()


# How far training leaves the numbers of a structure open.


def test_changes_of_one_standard_error_make_up_the_covariance() -> None:
    spread = np.array([[4.0, 1.0], [1.0, 9.0]])
    found = Structure(axis(), ("a", "b"), np.zeros(2), spread).directions((0, 1))
    np.testing.assert_allclose(found @ found.T, spread, rtol=1e-12)


def test_a_number_of_which_training_says_nothing_leaves_the_others_as_they_are() -> None:
    """A rough spot that a fit had sent away, to 3e77, ended a diagnosis: its variance is no number."""
    spread = np.array([[4.0, np.nan, 0.0], [np.nan, np.inf, np.nan], [0.0, np.nan, 1e308]])
    found = Structure(axis(), ("a", "b", "c"), np.zeros(3), spread).directions((0, 1, 2))
    assert np.isfinite(found).all()
    np.testing.assert_allclose((found @ found.T)[0, 0], 4.0)
