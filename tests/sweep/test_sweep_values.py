"""How parameters are spread, and what is worked out of each run."""

from math import inf, sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from sweeps import K, folder, written
from tiny_fmu import tiny

from cosim.data.recording import Recording
from cosim.sweeps.file import read_sweep
from cosim.sweeps.statistics import KINDS, Statistic
from cosim.sweeps.variation import Normal, Range, Values, Variation

__all__ = ["folder", "tiny"]

VARIATIONS: list[Variation] = [
    Values(of=("x",), values=(3.0, 1.0, 2.0)),
    Range(of=("x",), low=-1.0, high=3.0),
    Range(of=("x",), low=0.1, high=30.0, scale="log"),
    Range(of=("x",), low=2.0, high=5.0, scale="integer"),
    Normal(of=("x",), mean=1.0, std=2.0),
    Normal(of=("x",), mean=1.0, std=2.0, low=0.0, high=1.5),
]


@pytest.mark.parametrize("variation", VARIATIONS[1:])
@settings(deadline=None)
@given(shares=some.lists(some.floats(0, 1, exclude_max=True), min_size=2))
def test_a_distribution_grows_with_its_share_and_keeps_its_limits(variation: Variation, shares: list[float]) -> None:
    values = [variation.at(u) for u in sorted(shares)]
    np.testing.assert_allclose(values, sorted(values), atol=1e-9)  # the standard library inverts to a few ulp
    low, high = getattr(variation, "low", -inf), getattr(variation, "high", inf)
    assert all(low <= value <= high for value in values)


@pytest.mark.parametrize(
    ("variation", "mean", "std"),
    [
        (VARIATIONS[0], 2.0, sqrt(2 / 3)),
        (VARIATIONS[1], 1.0, 4 / sqrt(12)),
        (VARIATIONS[3], 3.5, sqrt(5 / 4)),
        (VARIATIONS[4], 1.0, 2.0),
    ],
)
def test_a_distribution_has_the_mean_and_spread_of_its_kind(variation: Variation, mean: float, std: float) -> None:
    values = [variation.at((k + 0.5) / 6000) for k in range(6000)]
    np.testing.assert_allclose([np.mean(values), np.std(values)], [mean, std], rtol=2e-3)


def test_a_log_range_has_its_middle_at_the_geometric_mean_and_a_grid_ends_at_its_ends() -> None:
    assert VARIATIONS[2].at(0.5) == pytest.approx(sqrt(3.0))
    assert Range(of=("x",), low=0.1, high=30.0, scale="log", count=3).grid() == (0.1, pytest.approx(sqrt(3.0)), 30.0)
    assert Range(of=("x",), low=1.0, high=2.0, count=1).grid() == (1.0,)
    assert Range(of=("x",), low=1.0, high=4.0, scale="integer").grid() == (1.0, 2.0, 3.0, 4.0)


def test_a_latin_hypercube_meets_each_part_of_each_range_once(folder: Path) -> None:
    path = written(folder, (K, '"plant.k" = { low = 0.0, high = 20.0 }'), (", count = 3", ""))
    path.write_text('method = "latin_hypercube"\nruns = 20\nseed = 2\n' + path.read_text())
    points = np.array(list(read_sweep(path).design.points()))
    for column, (low, high) in zip(points.T, [(0.0, 20.0), (0.5, 1.5)], strict=True):
        assert sorted(np.floor(20 * (column - low) / (high - low)).astype(int)) == list(range(20))
    assert abs(np.corrcoef(points.T)[0, 1]) < 0.9


def test_statistics_are_what_their_names_say() -> None:
    t = np.arange(0, 1, 0.1)
    x = np.array([5.0, -3.0, 4.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0])
    recording = Recording("run", {"t": t, "x": x}, {"t": "s", "x": "rad"})
    found = {kind: Statistic(signal="x", kind=kind, **{"from": 0.1, "to": 0.3}).of(recording) for kind in KINDS}
    window = np.array([-3.0, 4.0, 0.0])
    expected = {"mean": 1 / 3, "std": float(np.std(window)), "min": -3.0, "max": 4.0, "rms": sqrt(25 / 3)}
    expected |= {"peak": 4.0, "ise": 2.5, "iae": 0.7, "final": 0.0}
    assert found == pytest.approx(expected)


def test_a_difference_of_temperatures_has_no_offset() -> None:
    table = {"t": np.arange(3.0), "a": np.full(3, 20.0), "b": np.full(3, 17.0)}
    recording = Recording("run", table, {"t": "s", "a": "degC", "b": "degC"})
    assert Statistic(signal="a", minus="b", kind="mean", unit="degF").of(recording) == pytest.approx(5.4)
    assert Statistic(signal="a", kind="mean", unit="K").of(recording) == pytest.approx(293.15)
