"""Units that nothing states are assumed aloud; files without names, torque or motion show what was named."""

from pathlib import Path

import numpy as np
import pytest
from tables import written

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import UndecidedError

T = np.arange(300) * 4e-3
Q = 9 * np.sin(3 * T)
TAU = np.cos(5 * T)
RUN = "no unit is stated for "


def test_columns_without_a_unit_are_said_to_be_taken_in_si_units(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "time,joint_effort,joint_position", T, TAU, Q)
    note = next(note for note in Recording.read(path).notes if RUN in note)
    assert '"joint_effort" (tau in N.m or N), "joint_position" (q in rad or m)' in note
    assert note.endswith("say which, for example --units tau=mN.m q=deg.")
    seen = Recording.read(path, units={"tau": "mN.m", "q": "deg"})
    np.testing.assert_allclose(seen["q"], np.deg2rad(Q), atol=1e-6)
    assert not any(RUN in note for note in seen.notes)


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("t,tau,q", {}),
        ("time,torque_Nm,position_deg", {}),
        ("time [s],M [Nm],angle [deg]", {"tau": "M"}),
    ],
)
def test_stated_units_and_our_own_names_need_no_note(tmp_path: Path, header: str, columns: dict[str, str]) -> None:
    seen = Recording.read(written(tmp_path / "run.csv", header, T, TAU, Q), columns)
    assert not any(RUN in note for note in seen.notes)


ROWS = np.arange(300)


@pytest.mark.parametrize(
    ("header", "columns", "option"),
    [
        ("time,effort,joint_position", (T, TAU, 10 * Q), "for example --units q=deg or q=rad or q=mm."),
        ("time,effort,pos", (T, TAU, 2048 + ROWS % 40), "for example --units q=deg or q=rad or q=mm."),
        ("time,effort,motor_speed", (T, TAU, np.rint(90 * np.sin(3 * T))), "--units v=rpm or v=deg/s or v=rad/s"),
        ("time,effort,motor_speed", (T, TAU, 1500.5 + T), "--units v=rpm or v=deg/s or v=rad/s"),
        ("time,load,pos,torque", (T, TAU, Q, ROWS % 37 - 20), "--units tau=N.m or tau=mN.m, or how much one of it is"),
        ("time,torque,position,velocity", (T, TAU, 10 * Q, np.gradient(10 * Q, T)), "--units q=deg or q=rad or q=mm."),
    ],
)
def test_a_unit_is_asked_for_where_values_are_hardly_in_si_units(
    tmp_path: Path, header: str, columns: tuple[np.ndarray, ...], option: str
) -> None:
    path = written(tmp_path / "run.csv", header, *columns)
    with pytest.raises(UndecidedError, match=r"states no unit and (goes|holds)") as asked:
        Recording.read(path)
    assert option in str(asked.value)
    role = option.partition("--units ")[2][0]
    answer = {"q": "deg", "v": "rpm", "t": "mN.m"}[role]
    Recording.read(path, units={"tau" if role == "t" else role: answer})


def test_a_speed_in_a_stated_unit_tells_that_of_the_position(tmp_path: Path) -> None:
    path = written(
        tmp_path / "run.csv", "time,torque_Nm,position,velocity_rad_s", T, TAU, 10 * Q, np.gradient(10 * Q, T)
    )
    seen = Recording.read(path)
    assert seen.units["q"] == "rad"
    assert not any(RUN in note for note in seen.notes)


def test_our_own_names_are_in_si_units_whatever_they_hold(tmp_path: Path) -> None:
    seen = Recording.read(written(tmp_path / "run.csv", "t,tau,q", T, ROWS % 37 - 20, 100 * Q))
    np.testing.assert_allclose(seen["q"], 100 * Q, atol=1e-5)


def test_a_column_that_the_user_names_without_its_unit_is_noted_too(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "", T, TAU, Q)
    seen = Recording.read(path, {"t": "#1", "tau": "#2", "q": "#3"})
    assert [RUN in note for note in seen.notes] == [True]


def test_a_file_without_names_and_without_a_torque_is_shown_with_what_was_named(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "", Q, 2 * Q, 3 * Q)
    seen = preview(path, {"columns": {"q": "#1"}, "layout": {"period": "4ms"}})
    np.testing.assert_allclose(seen.recording["q"], Q, atol=1e-6)
    assert "tau=#2" in seen.undecided[0]  # never the column that was named


def test_a_torque_in_nm_in_small_letters_is_in_newton_metres(tmp_path: Path) -> None:
    seen = Recording.read(written(tmp_path / "run.csv", "time_s,torque_nm,position_rad", T, TAU, Q))
    np.testing.assert_allclose(seen["tau"], TAU, atol=1e-6)
    assert seen.units["tau"] == "N.m"
