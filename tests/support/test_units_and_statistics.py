"""Units are what their definitions say, in size and in dimension; statistics are those of textbooks."""

import numpy as np
import pytest

from cosim.support.statistics import bootstrap_range, hann, rms
from cosim.support.units import unit

DEFINED = {
    "N": "kg.m/s2",
    "J": "N.m",
    "W": "J/s",
    "C": "A.s",
    "V": "W/A",
    "Pa": "N/m2",
    "Hz": "1/s",
    "F": "C/V",
    "H": "V.s/A",
    "T": "V.s/m2",
    "Ohm": "V/A",
    "g": "0.001 kg",
    "bar": "100000 Pa",
    "mbar": "100 Pa",
    "L": "0.001 m3",
    "l": "0.001 m3",
    "min": "60 s",
    "h": "60 min",
    "turn": "360 deg",
    "rev": "6.283185307179586 rad",
    "deg": "60 arcmin",
    "arcmin": "60 arcsec",
    "arcsec": "1000 mas",
    "rpm": "rev/min",
    "counts": "count",
    "count": "1",
}
"""SI brochure, 9th edition, tables 4 and 8; angles are of dimension one."""
SIZES = {
    "deg": np.pi / 180,
    "mN.m": 1e-3,
    "kN": 1e3,
    "um": 1e-6,
    "nm": 1e-9,
    "cm": 1e-2,
    "Mm": 1e6,
    "GHz": 1e9,
    "Ncm": 1e-2,
    "rad/s^2": 1.0,
    "J/(kg.K)": 1.0,
    "mm/min": 1e-3 / 60,
    "0.5 rad/s": 0.5,
    "[m]": 1.0,
    "km/h": 1 / 3.6,
    "%": 0.01,
}
"""How large a unit is in SI."""
BASE = {"m": 0, "s": 2, "kg": 1, "A": 3, "K": 4}
"""Place of a base unit among the powers."""


@pytest.mark.parametrize("name", DEFINED)
def test_a_unit_is_what_defines_it(name: str) -> None:
    one, other = unit(name), unit(DEFINED[name])
    assert one.dimension == other.dimension
    assert one.factor == pytest.approx(other.factor, rel=1e-15)
    assert one.offset == other.offset == 0


@pytest.mark.parametrize("name", SIZES)
def test_a_unit_has_its_size(name: str) -> None:
    assert unit(name).factor == pytest.approx(SIZES[name], rel=1e-12)


@pytest.mark.parametrize("name", BASE)
def test_a_base_unit_has_the_power_one_of_itself_alone(name: str) -> None:
    assert unit(name).dimension == tuple(int(place == BASE[name]) for place in range(5))
    assert unit(name).factor == 1
    assert {unit(one).dimension for one in ("rad", "deg", "mas", "1", "%")} == {(0,) * 5}
    assert unit("degC").dimension == unit("degF").dimension == unit("K").dimension


@pytest.mark.parametrize(
    ("name", "values", "inside"),
    [
        ("K", [273.15, 300.0], [0.0, 26.85]),
        ("degF", [32.0, 212.0], [0.0, 100.0]),
        ("degC", [0.0, 21.5], [0.0, 21.5]),
        ("°C", [0.0], [0.0]),
        ("arcsec", [1296000.0], [2 * np.pi]),
        ("mN m", [1500.0], [1.5]),
    ],
)
def test_values_become_si_with_temperatures_in_degrees_celsius(
    name: str, values: list[float], inside: list[float]
) -> None:
    np.testing.assert_allclose(unit(name).to_si(np.array(values)), inside, rtol=1e-12, atol=1e-12)


# The root mean square, the window and the bootstrap that all of the project uses.


def test_the_root_mean_square_of_a_sine_is_its_amplitude_over_root_two_and_nothing_has_none() -> None:
    assert rms(3.0 * np.sin(2 * np.pi * np.arange(1000) / 1000)) == pytest.approx(3.0 / np.sqrt(2), rel=1e-12)
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
