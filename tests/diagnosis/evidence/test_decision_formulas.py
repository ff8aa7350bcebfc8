"""Sums of the decision, written again as loops: random rows of several recordings, weights that are zero among them."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim.diagnosis.evidence import adequacy
from cosim.diagnosis.evidence.adequacy import _hats, _lasting, _rms, _slow, _unexplained
from cosim.diagnosis.evidence.marginal import Group, Marginal, _size, marginal
from cosim.diagnosis.search.admissibility import _way_back
from cosim.estimation.residuals import away_from_turns, removed_at_rest

Array = npt.NDArray[np.float64]
CELL, RATE = 0.25, 40
"""Seconds of a cell, rows in a second."""


def prepared(*seconds: float, begin: float = 0.0) -> Any:
    """Recordings one after the other; the clock of each begins at `begin`."""
    pieces = [SimpleNamespace(t=begin + np.arange(round(one * RATE)) / RATE) for one in seconds]
    for piece in pieces:
        piece.kept = np.arange(len(piece.t))
    return SimpleNamespace(pieces=pieces, stacked=lambda _: np.concatenate([piece.t for piece in pieces]))


def celled(given: Any) -> list[tuple[int, int, int]]:
    """Recording, cell and half of each row."""
    rows = [(number, float(t)) for number, piece in enumerate(given.pieces) for t in piece.t]
    return [(number, math.floor(t / CELL), int(t / CELL % 1 >= 0.5)) for number, t in rows]


@pytest.mark.parametrize("seed", range(4))
def test_what_is_slow_and_what_lasts_are_means_over_cells_and_their_halves(seed: int) -> None:
    rng, given = np.random.default_rng(seed), prepared(2.1, 1.4)
    expected = celled(given)
    values, weight = rng.normal(0.4, 1, len(expected)), rng.choice([0.0, 0.5, 2.0], len(expected))
    weight[:10] = 0.0  # a cell that nothing counts of
    energy = total = common = shared = 0.0
    for cell in {one[:2] for one in expected}:
        rows = [[k for k, one in enumerate(expected) if one == (*cell, half)] for half in (0, 1)]
        sums = [sum(weight[k] for k in part) for part in rows]
        means = [sum(weight[k] * values[k] for k in part) / s if s else 0.0 for part, s in zip(rows, sums, strict=True)]
        if sum(sums):
            energy += (sums[0] * means[0] + sums[1] * means[1]) ** 2 / sum(sums)
            total += sum(sums)
        if all(sums):
            common += sum(sums) * means[0] * means[1]
            shared += sum(sums)
    assert _slow(values, weight, given) == pytest.approx(math.sqrt(energy / total), rel=1e-12)
    assert _lasting(values, weight, given) == pytest.approx(math.sqrt(max(0.0, common / shared)), rel=1e-12)
    assert _rms(values, weight) == pytest.approx(math.sqrt(sum(weight * values**2) / sum(weight)), rel=1e-12)


def test_the_lightest_weight_still_counts() -> None:
    """What all rows weigh makes no difference, however little that is."""
    given, values = prepared(1.0), np.random.default_rng(1).normal(1, 1, RATE)
    for size in (_slow, _lasting):
        assert size(values, np.full(RATE, 1e-9), given) == pytest.approx(size(values, np.ones(RATE), given), rel=1e-9)
    assert _rms(values, np.full(RATE, 1e-9)) == pytest.approx(_rms(values, np.ones(RATE)), rel=1e-9)


def test_beside_columns_is_what_weighted_least_squares_leave() -> None:
    rng = np.random.default_rng(3)
    residual, columns, weight = rng.normal(0, 1, 60), rng.normal(0, 1, (60, 3)), rng.choice([0.0, 1.0, 4.0], 60)
    root = np.sqrt(weight)
    fitted = np.linalg.lstsq(root[:, None] * columns, root * residual, rcond=None)[0]
    expected = np.where(weight > 0, residual - columns @ fitted, 0.0)
    np.testing.assert_allclose(_unexplained(residual, weight, columns), expected, atol=1e-9)


@pytest.mark.parametrize("seconds", [0.0, 0.5, 1.4, 4.0, 7.6])
def test_hats_are_straight_lines_between_knots_a_second_apart(seconds: float) -> None:
    t = 20 + np.linspace(0, seconds, 1 if seconds == 0 else 77)
    hats = _hats(t)
    count = max(2, round(seconds))
    assert hats.shape == (len(t), count + 1)
    np.testing.assert_allclose(hats.sum(axis=1), 1.0, atol=1e-12)
    knots = 20 + np.linspace(0, seconds, count + 1)
    if seconds:
        np.testing.assert_allclose(hats @ knots, t, atol=1e-9)
        bent = np.random.default_rng(5).normal(0, 1, count + 1)
        np.testing.assert_allclose(hats @ bent, np.interp(t, knots, bent), atol=1e-9)
    assert adequacy.KNOT == 1.0
    assert _hats(np.array([3.0, 10.2])).shape == (2, 8), "two rows that are far apart"


@pytest.mark.parametrize(
    ("q", "back"),
    [([0.0, 1.0, 2.0], 0.0), ([0.0, 2.0, 1.5, 3.0], 0.5), ([0.0, -2.0, -1.0, -4.0], 1.0), ([1.0, 0.0, 3.0, 1.0], 2.0)],
)
def test_the_way_back_is_the_longest_against_the_way_that_a_motion_goes(q: list[float], back: float) -> None:
    assert _way_back(np.array(q)) == back
    assert _way_back(-np.array(q)) == back


@pytest.mark.parametrize("rows", [9, 10])
def test_at_rest_counts_from_ten_rows_on_and_only_where_the_law_says_nothing(rows: int) -> None:
    weight = np.concatenate([np.ones(30), np.zeros(rows)])
    left, without = np.full(30 + rows, 0.5), np.full(30 + rows, 2.0)
    assert removed_at_rest(weight, left, without) == (1 - 0.25 / 4 if rows == 10 else 1.0)
    assert removed_at_rest(weight, without, left) == (1 - 4 / 0.25 if rows == 10 else 1.0)


@pytest.mark.parametrize(("removed", "told"), [(0.019, False), (0.021, True)])
def test_where_a_fiftieth_of_the_energy_goes_it_is_asked_where(
    removed: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a hundred rows the last half are about turns; all is removed there."""
    far = np.repeat([1.0, 0.0], 50)
    monkeypatch.setattr("cosim.estimation.residuals.far_from_turns", lambda _: far)
    problem: Any = SimpleNamespace(prepared=None)
    without, left = np.ones(100), np.ones(100)
    left[50:] = math.sqrt(1 - 2 * removed)
    assert away_from_turns(problem, left, without) == pytest.approx(0.0 if told else 1.0, abs=1e-9)
    if told:
        left[:50] = math.sqrt(1 - removed)
        assert away_from_turns(problem, left, without) == pytest.approx(1 / 3, rel=1e-9)


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


@pytest.mark.parametrize(("u", "var"), [([0.3, -0.2], [0.01, 0.04]), ([2.0], [0.0]), ([1e-6] * 5, [1e-9] * 5)])
def test_the_size_of_a_group_is_the_most_likely_one_under_its_prior(u: list[float], var: list[float]) -> None:
    """It maximises -n log s - sum(u^2 + var) / (2 s^2) - s^2 / (2 prior^2): no size beside it is more likely."""
    values, spread, prior = np.array(u), np.array(var), 0.4

    def log(size: float) -> float:
        energy = float(np.sum(values**2 + spread))
        return -len(u) * math.log(size) - energy / (2 * size**2) - size**2 / (2 * prior**2)

    found = _size(values, spread, prior)
    assert log(found) > max(log(found * 1.001), log(found / 1.001))
