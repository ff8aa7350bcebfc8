"""A measured speed is the slope of the position: it is v, tells units, and is no cause, as the torque again is none."""

import re
from pathlib import Path

import numpy as np
import pytest
from tables import written

from cosim.data.recording import Recording
from cosim.support.errors import UndecidedError

T = np.arange(3000) / 500.0
Q, V, TAU = np.sin(3 * T), 3 * np.cos(3 * T), 1.5 * np.cos(3 * T + 0.4)
DEG = 180 / np.pi
NOISE = np.random.default_rng(1).normal(0, 0.02, len(T))


def read(folder: Path, header: str, *columns: np.ndarray, units: dict[str, str] | None = None) -> Recording:
    return Recording.read(written(folder / "run.csv", header, *columns), units=units)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("velocity", 1.0),
        ("motor_speed [rpm]", 30 / np.pi),
        ("speed_deg_s", DEG),
        ("rpm", 30 / np.pi),
        ("vel [deg/s]", DEG),
        ("Drehzahl [U/min]", 30 / np.pi),
        ("deg/s", DEG),
        ("qd", 1.0),
        ("n_act", 30 / np.pi),
        ("speed", DEG),
        ("w", 1 / (2 * np.pi)),
    ],
)
def test_the_axis_own_speed_serves_as_v_in_the_unit_that_makes_it_the_slope(
    tmp_path: Path, name: str, factor: float
) -> None:
    recording = read(tmp_path, f"t,tau,q,{name}", T, TAU, Q, factor * (V + NOISE))
    assert recording.columns == ("t", "tau", "q", "v")
    np.testing.assert_allclose(recording["v"], V + NOISE, rtol=1e-6, atol=1e-6)
    assert any("is the slope of the position and serves as v" in note for note in recording.notes)


@pytest.mark.parametrize(("name", "rate"), [("axis2_speed", 5), ("fan_current", 11)])
def test_the_speed_of_a_neighbour_and_a_current_of_its_own_stay_columns(tmp_path: Path, name: str, rate: int) -> None:
    recording = read(tmp_path, f"t,tau,q,{name}", T, TAU, Q, np.sin(rate * T))
    assert recording.columns == ("t", "tau", "q", name)


def test_the_speed_before_a_gear_and_the_torque_in_other_units_are_no_causes(tmp_path: Path) -> None:
    columns = (T, TAU, Q, V, 81 * V, 1e3 * TAU + NOISE, TAU / 0.3 + NOISE)
    recording = read(tmp_path, "t,tau,q,velocity,motor_speed,torque_mNm,iq", *columns)
    assert recording.columns == ("t", "tau", "q", "v")
    assert any("left out: motor_speed, torque_mNm, iq." in note for note in recording.notes)


def test_the_speed_tells_that_time_counts_milliseconds(tmp_path: Path) -> None:
    recording = read(tmp_path, "t,tau,q,velocity [rad/s]", 20 * np.arange(3000.0), TAU, np.sin(0.06 * np.arange(3000)),
                     3 * np.cos(0.06 * np.arange(3000)))  # fmt: skip
    assert recording.sample_time == pytest.approx(0.02)


def test_a_stated_time_that_the_speed_denies_is_asked_for(tmp_path: Path) -> None:
    header = "t [s],tau,q [rad],velocity [rad/s]"
    with pytest.raises(UndecidedError, match=r"only in ms; say which it is, --units t=ms or --units t=s"):
        read(tmp_path, header, 1e3 * T, TAU, Q, V)
    assert read(tmp_path, header, 1e3 * T, TAU, Q, V, units={"t": "ms"}).sample_time == pytest.approx(0.002)


@pytest.mark.parametrize(("unit", "factor"), [("mrad", 1e3), ("deg", DEG), ("0.001 deg", 1e3 * DEG)])
def test_a_position_whose_slope_is_the_speed_in_another_unit_only_is_asked_for(
    tmp_path: Path, unit: str, factor: float
) -> None:
    header = "t,tau,q,velocity [rad/s]"
    with pytest.raises(UndecidedError, match=re.escape(f"only if that is in {unit}, and the file states no unit")):
        read(tmp_path, header, T, TAU, factor * Q, V)
    np.testing.assert_allclose(read(tmp_path, header, T, TAU, factor * Q, V, units={"q": unit})["q"], Q, atol=1e-6)


def test_the_speed_of_another_shaft_alone_is_no_speed_of_the_axis(tmp_path: Path) -> None:
    recording = read(tmp_path, "t,tau,q,motor_speed", T, TAU, Q, 81 * V)
    assert "v" not in recording.columns
