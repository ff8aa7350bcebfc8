"""Files of machines that were not seen when the reader was written: read rightly, or asked; nothing taken silently."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from tables import written

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.data.text.names import spelled
from cosim.data.text.table import grouped
from cosim.reading import read_recordings
from cosim.support.errors import InputError, ManyRecordingsError, RecordingError, UndecidedError
from cosim.support.units import unit

ROWS = 400
T = 0.005 * np.arange(ROWS)
Q = np.sin(3 * T)
TAU = 1.5 * np.cos(3 * T)
DEG = np.degrees(1)


@pytest.mark.parametrize(
    ("name", "stated"), [("torque [%]", "%"), ("torque_permille", "0.1 %"), ("torque (‰)", "0.1 %")]
)
def test_a_share_of_the_rated_torque_is_asked_for(tmp_path: Path, name: str, stated: str) -> None:
    path = written(tmp_path / "run.csv", f"t,{name},position", T, TAU, Q)
    with pytest.raises(UndecidedError, match=f'is in {stated} of a torque .* for example --units "tau=0.04 N.m"'):
        Recording.read(path)
    np.testing.assert_allclose(Recording.read(path, units={"tau": "0.04 N.m"})["tau"], 0.04 * TAU, atol=1e-8)


def test_a_unit_that_is_not_known_costs_nothing_where_its_column_is_not_used(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "t,torque [Nm],position [rad],lost motion [reference unit]", T, TAU, Q, Q)
    read = Recording.read(path)
    assert read.units.get("lost motion", "") == ""
    np.testing.assert_allclose(read["lost motion"], Q, atol=1e-8)


@pytest.mark.parametrize(
    ("text", "newton_metres"),
    [
        ("oz-in", 0.0070615518),
        ("ozf·in", 0.0070615518),
        ("lb-ft", 1.3558179),
        ("ft.lbf", 1.3558179),
        ("lbf in", 0.11298483),
        ("kgf.cm", 0.0980665),
        ("Newton-Meter", 1.0),
        ("mNewtonMeter", 1e-3),
        ("NM", 1.0),
    ],
)
def test_torques_of_other_countries_are_known(text: str, newton_metres: float) -> None:
    known = unit(spelled(text))
    assert known.factor == pytest.approx(newton_metres, rel=1e-6)
    assert known.dimension == unit("N.m").dimension


@pytest.mark.parametrize(
    ("text", "radians"),
    [("Grad", np.pi / 180), ("GRAD", np.pi / 180), ("gon", np.pi / 200), ("DEG", np.pi / 180), ("′", np.pi / 10800)],
)
def test_angles_as_other_tools_write_them_are_known(text: str, radians: float) -> None:
    assert unit(spelled(text)).factor == pytest.approx(radians, rel=1e-9)


def test_the_last_part_of_a_path_tells_what_it_is(tmp_path: Path) -> None:
    names = "time,axis.vel_mapper.pos,axis.pos_loop.torque_ref"
    read = Recording.read(written(tmp_path / "run.csv", names, T, Q, TAU))
    assert "v" not in read
    np.testing.assert_allclose([read["q"], read["tau"]], [Q, TAU], atol=1e-8)


def test_relative_positions_of_an_odrive_are_in_turns(tmp_path: Path) -> None:
    names = "time,axis0.pos_vel_mapper.pos_rel,axis0.controller.effective_torque_setpoint,axis0.controller.input_pos"
    read = Recording.read(written(tmp_path / "run.csv", names, T, Q, TAU, Q))
    np.testing.assert_allclose(read["q"], 2 * np.pi * Q, atol=1e-8)
    np.testing.assert_allclose(read["q_d"], 2 * np.pi * Q, atol=1e-8)


def test_days_of_a_spreadsheet_are_no_seconds(tmp_path: Path) -> None:
    days = [f"{45352.5 + t / 86400:.11f}" for t in T]
    path = written(tmp_path / "run.csv", "time,torque,position", days, TAU, Q)
    with pytest.raises(UndecidedError, match=r"200 Hz in days\. Say which with --units t=day, or --units t=s\."):
        Recording.read(path)
    assert Recording.read(path, units={"t": "day"}).sample_time == pytest.approx(5e-3, rel=1e-3)


@pytest.mark.parametrize("sign", [";", ":"])
def test_milliseconds_behind_a_time_are_counted(tmp_path: Path, sign: str) -> None:
    clock = [f"12:00:{int(t):02d}{sign}{round(1e3 * t) % 1000}" for t in T]
    read = Recording.read(written(tmp_path / "run.csv", "Time,torque,position", clock, TAU, Q))
    np.testing.assert_allclose(read.t, T, atol=1e-9)


def test_names_that_stand_again_are_left_out_and_a_new_time_is_another_recording(tmp_path: Path) -> None:
    header, half = "time_s,torque_Nm,pos_rad", ROWS // 2
    path = written(tmp_path / "run.csv", header, T, TAU, Q)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[: half + 1], header, *lines[half + 1 :]]))
    read = Recording.read(path)
    np.testing.assert_allclose(read["q"], Q, atol=1e-8)
    assert f"the names of the columns stand again at row {half + 1}; such lines were left out (1)." in read.notes[0]
    path.write_text("\n".join([*lines[: half + 1], header, *lines[1 : half + 1]]))
    with pytest.raises(ManyRecordingsError, match="These are 2 recordings"):
        Recording.read(path)
    np.testing.assert_allclose(Recording.read(f"{path}:#2")["q"], Q[:half], atol=1e-8)


def test_thousands_may_be_parted_where_that_is_certain(tmp_path: Path) -> None:
    large = [f'"{1e6 * x:,.1f}"' for x in TAU]
    read = Recording.read(written(tmp_path / "run.csv", "t,torque [uN.m],q", T, large, Q))
    np.testing.assert_allclose(read["tau"], TAU, atol=1e-7)
    german = [text.strip('"').translate(str.maketrans(",.", ".,")) for text in large]
    columns = [[f"{x:.9f}".replace(".", ",") for x in column] for column in (T, Q)]
    path = written(tmp_path / "run.csv", "t;torque [uN.m];q", columns[0], german, columns[1], sep=";")
    np.testing.assert_allclose(Recording.read(path)["tau"], TAU, atol=1e-7)


def test_quoted_decimal_commas_between_commas_are_read_and_a_single_group_is_no_thousand(tmp_path: Path) -> None:
    columns = [[f'"{x:.6f}"'.replace(".", ",") for x in column] for column in (T, TAU, Q)]
    read = Recording.read(written(tmp_path / "run.csv", "t,torque,q", *columns))
    np.testing.assert_allclose([read["tau"], read["q"]], [TAU, Q], atol=1e-6)
    assert grouped(np.array(["1,931", "2,125"], dtype=object), ".").dtype == object


def test_a_time_of_too_few_digits_names_the_period(tmp_path: Path) -> None:
    seconds = [f"2024-03-01 12:00:{int(10 * t):02d}" for t in T]
    path = written(tmp_path / "run.csv", "timestamp,torque,position", seconds, TAU, Q)
    with pytest.raises(UndecidedError, match="if the rows are evenly spaced, say --layout period=50ms"):
        Recording.read(path)
    assert Recording.read(path, layout={"period": "50ms"}).sample_time == pytest.approx(0.05)


@pytest.mark.parametrize("word", ["---", "#NV", "-nan(ind)", "n.a."])
def test_words_for_no_value_are_told_and_cost_no_other_column(tmp_path: Path, word: str) -> None:
    holes = [word if row % 90 == 5 else f"{x:.6f}" for row, x in enumerate(TAU)]
    read = Recording.read(written(tmp_path / "run.csv", "t,tau,q,load", T, TAU, Q, holes))
    assert "load" not in read
    with pytest.raises(RecordingError, match=r"holds nan at row 6, which is not a finite number \(5 such rows\)"):
        Recording.read(written(tmp_path / "run.csv", "t,tau,q", T, holes, Q))


def test_a_file_without_names_offers_no_empty_column(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("\n".join(f";{t:.4f};{tau:.6f};{q:.6f}" for t, tau, q in zip(T, TAU, Q, strict=True)))
    with pytest.raises(UndecidedError, match=r"--columns t=#2 tau=#3 q=#4\."):
        Recording.read(path)


@pytest.mark.parametrize("word", ["Y_Unit_Label", "Vertical Units", "unit", "Einheit"])
def test_units_that_a_preamble_gives_column_by_column_are_those_of_the_columns(tmp_path: Path, word: str) -> None:
    header = f"Written by a tool\nDate;2024/03/01\n{word};mN.m;deg\nEnd of header\nt;torque;angle"
    read = Recording.read(written(tmp_path / "run.csv", header, T, TAU, Q, sep=";"))
    np.testing.assert_allclose(read["tau"], 1e-3 * TAU, atol=1e-9)
    np.testing.assert_allclose(read["q"], Q / DEG, atol=1e-8)


def test_a_channel_in_volts_is_no_torque_until_its_scale_is_given(tmp_path: Path) -> None:
    header = "Model,scope\nVertical Units,V,V\nTIME,CH1,CH2"
    path = written(tmp_path / "run.csv", header, T, TAU, Q)
    columns = {"tau": "CH1", "q": "CH2"}
    with pytest.raises(InputError, match="becomes V; "):
        read_recordings([path], columns, [], ["q=rad"], "rotary")
    scaled = Recording.read(path, columns, {"tau": "2 N.m", "q": "rad"})
    np.testing.assert_allclose(scaled["tau"], 2 * TAU, atol=1e-8)


# A file that holds a torque or a position alone is no axis, and is shown as what it holds.


@pytest.mark.parametrize(
    ("header", "role", "scale"),
    [("time (ms),position_value (degree)", "q", pi / 180), ("time (ms),torque_nm", "tau", 1.0)],
)
def test_what_is_there_is_served(tmp_path: Path, header: str, role: str, scale: float) -> None:
    values = np.arange(400) * 1.5 % 360
    rows = "\n".join(f"{k},{value:.3f}" for k, value in enumerate(values))
    path = tmp_path / "half.csv"
    path.write_text(f"{header}\n{rows}\n")
    shown = preview(path)
    other = {"q": "no column tau", "tau": "no column q or v"}[role]
    assert other in shown.refused
    counted = np.arange(400) * 1.5 if role == "q" else values  # a position in degrees begins again at 360
    assert shown.recording.table[role] == pytest.approx(counted * scale)


# The log of Machinekit's halscope: another spelling of its unit, and channels that record nothing.

TIMES = np.arange(200) * 1e-3


def test_names_are_read_and_channels_without_a_pin_are_none(tmp_path: Path) -> None:
    rows = (
        f"joint.0.pos-fb {np.sin(9 * t):+.14f} (null) +0.0 pid.0.output {np.cos(7 * t):+.14f} (null) +0.0 "
        for t in TIMES
    )
    (tmp_path / "halscope.log").write_text("Sampling period is 1000000 nSec \n\n" + "\n".join(rows) + "\n")
    seen = Recording.read(tmp_path / "halscope.log", {"tau": "pid.0.output", "q": "joint.0.pos-fb"})
    np.testing.assert_allclose(seen["q"], np.sin(9 * TIMES), atol=1e-13)
    np.testing.assert_allclose(seen.t, TIMES)
    assert set(seen) == {"t", "tau", "q"}
