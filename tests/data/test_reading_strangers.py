"""Files of machines that nobody had seen: read rightly, in the units they tell, or asked; nothing taken silently."""

import re
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


DAYS = [f"{45352.5 + t / 86400:.11f}" for t in T]
SECONDS = [f"2024-03-01 12:00:{int(10 * t):02d}" for t in T]
SHARE = {"units": {"tau": "0.04 N.m"}}
KT = {"columns": {"tau": "i_q"}, "units": {"tau": "2 N.m"}}
ASKED = [
    *(
        (f"t,{name},position", (T, TAU, Q), rf'is in {stated} of a torque .*"tau=0.04 N.m"', SHARE, (T, 0.04 * TAU))
        for name, stated in (("torque [%]", "%"), ("torque_permille", "0.1 %"), ("torque (‰)", "0.1 %"))
    ),
    ("t,i_q,i_d,pos", (T, TAU, TAU, Q), 'no torque but a current, "i_q"', KT, (T, 2 * TAU)),
    ("time,torque,pos", (DAYS, TAU, Q), r"200 Hz in days\. .* --units t=day, or", {"units": {"t": "day"}}, (T, TAU)),
    ("time,torque,pos", (SECONDS, TAU, Q), "period=50ms", {"layout": {"period": "50ms"}}, (10 * T, TAU)),
    ("", ([""] * ROWS, T, TAU, Q), r"t=#2 tau=#3 q=#4\.", {"columns": {"t": "#2", "tau": "#3", "q": "#4"}}, (T, TAU)),
]
"""Names, columns, what is asked, an answer, and time and torque that are read then."""


@pytest.mark.parametrize(("header", "columns", "sentence", "answer", "expected"), ASKED)
def test_what_a_file_leaves_open_is_asked_and_the_answer_counts(
    tmp_path: Path, header: str, columns: tuple, sentence: str, answer: dict, expected: tuple[np.ndarray, ...]
) -> None:
    path = written(tmp_path / "run.csv", header, *columns)
    with pytest.raises(UndecidedError, match=sentence):
        Recording.read(path)
    assert re.search(sentence, preview(path).undecided[0]), "it is shown with the example that the question gives"
    read = Recording.read(path, **answer)
    np.testing.assert_allclose([read.t - read.t[0], read["tau"]], expected, atol=2e-6)
    np.testing.assert_allclose(read["q"], Q, atol=1e-8)


LARGE = [f'"{1e6 * x:,.1f}"' for x in TAU]
PLAIN = [[f"{x:.9f}" for x in column] for column in (T, TAU, Q)]
GERMAN = [[x.strip('"').translate(str.maketrans(",.", ".,")) for x in one] for one in (PLAIN[0], LARGE, PLAIN[2])]
QUOTED = [[f'"{x}"'.replace(".", ",") for x in column] for column in PLAIN]
CLOCKS = {sign: [f"12:00:{int(t):02d}{sign}{round(1e3 * t) % 1000}" for t in T] for sign in ";:"}
PREAMBLE = "Written by a tool\nDate;2024/03/01\n{};mN.m;deg\nEnd of header\nt;torque;angle"
ODRIVE = "time,axis0.pos_vel_mapper.pos_rel,axis0.controller.effective_torque_setpoint"
READ = {
    "a unit that is not known, of a column that is not used": (
        "t,torque [Nm],position [rad],lost motion [reference unit]",
        (T, TAU, Q, Q),
        TAU,
        Q,
    ),
    "the last part of a path": ("time,axis.vel_mapper.pos,axis.pos_loop.torque_ref", (T, Q, TAU), TAU, Q),
    "relative positions of an ODrive, in turns": (ODRIVE, (T, Q, TAU), TAU, 2 * np.pi * Q),
    "milliseconds behind a time and a semicolon": ("Time,torque,position", (CLOCKS[";"], TAU, Q), TAU, Q),
    "milliseconds behind a time and a colon": ("Time,torque,position", (CLOCKS[":"], TAU, Q), TAU, Q),
    "thousands parted by quoted commas": ("t,torque [uN.m],q", (T, LARGE, Q), TAU, Q),
    "thousands parted by points beside decimal commas": ("t;torque [uN.m];q", GERMAN, TAU, Q),
    "quoted decimal commas between commas": ("t,torque,q", QUOTED, TAU, Q),
    **{
        f"units column by column behind {word}": (PREAMBLE.format(word), (T, TAU, Q), 1e-3 * TAU, Q / DEG)
        for word in ("Y_Unit_Label", "Vertical Units", "unit", "Einheit")
    },
}
"""Names and columns; torque and position that are meant."""


@pytest.mark.parametrize("what", READ)
def test_what_a_stranger_writes_is_read_as_it_was_meant(tmp_path: Path, what: str) -> None:
    header, columns, tau, q = READ[what]
    read = Recording.read(written(tmp_path / "run.csv", header, *columns, sep=";" if ";" in header else ","))
    np.testing.assert_allclose(read.t - read.t[0], T, atol=1e-8)
    np.testing.assert_allclose([read["tau"], read["q"]], [tau, q], atol=1e-7)
    assert set(read) - {"t", "tau", "q"} == ({"lost motion"} if "lost motion" in header else set())


TORQUES = {
    0.0070615518: ("oz-in", "ozf·in"),
    1.3558179: ("lb-ft", "ft.lbf"),
    0.11298483: ("lbf in",),
    0.0980665: ("kgf.cm",),
    1.0: ("Newton-Meter", "NM"),
    1e-3: ("mNewtonMeter",),
}
ANGLES = {180: ("Grad", "GRAD", "DEG"), 200: ("gon",), 10_800: ("′",)}
KNOWN = [(text, size, "N.m") for size, texts in TORQUES.items() for text in texts]
KNOWN += [(text, np.pi / parts, "rad") for parts, texts in ANGLES.items() for text in texts]


@pytest.mark.parametrize(("text", "size", "si"), KNOWN)
def test_torques_and_angles_of_other_countries_and_tools_are_known(text: str, size: float, si: str) -> None:
    known = unit(spelled(text))
    assert known.factor == pytest.approx(size, rel=1e-7)
    assert known.dimension == unit(si).dimension


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


@pytest.mark.parametrize("word", ["---", "#NV", "-nan(ind)", "n.a."])
def test_words_for_no_value_cost_no_other_column_and_a_single_group_is_no_thousand(tmp_path: Path, word: str) -> None:
    holes = [word if row % 90 == 5 else f"{x:.6f}" for row, x in enumerate(TAU)]
    read = Recording.read(written(tmp_path / "run.csv", "t,tau,q,load", T, TAU, Q, holes))
    assert "load" not in read
    with pytest.raises(RecordingError, match=r"holds nan at row 6, which is not a finite number \(5 such rows\)"):
        Recording.read(written(tmp_path / "run.csv", "t,tau,q", T, holes, Q))
    assert grouped(np.array(["1,931", "2,125"], dtype=object), ".").dtype == object


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


# Units: in cells, told by a measured speed or acceleration, asked for where values deny them, else assumed aloud.

TS = np.arange(3000) / 500.0
QS, VS, TAUS = np.sin(3 * TS), 3 * np.cos(3 * TS), 1.5 * np.cos(3 * TS + 0.4)
A = -9 * QS
LONG, QL = 4e-3 * np.arange(300), 9 * np.sin(0.012 * np.arange(300))
TAUL, COUNT = np.cos(5 * LONG), np.arange(300)
DEG = 180 / np.pi
NOISE = np.random.default_rng(1).normal(0, 0.02, len(TS))
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
    columns = [cells(x, unit) for x, unit in zip((1e3 * TS if units[0] else TS, TAUS, DEG * QS), units, strict=True)]
    path = written(tmp_path / "run.csv", sep.join(["time", "torque", "angle"]), *columns, sep=sep)
    if comma:
        path.write_text(path.read_text("utf-8").replace(".", ","), "utf-8")
    seen = Recording.read(path)
    np.testing.assert_allclose(seen.t, TS, atol=1e-8)
    np.testing.assert_allclose([seen["q"], seen["tau"]], [QS, TAUS], atol=1e-6)
    assert seen.units["tau"] == "N.m"


def test_lists_in_cells_are_columns_and_two_units_in_one_are_refused_with_the_line(tmp_path: Path) -> None:
    lists = [[f'"[{x:.6f}, {2 * x:.6f}]"' for x in column] for column in (QS, TAUS)]
    seen = read(tmp_path, "time,position,effort", TS, *lists, columns={"q": "position.1", "tau": "effort.1"})
    np.testing.assert_allclose(seen["q"], QS, atol=1e-6)
    bare = [[text.strip('"') for text in column] for column in lists]
    seen = read(tmp_path, "time,position,effort", TS, *bare, columns={"q": "#2", "tau": "#4"})
    np.testing.assert_allclose(seen["tau"], TAUS, atol=1e-6)
    angle = cells(DEG * QS, " deg")
    angle[700] = "3 rad"
    with pytest.raises(RecordingError, match=r'line 702 holds "rad" in column 3, which is in deg above'):
        read(tmp_path, "t,torque,angle", TS, cells(TAUS, " Nm"), angle)


# A measured speed is the slope of the position: it is v, tells units, and is no cause, as the torque again is none.


SPEEDS = {
    1.0: ("velocity", "qd"),
    DEG: ("speed_deg_s", "vel [deg/s]", "deg/s", "speed"),
    30 / np.pi: ("motor_speed [rpm]", "rpm", "Drehzahl [U/min]", "n_act"),
    1 / (2 * np.pi): ("w",),
}


@pytest.mark.parametrize(("name", "factor"), [(name, factor) for factor, names in SPEEDS.items() for name in names])
def test_the_axis_own_speed_serves_as_v_in_the_unit_that_makes_it_the_slope(
    tmp_path: Path, name: str, factor: float
) -> None:
    recording = read(tmp_path, f"t,tau,q,{name}", TS, TAUS, QS, factor * (VS + NOISE))
    assert recording.columns == ("t", "tau", "q", "v")
    np.testing.assert_allclose(recording["v"], VS + NOISE, rtol=1e-6, atol=1e-6)
    assert any("is the slope of the position and serves as v" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("name", "column", "kept"),
    [
        pytest.param("axis2_speed", np.sin(5 * TS), ("axis2_speed",), id="the speed of a neighbour"),
        pytest.param("fan_current", np.sin(11 * TS), ("fan_current",), id="a current of its own"),
        pytest.param("motor_speed", 81 * VS, (), id="the speed of another shaft"),
        pytest.param("motor_speed", 1.024 * VS, ("v",), id="a slope within 2.5 %"),
        pytest.param("motor_speed", 1.027 * VS, (), id="one that is not"),
        pytest.param("torque_mNm", 1e3 * TAUS + NOISE, (), id="the torque again"),
        pytest.param("iq", TAUS / 0.3 + NOISE, (), id="and as a current"),
    ],
)
def test_what_is_a_column_of_its_own_stays_and_what_repeats_another_is_left_out(
    tmp_path: Path, name: str, column: np.ndarray, kept: tuple[str, ...]
) -> None:
    recording = read(tmp_path, f"t,tau,q,{name}", TS, TAUS, QS, column)
    assert recording.columns == ("t", "tau", "q", *kept)
    assert bool(kept) != any(f"left out: {name}." in note for note in recording.notes)


def test_a_speed_tells_milliseconds_and_radians_and_an_acceleration_that_agrees_asks_nothing(tmp_path: Path) -> None:
    header = "t,tau,q,velocity [rad/s]"
    assert read(tmp_path, header, 1e4 * TS, TAUS, np.sin(30 * TS), 3 * np.cos(30 * TS)).sample_time == pytest.approx(
        0.02
    )
    seen = read(tmp_path, "time,torque_Nm,position,velocity_rad_s", LONG, TAUL, 10 * QL, np.gradient(10 * QL, LONG))
    assert seen.units["q"] == "rad"
    assert not any(ASSUMED in note for note in seen.notes)
    for other in (A, np.sin(11 * TS), np.roll(A, 200)):  # its own, or that of another axis
        assert "acc_rad_s2" in read(tmp_path, "time_s,torque_Nm,position_rad,acc_rad_s2", TS, TAUS, QS, other)
    said = read(tmp_path, "time_s,torque_Nm,position_rad,acc_rad_s2", 1e3 * TS, TAUS, QS, A, units={"t": "s"})
    assert said.sample_time == pytest.approx(2), "what is said is not asked for"


MS_OR_S = "--units t=ms or --units t=s"


@pytest.mark.parametrize(
    ("header", "columns", "role", "unit", "sentence"),
    [
        *(
            ("t,tau,q,velocity [rad/s]", (TS, TAUS, factor * QS, VS), "q", unit, f"only if that is in {unit}, and")
            for unit, factor in (("mrad", 1e3), ("deg", DEG), ("0.001 deg", 1e3 * DEG))
        ),
        ("t [s],tau,q [rad],velocity [rad/s]", (1e3 * TS, TAUS, QS, VS), "t", "ms", f"ms; say which it is, {MS_OR_S}"),
        ("time_s,torque_Nm,pos_rad,acc_rad_s2", (1e3 * TS, TAUS, QS, A), "t", "ms", "derivative of the position only"),
        ("time_s,torque_Nm,pos_rad,acc [deg/s^2]", (1e3 * TS, TAUS, QS, DEG * A), "t", "ms", MS_OR_S),
        ("time,torque_Nm,position,acc_rad_s2", (TS, TAUS, DEG * QS, A), "q", "deg", "--units q=deg or --units q=rad"),
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


# Units that nothing states are assumed aloud, or asked for where values are hardly in SI units.


def test_columns_without_a_unit_are_said_to_be_in_si_units_and_those_without_names_are_what_was_named(
    tmp_path: Path,
) -> None:
    header = "time,joint_effort,joint_position"
    note = next(note for note in read(tmp_path, header, LONG, TAUL, QL).notes if ASSUMED in note)
    assert '"joint_effort" (tau in N.m or N), "joint_position" (q in rad or m)' in note
    assert note.endswith("say which, for example --units tau=mN.m q=deg.")
    seen = read(tmp_path, header, LONG, TAUL, QL, units={"tau": "mN.m", "q": "deg"})
    np.testing.assert_allclose(seen["q"], np.deg2rad(QL), atol=1e-6)
    assert not any(ASSUMED in note for note in seen.notes)
    path = written(tmp_path / "run.csv", "", QL, 2 * QL, 3 * QL)
    seen = preview(path, {"columns": {"q": "#1"}, "layout": {"period": "4ms"}})
    np.testing.assert_allclose(seen.recording["q"], QL, atol=1e-6)
    assert "tau=#2" in seen.undecided[0]  # never the column that was named


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
        ("time,effort,pos", (TAUL, 2048 + COUNT % 40), POSITION, {"q": "deg"}),
        ("time,effort,motor_speed", (TAUL, np.rint(90 * np.sin(3 * LONG))), SPEED, {"v": "rpm"}),
        ("time,effort,motor_speed", (TAUL, 1500.5 + LONG), SPEED, {"v": "rpm"}),
        ("time,load,pos,torque", (TAUL, QL, COUNT % 37 - 20), "tau=N.m or tau=mN.m, or how much one", {"tau": "mN.m"}),
        ("time,torque,position,velocity", (TAUL, 10 * QL, np.gradient(10 * QL, LONG)), POSITION, {"q": "deg"}),
    ],
)
def test_a_unit_is_asked_for_where_values_are_hardly_in_si_units(
    tmp_path: Path, header: str, columns: tuple[np.ndarray, ...], option: str, answer: dict[str, str]
) -> None:
    with pytest.raises(UndecidedError, match=rf"states no unit and (goes|holds).*{re.escape(option)}"):
        read(tmp_path, header, LONG, *columns)
    read(tmp_path, header, LONG, *columns, units=answer)
