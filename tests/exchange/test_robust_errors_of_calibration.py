"""What a robust loss makes of noise, and what an input between rows is, against their formulas."""

import numpy as np
import pytest

from cosim.calibration.experiment import _on_ticks
from cosim.calibration.fit import Fit
from cosim.calibration.uncertainty import _noise


def noise_of(z: np.ndarray, loss: str, outlier: float) -> float:
    return _noise(Fit(np.ones(2), z, np.ones((len(z), 2)), loss, outlier, (1.0,), 1), 2)


@pytest.mark.parametrize("outlier", [0.5, 1.0, 3.0])
def test_the_noise_of_a_robust_fit_is_that_of_huber(outlier: float) -> None:
    """rms(psi) / mean(psi') of normal noise, by integration; psi = z / sqrt(1 + (z / c)^2)."""
    x = np.linspace(-9, 9, 20001)
    density = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi) * (x[1] - x[0])
    bent = 1 + (x / outlier) ** 2
    expected = np.sqrt(np.sum(density * x**2 / bent)) / np.sum(density * bent**-1.5)
    z = np.random.default_rng(1).standard_normal(200_000)
    assert noise_of(z, "soft_l1", outlier) == pytest.approx(expected, rel=0.01)
    assert 1 < expected < 1.5, "a robust fit knows somewhat less of normal noise"
    assert noise_of(z, "linear", outlier) == pytest.approx(1.0, rel=0.01)


def test_an_input_that_runs_linearly_is_its_mean_over_each_step() -> None:
    times, values = np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, -2.0])
    found = _on_ticks(times, values, 0.5, 6, "linear")
    assert found[:6] == pytest.approx([0.5, 1.5, 1.5, 0.5, -0.5, -1.5])
    assert len(found) == 7


def test_an_input_that_is_held_keeps_the_sample_before() -> None:
    times, values = np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, -2.0])
    assert _on_ticks(times, values, 0.5, 6, "hold").tolist() == [0, 0, 2, 2, 2, 2, -2]
