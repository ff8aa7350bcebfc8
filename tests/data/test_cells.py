"""Cells with a unit or a list in them, and a measured acceleration that tells the units of time and position."""

from pathlib import Path

import numpy as np
import pytest
from tables import written

from cosim.data.recording import Recording
from cosim.support.errors import RecordingError, UndecidedError

T = np.arange(1000) / 250
Q = 0.8 * np.sin(2 * T) + 0.2 * np.sin(5.1 * T)
A = -3.2 * np.sin(2 * T) - 5.202 * np.sin(5.1 * T)
TAU = 0.5 * A + 0.3 * np.cos(2 * T)
DEG = 180 / np.pi


def cells(column: np.ndarray, unit: str) -> list[str]:
    return [f"{x:.6f}{unit}" for x in column]


@pytest.mark.parametrize(
    ("units", "sep", "comma"),
    [((" ms", " Nm", " deg"), ",", False), (("ms", "Nm", "°"), ";", True), (("", " N.m", "deg"), "\t", False)],
)
def test_cells_that_hold_their_unit_are_numbers_in_it(
    tmp_path: Path, units: tuple[str, ...], sep: str, comma: bool
) -> None:
    time = cells(1e3 * T if units[0] else T, units[0])
    columns = (time, cells(TAU, units[1]), cells(DEG * Q, units[2]))
    header = sep.join(["time", "torque", "angle"])
    path = written(tmp_path / "run.csv", header, *columns, sep=sep)
    if comma:
        path.write_text(path.read_text("utf-8").replace(".", ","), "utf-8")
    seen = Recording.read(path)
    np.testing.assert_allclose(seen.t, T, atol=1e-8)
    np.testing.assert_allclose(seen["q"], Q, atol=1e-7)
    np.testing.assert_allclose(seen["tau"], TAU, atol=1e-6)
    assert seen.units["tau"] == "N.m"


def test_two_units_in_the_cells_of_one_column_are_refused_with_the_line(tmp_path: Path) -> None:
    angle = cells(DEG * Q, " deg")
    angle[700] = "3 rad"
    with pytest.raises(RecordingError, match=r'line 702 holds "rad" in column 3, which is in deg above'):
        Recording.read(written(tmp_path / "run.csv", "t,torque,angle", T, cells(TAU, " Nm"), angle))


def test_lists_in_cells_are_columns(tmp_path: Path) -> None:
    lists = [[f'"[{x:.6f}, {2 * x:.6f}]"' for x in column] for column in (Q, TAU)]
    path = written(tmp_path / "run.csv", "time,position,effort", T, *lists)
    seen = Recording.read(path, {"q": "position.1", "tau": "effort.1"})
    np.testing.assert_allclose(seen["q"], Q, atol=1e-6)
    bare = [[text.strip('"') for text in column] for column in lists]
    seen = Recording.read(written(tmp_path / "bare.csv", "time,position,effort", T, *bare), {"q": "#2", "tau": "#4"})
    np.testing.assert_allclose(seen["tau"], TAU, atol=1e-6)


@pytest.mark.parametrize(
    ("header", "columns", "option"),
    [
        ("time_s,torque_Nm,position_rad,acc_rad_s2", (1e3 * T, TAU, Q, A), "--units t=ms or --units t=s"),
        ("time_s,torque_Nm,position_rad,acc [deg/s^2]", (1e3 * T, TAU, Q, DEG * A), "--units t=ms or --units t=s"),
        ("time,torque_Nm,position,acc_rad_s2", (T, TAU, DEG * Q / 10, A / 10), "--units q=deg or --units q=rad"),
    ],
)
def test_an_acceleration_that_contradicts_a_unit_asks_for_it(
    tmp_path: Path, header: str, columns: tuple[np.ndarray, ...], option: str
) -> None:
    path = written(tmp_path / "run.csv", header, *columns)
    with pytest.raises(UndecidedError, match=f"is the second derivative of the position only .*{option}"):
        Recording.read(path)
    key, _, value = option.split()[1].partition("=")
    assert Recording.read(path, units={key: value}).sample_time == pytest.approx(1 / 250)


def test_an_acceleration_that_agrees_or_is_of_another_axis_asks_nothing(tmp_path: Path) -> None:
    for other in (A, np.sin(11 * T), np.roll(A, 200)):
        path = written(tmp_path / "run.csv", "time_s,torque_Nm,position_rad,acc_rad_s2", T, TAU, Q, other)
        assert "acc_rad_s2" in Recording.read(path)
