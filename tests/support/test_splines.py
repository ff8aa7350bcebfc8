"""The cubic spline beside SciPy's, and the polynomials that it must give back."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline as Reference

from cosim.support.splines import CubicSpline

RANDOM = np.random.default_rng(5)


@pytest.mark.parametrize("rows", [2, 3, 4, 5, 60])
@pytest.mark.parametrize("columns", [(), (3,)])
def test_a_spline_and_its_slope_are_those_of_scipy(rows: int, columns: tuple[int, ...]) -> None:
    t, values = np.sort(RANDOM.uniform(size=rows)), RANDOM.standard_normal((rows, *columns))
    at = RANDOM.uniform(t[0] - 0.1, t[-1] + 0.1, 200)
    found, slope = CubicSpline(t, values).with_slope(at, 3)
    theirs = Reference(t, values)
    assert found == pytest.approx(theirs(at), rel=1e-9, abs=1e-9 * np.abs(theirs(at)).max())
    assert slope == pytest.approx(theirs(at, 1), rel=1e-9, abs=1e-9 * np.abs(theirs(at, 1)).max())


def test_a_cubic_comes_back_with_its_slope_also_beyond_the_ends() -> None:
    t, at = np.array([0.0, 0.3, 0.5, 1.1, 1.2]), np.linspace(-0.2, 1.5, 30)
    found, slope = CubicSpline(t, t**3 - 2 * t).with_slope(at)
    assert found == pytest.approx(at**3 - 2 * at, abs=1e-12)
    assert slope == pytest.approx(3 * at**2 - 2, abs=1e-11)
