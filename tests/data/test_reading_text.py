"""Text is read however a machine wrote it; what can be read in two ways is refused, and the option is named."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.data.text.names import split_unit, suffixed_unit
from cosim.reading import read_recordings
from cosim.support.errors import InputError, RecordingError

ROWS = 3000
T = np.arange(ROWS) * 1e-3
TAU, Q = 2 * np.cos(7 * T), 0.1 * np.sin(7 * T)


def rows(separator: str, decimal: str = ".", columns: Sequence[np.ndarray] = (T, TAU, Q), end: str = "") -> str:
    lines = (separator.join(f"{x:.9g}".replace(".", decimal) for x in row) + end for row in zip(*columns, strict=True))
    return "\n".join(lines) + "\n"


def stamps(first: str) -> list[str]:
    start = np.datetime64(first, "ms")
    return [str(start + np.timedelta64(row, "ms")) for row in range(ROWS)]


def dated(times: Sequence[str], separator: str = ",", decimal: str = ".") -> str:
    lines = (f"{t}{separator}{tau:.9f}{separator}{q:.9f}" for t, tau, q in zip(times, TAU, Q, strict=True))
    return "\n".join(line.replace(".", decimal) if decimal != "." else line for line in lines) + "\n"


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


DEG = np.pi / 180
GERMAN = [f"{t[8:10]}.{t[5:7]}.{t[:4]} {t[11:]}" for t in stamps("2024-03-01T23:59:58")]
READ = {
    "semicolons and decimal commas": ("t;tau;q\n" + rows(";", ","), 1.0),
    "tabs": ("t\ttau\tq\n" + rows("\t"), 1.0),
    "tabs and decimal commas": ("Zeit [s]\tDrehmoment [Nm]\tWinkel [°]\n" + rows("\t", ","), DEG),
    "bars": ("t|tau|q\n" + rows("|"), 1.0),
    "blanks under a commented header": ("# t tau q\n" + rows("  "), 1.0),
    "a commented header with commas": ("# t,tau,q\n" + rows(","), 1.0),
    "units in round brackets": ("t,tau (Nm),q (deg)\n" + rows(","), DEG),
    "units as a standard divides them": ("t / s;M / Nm;phi / deg\n" + rows(";", ","), DEG),
    "units at the end of names": ("time_s,Torque_Nm,pos_deg\n" + rows(","), DEG),
    "a row of units": ("Time;Torque;Position\ns;Nm;deg\n" + rows(";", ","), DEG),
    "a row of units in brackets": ("Time,Torque,Position\n[s],[Nm],[deg]\n" + rows(","), DEG),
    "a preamble": ("Logger 7\nSerial,123\nDate,2024-03-01\n\nTime,Torque,Position\n" + rows(","), 1.0),
    "a preamble that ends with as many numbers": ("1000,0.001,5\nt,tau,q\n" + rows(","), 1.0),
    "a preamble of two lines of numbers": ("Logger 7\n12;1;0,5\n13;2;0,5\n\nt;tau;q\n" + rows(";", ","), 1.0),
    "a separator at the end of each row": ("t;tau;q;\n" + rows(";", end=";"), 1.0),
    "quoted numbers": ('"t";"tau";"q"\n"' + rows('";"', ",", end='"').replace("\n", '\n"').rstrip('"'), 1.0),
    "a byte order mark": ("\ufefft,tau,q\n" + rows(","), 1.0),
    "UTF-16": (("t,tau,q\n" + rows(",")).encode("utf-16"), 1.0),
    "UTF-16 without a mark": (("t,tau,q\n" + rows(",")).encode("utf-16-le"), 1.0),
    "cp1252": (("t;tau;q [°]\n" + rows(";", ",")).encode("cp1252"), DEG),
    "lines that end as on an old Macintosh": (("t,tau,q\n" + rows(",")).replace("\n", "\r"), 1.0),
    "lines that end as on Windows": (("t,tau,q\n" + rows(",")).replace("\n", "\r\n"), 1.0),
    "milliseconds": ("t,tau,q\n" + rows(",", columns=(T * 1e3, TAU, Q)), 1.0),
    "microseconds": ("t,tau,q\n" + rows(",", columns=(np.arange(ROWS) * 1000, TAU, Q)), 1.0),
    "nanoseconds since 1970": (
        "t,tau,q\n" + dated([str(1_709_331_184_123_456_789 + k * 10**6) for k in range(ROWS)]),
        1.0,
    ),
    "milliseconds since 1970": ("t,tau,q\n" + dated([str(1_709_331_184_123 + k) for k in range(ROWS)]), 1.0),
    "ISO time stamps": ("timestamp,torque,angle\n" + dated(stamps("2024-03-01T23:59:59")), 1.0),
    "ISO time stamps with a zone": ("time,tau,q\n" + dated([f"{t}+01:00" for t in stamps("2024-03-01T22:00:00")]), 1.0),
    "German dates": ("Uhrzeit;Moment;Lage\n" + dated(GERMAN, ";").replace("|", ";"), 1.0),
    "German dates and decimal commas": (
        "Zeit;Moment;Lage\n"
        + "".join(f"{t};{x}" for t, x in zip(GERMAN, rows(";", ",", (TAU, Q)).splitlines(True), strict=True)),
        1.0,
    ),
    "a clock past midnight": ("time,tau,q\n" + dated([t[11:] for t in stamps("2024-03-01T23:59:59")]), 1.0),
    "names that say command and actual": (
        "time,torque_cmd,torque_act,pos_act,pos_cmd,pos_error\n" + rows(",", columns=(T, TAU, -TAU, Q, 2 * Q, Q)),
        1.0,
    ),
    "a word at the end": ("t,tau,q\n" + rows(",") + "EOF\n", 1.0),
}  # fmt: skip


@pytest.mark.parametrize("how", READ)
def test_a_table_is_read_as_it_was_meant(tmp_path: Path, how: str) -> None:
    text, angle = READ[how]
    recording = Recording.read(written(tmp_path / "run.csv", text))
    np.testing.assert_allclose(recording.t - recording.t[0], T, atol=1e-9)
    np.testing.assert_allclose(recording["tau"], TAU, atol=1e-8)
    np.testing.assert_allclose(recording["q"], angle * Q, atol=1e-8)


def test_a_set_point_is_found_where_names_have_to_be_read(tmp_path: Path) -> None:
    recording = Recording.read(written(tmp_path / "run.csv", READ["names that say command and actual"][0]))
    np.testing.assert_allclose(recording["q_d"], 2 * Q, atol=1e-8)
    said = " ".join(recording.notes)
    assert 'tau = "torque_cmd", q = "pos_act", q_d = "pos_cmd"' in said
    assert 'no unit is stated for "torque_cmd" (tau in N.m or N), "pos_act" (q in rad or m)' in said
    assert "were left out: torque_act." in said


def test_where_our_own_names_stand_only_a_set_point_of_another_name_is_read(tmp_path: Path) -> None:
    text = "t,tau,q,setpoint_position,motor_temperature\n" + rows(",", columns=(T, TAU, Q, 2 * Q, TAU))
    recording = Recording.read(written(tmp_path / "run.csv", text))
    assert recording.columns == ("t", "tau", "q", "q_d", "motor_temperature")
    np.testing.assert_allclose(recording["q_d"], 2 * Q, atol=1e-8)
    assert ['q_d = "setpoint_position"; --columns says it otherwise.' in note for note in recording.notes] == [True]


@pytest.mark.parametrize("names", ["q_d,q_ref", "q_ref,q_cmd"])
def test_of_two_set_points_none_is_guessed(tmp_path: Path, names: str) -> None:
    text = f"t,tau,q,{names}\n" + rows(",", columns=(T, TAU, Q, 2 * Q, 3 * Q))
    recording = Recording.read(written(tmp_path / "run.csv", text))
    assert recording.columns == ("t", "tau", "q", *names.split(","))
    assert recording.notes == ()


def test_when_a_recording_began_is_kept(tmp_path: Path) -> None:
    recording = Recording.read(written(tmp_path / "run.csv", READ["ISO time stamps"][0]))
    assert recording.origin["start"] == "2024-03-01T23:59:59.000"


REFUSED = {
    "no names": (rows(","), "does not name its 3 columns; say which is which, for example --columns t=#1 tau=#2 q=#3."),
    "no names and no time": (rows(",", columns=(TAU, Q)), "--columns tau=#1 q=#2 --layout period=1ms."),
    "columns of words alone": ("1,a\nb,2\n" * 20, "say which is which, for example --layout period=1ms."),
    "20 Hz or 20 kHz": (
        "t,tau,q\n" + rows(",", columns=(np.arange(60_000) * 50.0, np.resize(TAU, 60_000), np.resize(Q, 60_000))),
        '"t" steps by 50, which is 20 Hz in ms or 2e+04 Hz in us. Say which with --units t=ms.',
    ),
    "two torques": (
        "time,torque_1,torque_2,pos\n" + rows(",", columns=(T, TAU, TAU, Q)),
        "tau may be any of torque_1, torque_2; say which, for example --columns tau=torque_1.",
    ),
    "one name with two units": (
        "t,tau,q [deg],q [rad]\n" + rows(",", columns=(T, TAU, Q, Q)),
        "q may be any of q [deg], q [rad]; say which, for example --columns 'q=q [deg]'.",
    ),
    "one name twice": ("t,tau,q,q\n" + rows(",", columns=(T, TAU, Q, Q)), "q may be any of q (#3), q (#4)"),
    "a current": ("time,iq,pos\n" + rows(","), 'no torque but a current, "iq". With the torque constant KT of the'),
    "commas that part and commas in numbers": ("t,tau,q\n" + rows(",", ","), "has 3 names of columns and 6 fields in"),
    "no time": ("tau,q\n" + rows(",", columns=(TAU, Q)), "or, if its rows are evenly spaced, say --layout period=1ms."),
    "a row that is torn in the middle": (
        ("t,tau,q\n" + rows(",")).replace("\n0.1,", "\n0.1\n", 1),
        "row 101 has 1 fields where the others have 3: '0.1'.",
    ),
}  # fmt: skip


@pytest.mark.parametrize("why", REFUSED)
def test_what_is_ambiguous_is_refused_with_the_option_that_decides(tmp_path: Path, why: str) -> None:
    text, sentence = REFUSED[why]
    with pytest.raises(RecordingError, match=re.escape(sentence)):
        Recording.read(written(tmp_path / "run.csv", text))


@pytest.mark.parametrize(
    ("why", "columns", "units", "layout"),
    [
        ("no names", {"t": "#1", "tau": "#2", "q": "#3"}, {}, {}),
        ("no names and no time", {"tau": "#1", "q": "#2"}, {}, {"period": "1ms"}),
        ("two torques", {"tau": "torque_1"}, {}, {}),
        ("one name with two units", {"q": "q [rad]"}, {}, {}),
        ("one name twice", {"q": "#4"}, {}, {}),
        ("a current", {"tau": "iq"}, {"tau": "1 N.m"}, {}),
        ("no time", {}, {}, {"period": "0.001"}),
    ],
)
def test_the_option_that_a_refusal_names_decides(
    tmp_path: Path, why: str, columns: dict[str, str], units: dict[str, str], layout: dict[str, str]
) -> None:
    recording = Recording.read(written(tmp_path / "run.csv", REFUSED[why][0]), columns, units, layout=layout)
    np.testing.assert_allclose(recording["tau"], TAU, atol=1e-8)
    np.testing.assert_allclose(recording["q"], Q, atol=1e-8)
    np.testing.assert_allclose(recording.sample_time, 1e-3, rtol=1e-9)


def test_the_unit_of_an_ambiguous_time_can_be_stated(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", REFUSED["20 Hz or 20 kHz"][0])
    assert Recording.read(path, units={"t": "us"}).sample_time == pytest.approx(5e-5)


def test_seconds_stay_seconds_where_they_are_stated(tmp_path: Path) -> None:
    text = "t [s],tau,q\n" + rows(",", columns=(T * 1e3, TAU, Q))
    assert Recording.read(written(tmp_path / "run.csv", text)).sample_time == 1.0


@pytest.mark.parametrize("column", ["#0", "#4", "#²", "#" + "9" * 5000])
def test_a_number_that_no_column_has_is_named(tmp_path: Path, column: str) -> None:
    path = written(tmp_path / "run.csv", "t,tau,q\n" + rows(","))
    with pytest.raises(RecordingError, match=r'no column "#'):
        Recording.read(path, columns={"q": column})


def test_the_names_of_a_text_may_be_stated_by_their_line(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "a,b,c\nt,tau,q\nx,y,z\n" + rows(","))
    assert Recording.read(path, layout={"header": "2"}).columns == ("t", "tau", "q")


@pytest.mark.parametrize("header", ["-1", "9999", "²", "9" * 5000, "1e400", "two"])
def test_what_is_no_line_of_the_text_is_refused(tmp_path: Path, header: str) -> None:
    path = written(tmp_path / "run.csv", "t,tau,q\n" + rows(","))
    with pytest.raises(RecordingError, match=r"^--layout header=.{1,100}: it is the line of the names, from 1 to"):
        Recording.read(path, layout={"header": header})


def test_a_separator_and_a_decimal_sign_can_be_stated(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", READ["semicolons and decimal commas"][0])
    layout = {"separator": "semicolon", "decimal": "comma"}
    np.testing.assert_allclose(Recording.read(path, layout=layout)["q"], Q, atol=1e-8)
    with pytest.raises(RecordingError, match='"colon" is none; choices are: comma, semicolon, tab, blank, bar'):
        Recording.read(path, layout={"separator": "colon"})


@pytest.mark.parametrize("period", ["0", "-1ms", "soon", "1.0.0ms", "1 h"])
def test_a_period_is_a_time(tmp_path: Path, period: str) -> None:
    path = written(tmp_path / "run.csv", REFUSED["no time"][0])
    with pytest.raises(RecordingError, match="it is the time between two rows, for example 1ms"):
        Recording.read(path, layout={"period": period})


def test_a_period_is_refused_where_rows_are_missing(tmp_path: Path) -> None:
    text = rows(" ", columns=(TAU[:1000], Q[:1000])) + "overrun\n" + rows(" ", columns=(TAU[1000:], Q[1000:]))
    with pytest.raises(RecordingError, match=r"needs evenly spaced rows: .*such as 'overrun'"):
        Recording.read(written(tmp_path / "run.txt", text), {"tau": "#1", "q": "#2"}, layout={"period": "1ms"})


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("q [deg]", "q", "deg"),
        ("q (deg)", "q", "deg"),
        ("q (ref)", "q (ref)", ""),
        ("tau (Nm)", "tau", "Nm"),
        ("effort[0]", "effort[0]", ""),
        ("x [furlong]", "x", "furlong"),
        ("Drehzahl in 1/min", "Drehzahl", "rpm"),
        ("speed/rad/s", "speed/rad/s", ""),
        ("Position (Degrees)", "Position", "deg"),
        ("v [rad/(s)]", "v", "rad/(s)"),
        ("in s", "time", "s"),
        ("[ms]", "time", "ms"),
        ("X1 Lageistwert/mm", "X1 Lageistwert", "mm"),
        ("/axis/position/rad", "/axis/position/rad", ""),
        ("[V]", "[V]", "V"),
    ],
)
def test_a_unit_is_parted_from_a_name(header: str, name: str, unit: str) -> None:
    assert split_unit(header) == (name, unit)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("Torque_mNm", "mNm"),
        ("pos_deg", "deg"),
        ("vel_rad_s", "rad/s"),
        ("t_us", "us"),
        ("force_kN", "kN"),
        ("position_mm", "mm"),
        ("q_m", ""),
        ("load_A", ""),
    ],
)
def test_a_unit_may_end_a_name(name: str, unit: str) -> None:
    assert suffixed_unit(name) == unit


def two_files(folder: Path) -> list[Path]:
    one = written(folder / "run1.csv", "t,tau,q\n" + rows(","))
    return [one, written(folder / "run3.csv", "t,load,current,q\n" + rows(",", columns=(T, Q, TAU, Q)))]


def test_options_may_hold_for_one_file(tmp_path: Path) -> None:
    paths = two_files(tmp_path)
    given, units = ["run3.csv:tau=current"], [f"{paths[1]}:q=deg", "tau=mN.m"]
    first, second = read_recordings(paths, {}, given, units, "rotary")
    np.testing.assert_allclose([first["tau"], second["tau"]], [1e-3 * TAU, 1e-3 * TAU], atol=1e-8)
    np.testing.assert_allclose([first["q"], second["q"]], [Q, DEG * Q], atol=1e-8)


@pytest.mark.parametrize(
    ("given", "units", "layout", "sentence"),
    [
        (["run4.csv:tau=current"], [], [], '"run4.csv", which is not among: run1.csv, run3.csv. Did you mean "run'),
        (["run3:tau=curent"], [], [], 'no column "curent" to serve as tau; it has: t, load, current, q. Did you mean'),
        (["tau=current,q=q"], [], [], "Several go with spaces: --columns tau=current q=q."),
        (["run3:tau=current"], ["run3:tau=A"], [], "a current becomes one with the constant of the motor"),
        (["run3:tau=current"], ["run3:tau=V"], [], "it is a torque or force, in N.m or a unit that becomes it"),
        ([], [], ["decimals=comma"], '"decimals" is no key; keys there are: separator, decimal, header'),
    ],
)  # fmt: skip
def test_options_that_do_not_fit_are_named(
    tmp_path: Path, given: list[str], units: list[str], layout: list[str], sentence: str
) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)):
        read_recordings(two_files(tmp_path), {}, given, units, "rotary", layout)
