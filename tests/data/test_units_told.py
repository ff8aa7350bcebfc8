"""Units: in cells, told by a measured speed or acceleration, asked for where values deny them, else assumed aloud."""

import re
from pathlib import Path

import numpy as np
import pytest
from tables import written

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import RecordingError, UndecidedError

T = np.arange(3000) / 500.0
Q, V, TAU = np.sin(3 * T), 3 * np.cos(3 * T), 1.5 * np.cos(3 * T + 0.4)
A = -9 * Q
LONG, QL = 4e-3 * np.arange(300), 9 * np.sin(0.012 * np.arange(300))
TAUL, ROWS = np.cos(5 * LONG), np.arange(300)
DEG = 180 / np.pi
NOISE = np.random.default_rng(1).normal(0, 0.02, len(T))
ASSUMED = "no unit is stated for "


def read(folder: Path, header: str, *columns: object, **options: dict[str, str]) -> Recording:
    return Recording.read(written(folder / "run.csv", header, *columns), **options)  # type: ignore[arg-type]


def cells(column: np.ndarray, unit: str) -> list[str]:
    return [f"{x:.6f}{unit}" for x in column]


# Cells that hold their unit, or a list.


@pytest.mark.parametrize(
    ("units", "sep", "comma"),
    [((" ms", " Nm", " deg"), ",", False), (("ms", "Nm", "°"), ";", True), (("", " N.m", "deg"), "\t", False)],
)
def test_cells_that_hold_their_unit_are_numbers_in_it(
    tmp_path: Path, units: tuple[str, ...], sep: str, comma: bool
) -> None:
    columns = [cells(x, unit) for x, unit in zip((1e3 * T if units[0] else T, TAU, DEG * Q), units, strict=True)]
    path = written(tmp_path / "run.csv", sep.join(["time", "torque", "angle"]), *columns, sep=sep)
    if comma:
        path.write_text(path.read_text("utf-8").replace(".", ","), "utf-8")
    seen = Recording.read(path)
    np.testing.assert_allclose(seen.t, T, atol=1e-8)
    np.testing.assert_allclose([seen["q"], seen["tau"]], [Q, TAU], atol=1e-6)
    assert seen.units["tau"] == "N.m"


def test_two_units_in_the_cells_of_one_column_are_refused_with_the_line(tmp_path: Path) -> None:
    angle = cells(DEG * Q, " deg")
    angle[700] = "3 rad"
    with pytest.raises(RecordingError, match=r'line 702 holds "rad" in column 3, which is in deg above'):
        read(tmp_path, "t,torque,angle", T, cells(TAU, " Nm"), angle)


def test_lists_in_cells_are_columns(tmp_path: Path) -> None:
    lists = [[f'"[{x:.6f}, {2 * x:.6f}]"' for x in column] for column in (Q, TAU)]
    seen = read(tmp_path, "time,position,effort", T, *lists, columns={"q": "position.1", "tau": "effort.1"})
    np.testing.assert_allclose(seen["q"], Q, atol=1e-6)
    bare = [[text.strip('"') for text in column] for column in lists]
    seen = read(tmp_path, "time,position,effort", T, *bare, columns={"q": "#2", "tau": "#4"})
    np.testing.assert_allclose(seen["tau"], TAU, atol=1e-6)


# A measured speed is the slope of the position: it is v, tells units, and is no cause, as the torque again is none.


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


@pytest.mark.parametrize(
    ("name", "column", "kept"),
    [
        pytest.param("axis2_speed", np.sin(5 * T), ("axis2_speed",), id="the speed of a neighbour"),
        pytest.param("fan_current", np.sin(11 * T), ("fan_current",), id="a current of its own"),
        pytest.param("motor_speed", 81 * V, (), id="the speed of another shaft"),
        pytest.param("motor_speed", 1.024 * V, ("v",), id="a slope within 2.5 %"),
        pytest.param("motor_speed", 1.027 * V, (), id="one that is not"),
        pytest.param("torque_mNm", 1e3 * TAU + NOISE, (), id="the torque again"),
        pytest.param("iq", TAU / 0.3 + NOISE, (), id="and as a current"),
    ],
)
def test_what_is_a_column_of_its_own_stays_and_what_repeats_another_is_left_out(
    tmp_path: Path, name: str, column: np.ndarray, kept: tuple[str, ...]
) -> None:
    recording = read(tmp_path, f"t,tau,q,{name}", T, TAU, Q, column)
    assert recording.columns == ("t", "tau", "q", *kept)
    assert bool(kept) != any(f"left out: {name}." in note for note in recording.notes)


def test_the_speed_tells_that_time_counts_milliseconds(tmp_path: Path) -> None:
    header = "t,tau,q,velocity [rad/s]"
    assert read(tmp_path, header, 1e4 * T, TAU, np.sin(30 * T), 3 * np.cos(30 * T)).sample_time == pytest.approx(0.02)


MS_OR_S = "--units t=ms or --units t=s"


@pytest.mark.parametrize(
    ("header", "columns", "role", "unit", "sentence"),
    [
        *(
            ("t,tau,q,velocity [rad/s]", (T, TAU, factor * Q, V), "q", unit, f"only if that is in {unit}, and the file")
            for unit, factor in (("mrad", 1e3), ("deg", DEG), ("0.001 deg", 1e3 * DEG))
        ),
        ("t [s],tau,q [rad],velocity [rad/s]", (1e3 * T, TAU, Q, V), "t", "ms", f"in ms; say which it is, {MS_OR_S}"),
        ("time_s,torque_Nm,pos_rad,acc_rad_s2", (1e3 * T, TAU, Q, A), "t", "ms", "derivative of the position only"),
        ("time_s,torque_Nm,pos_rad,acc [deg/s^2]", (1e3 * T, TAU, Q, DEG * A), "t", "ms", MS_OR_S),
        ("time,torque_Nm,position,acc_rad_s2", (T, TAU, DEG * Q, A), "q", "deg", "--units q=deg or --units q=rad"),
    ],
)  # fmt: skip
def test_a_unit_that_a_speed_or_an_acceleration_denies_is_asked_for(
    tmp_path: Path, header: str, columns: tuple[np.ndarray, ...], role: str, unit: str, sentence: str
) -> None:
    with pytest.raises(UndecidedError, match=re.escape(sentence)):
        read(tmp_path, header, *columns)
    recording = read(tmp_path, header, *columns, units={role: unit})
    assert recording.sample_time == pytest.approx(0.002)
    assert np.ptp(recording["q"]) == pytest.approx(2, rel=1e-3)


def test_an_acceleration_that_agrees_or_is_of_another_axis_asks_nothing(tmp_path: Path) -> None:
    for other in (A, np.sin(11 * T), np.roll(A, 200)):
        assert "acc_rad_s2" in read(tmp_path, "time_s,torque_Nm,position_rad,acc_rad_s2", T, TAU, Q, other)


# Units that nothing states are assumed aloud, or asked for where values are hardly in SI units.


def test_columns_without_a_unit_are_said_to_be_taken_in_si_units(tmp_path: Path) -> None:
    header = "time,joint_effort,joint_position"
    note = next(note for note in read(tmp_path, header, LONG, TAUL, QL).notes if ASSUMED in note)
    assert '"joint_effort" (tau in N.m or N), "joint_position" (q in rad or m)' in note
    assert note.endswith("say which, for example --units tau=mN.m q=deg.")
    seen = read(tmp_path, header, LONG, TAUL, QL, units={"tau": "mN.m", "q": "deg"})
    np.testing.assert_allclose(seen["q"], np.deg2rad(QL), atol=1e-6)
    assert not any(ASSUMED in note for note in seen.notes)


@pytest.mark.parametrize(
    ("header", "columns", "q", "noted"),
    [
        pytest.param("t,tau,q", {}, QL, False, id="our own names"),
        pytest.param("t,tau,q", {}, 1000 * QL, False, id="our own names, whatever they hold"),
        pytest.param("time,torque_Nm,position_rad", {}, QL, False, id="stated units"),
        pytest.param("time [s],M [Nm],angle [rad]", {"tau": "M"}, QL, False, id="stated units in brackets"),
        pytest.param("time_s,torque_nm,position_rad", {}, QL, False, id="Nm in small letters"),
        pytest.param("", {"t": "#1", "tau": "#2", "q": "#3"}, QL, True, id="columns that are named without a unit"),
    ],
)
def test_stated_units_and_our_own_names_need_no_note(
    tmp_path: Path, header: str, columns: dict[str, str], q: np.ndarray, noted: bool
) -> None:
    seen = read(tmp_path, header, LONG, TAUL, q, columns=columns)
    np.testing.assert_allclose([seen["tau"], seen["q"]], [TAUL, q], atol=1e-5)
    assert sum(ASSUMED in note for note in seen.notes) == noted


POSITION, SPEED = "for example --units q=deg or q=rad or q=mm.", "--units v=rpm or v=deg/s or v=rad/s"


@pytest.mark.parametrize(
    ("header", "columns", "option", "answer"),
    [
        ("time,effort,joint_position", (TAUL, 10 * QL), POSITION, {"q": "deg"}),
        ("time,effort,pos", (TAUL, 2048 + ROWS % 40), POSITION, {"q": "deg"}),
        ("time,effort,motor_speed", (TAUL, np.rint(90 * np.sin(3 * LONG))), SPEED, {"v": "rpm"}),
        ("time,effort,motor_speed", (TAUL, 1500.5 + LONG), SPEED, {"v": "rpm"}),
        ("time,load,pos,torque", (TAUL, QL, ROWS % 37 - 20), "tau=N.m or tau=mN.m, or how much one", {"tau": "mN.m"}),
        ("time,torque,position,velocity", (TAUL, 10 * QL, np.gradient(10 * QL, LONG)), POSITION, {"q": "deg"}),
    ],
)
def test_a_unit_is_asked_for_where_values_are_hardly_in_si_units(
    tmp_path: Path, header: str, columns: tuple[np.ndarray, ...], option: str, answer: dict[str, str]
) -> None:
    with pytest.raises(UndecidedError, match=rf"states no unit and (goes|holds).*{re.escape(option)}"):
        read(tmp_path, header, LONG, *columns)
    read(tmp_path, header, LONG, *columns, units=answer)


def test_a_speed_in_a_stated_unit_tells_that_of_the_position(tmp_path: Path) -> None:
    columns = (LONG, TAUL, 10 * QL, np.gradient(10 * QL, LONG))
    seen = read(tmp_path, "time,torque_Nm,position,velocity_rad_s", *columns)
    assert seen.units["q"] == "rad"
    assert not any(ASSUMED in note for note in seen.notes)


def test_a_file_without_names_and_without_a_torque_is_shown_with_what_was_named(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "", QL, 2 * QL, 3 * QL)
    seen = preview(path, {"columns": {"q": "#1"}, "layout": {"period": "4ms"}})
    np.testing.assert_allclose(seen.recording["q"], QL, atol=1e-6)
    assert "tau=#2" in seen.undecided[0]  # never the column that was named
