"""The root mean square, the window and the bootstrap that all of the project uses."""

import numpy as np
import pytest

from cosim.support.statistics import bootstrap_range, hann, rms


def test_the_root_mean_square_of_a_sine_is_its_amplitude_over_root_two() -> None:
    assert rms(3.0 * np.sin(2 * np.pi * np.arange(1000) / 1000)) == pytest.approx(3.0 / np.sqrt(2), rel=1e-12)


def test_nothing_has_no_root_mean_square() -> None:
    assert np.isnan(rms(np.empty(0)))


def test_a_hann_window_starts_and_ends_at_zero_and_is_one_in_the_middle() -> None:
    window = hann(101)
    assert window[[0, 50, 100]] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    assert window == pytest.approx(window[::-1], abs=1e-15)


def test_the_range_of_a_mean_is_that_of_the_central_limit_theorem() -> None:
    values = np.random.default_rng(1).standard_normal(400)
    low, high = bootstrap_range(lambda drawn: values[drawn].mean(1), len(values), 4000)
    half = 1.96 * values.std() / np.sqrt(len(values))
    assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.1 * half)


def test_the_same_seed_draws_the_same_and_undefined_draws_do_not_count() -> None:
    values = np.arange(20.0)
    ranges = [bootstrap_range(lambda drawn: values[drawn].mean(1), 20, 200, seed) for seed in (3, 3, 4)]
    assert ranges[0] == ranges[1] != ranges[2]
    assert np.isfinite(bootstrap_range(lambda drawn: np.where(drawn[:, 0] == 0, np.nan, 1.0), 20, 200)).all()
