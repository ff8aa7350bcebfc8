"""What can be read in two ways is refused with the option that decides, and what does not fit is named."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from tables import rows

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.data.text.names import split_unit, suffixed_unit
from cosim.reading import read_recordings
from cosim.support.errors import InputError, RecordingError

T = np.arange(3000) * 1e-3
TAU, Q = 2 * np.cos(7 * T), 0.1 * np.sin(7 * T)
DEG = 180 / np.pi
LONG = np.arange(1500) / 500.0
QL, VL, TAUL = np.sin(3 * LONG), 3 * np.cos(3 * LONG), 1.5 * np.cos(3 * LONG + 0.4)
S = (LONG, TAUL, QL)
MS = (1e3 / 3 * LONG, TAUL, QL)
"""A step of 0.667 ms, which may be taken for seconds."""


def three(separator: str, decimal: str = ".", columns: Sequence[np.ndarray] = (T, TAU, Q)) -> str:
    return rows(*columns, separator=separator, decimal=decimal)


def written(path: Path, text: str) -> Path:
    path.write_bytes(text.encode())
    return path


def as_read(folder: Path, text: str, columns: dict[str, str] | None = None, **more: dict[str, str]) -> Recording:
    return Recording.read(written(folder / "run.csv", text), columns, **more)


ASKED = {
    "no names": (
        three(","),
        "does not name its 3 columns; say which is which, for example --columns t=#1 tau=#2 q=#3.",
    ),
    "no names and no time": (three(",", columns=(TAU, Q)), "--columns tau=#1 q=#2 --layout period=1ms."),
    "columns of words alone": ("1,a\nb,2\n" * 20, "say which is which, for example --layout period=1ms."),
    "20 Hz or 20 kHz": (
        "t,tau,q\n" + three(",", columns=(np.arange(60_000) * 50.0, np.resize(TAU, 60_000), np.resize(Q, 60_000))),
        '"t" steps by 50, which is 20 Hz in ms or 2e+04 Hz in us. Say which with --units t=ms.',
    ),
    "two torques": (
        "time,torque_1,torque_2,pos\n" + three(",", columns=(T, TAU, TAU, Q)),
        "tau may be any of torque_1, torque_2; say which, for example --columns tau=torque_1.",
    ),
    "one name with two units": (
        "t,tau,q [deg],q [rad]\n" + three(",", columns=(T, TAU, Q, Q)),
        "q may be any of q [deg], q [rad]; say which, for example --columns 'q=q [deg]'.",
    ),
    "one name twice": ("t,tau,q,q\n" + three(",", columns=(T, TAU, Q, Q)), "q may be any of q (#3), q (#4)"),
    "a current": ("time,iq,pos\n" + three(","), 'no torque but a current, "iq". With the torque constant KT of the'),
    "commas that part and commas in numbers": ("t,tau,q\n" + three(",", ","), "has 3 names of columns and 6 fields in"),
    "no time": ("tau,q\n" + three(",", columns=(TAU, Q)), "if its rows are evenly spaced, say --layout period=1ms."),
    "a row that is torn in the middle": (
        ("t,tau,q\n" + three(",")).replace("\n0.1,", "\n0.1\n", 1),
        "row 101 has 1 fields where the others have 3: '0.1'.",
    ),
    "a name that says ms above a row that says s": (
        "t_ms,tau,q\ns,Nm,rad\n" + rows(*MS),
        'states two units for "t_ms", ms and s; say which it is in, --units t=ms or --units t=s. First rows as read: '
        "t_ms 0, 0.6666667, 1.333333.",
    ),
    "brackets that say mrad above a row that says rad": (
        "t,tau,q [mrad]\ns,Nm,rad\n" + rows(*S),
        'states two units for "q", mrad and rad; say which it is in, --units q=mrad or --units q=rad.',
    ),
    "a time in ms that steps by less than one": ("t,tau,q\n" + rows(*MS), "Say which with --units t=ms."),
    "a hint of the time that keeps its unit": (
        "ms (drive),tau,q\n" + rows(*S),
        "for example --columns 't=ms (drive)' --units t=ms",
    ),
    "a unit that is not known in a second row": (
        "t,torque,position\ns,stone,rad\n" + rows(*S),
        '"stone" of column "torque" is no unit known here; say which it is in, for example --units tau=mN.m.',
    ),
    "names with blanks above blanks": (
        "time motor torque position\n" + rows(*S, separator=" "),
        'has names that do not fit its 3 columns, "time motor torque position"; say which is which, for example '
        "--columns t=#1 tau=#2 q=#3. First rows as read: #1 0, 0.002, 0.004; #2 1.381",
    ),
    "names that are fewer than columns": ("t,tau,q\n" + rows(*S, 7 * QL), "has names that do not fit its 4 columns"),
    "a comma in the last column alone": (
        "t,tau,q\n" + rows(*S[:2], [f"{x:.3f}".replace(".", ",") for x in QL]),
        'has names that do not fit its 4 columns, "t,tau,q"; say which is which',
    ),
    "volts alone": ("[s],[V],[Nm]\n" + rows(LONG, QL, TAUL), "has no column q or v; it has: t, [V], tau"),
    "a sensor in volts": (
        "time_s,torque,encoder_V\n" + rows(LONG, TAUL, QL),
        '"encoder_V" is in V; say how much one V is, for example --units "q=0.1 rad"',
    ),
    "a q-axis current and no position": (
        "t,torque,Iq,Vq,psi_q\n" + rows(LONG, TAUL, QL, QL, QL),
        "has no column q or v; it has: t, tau, Iq, Vq, psi_q. Name it with --columns q=...",
    ),
    "a unit that is not known in brackets behind one that is": (
        "t,tau,Winkel (kGrad)\n" + rows(*S),
        '"kGrad" of column "Winkel (kGrad)" is no unit known here',
    ),
    "steps and no time": (
        "%timestep (500Hz),torque,position,velocity\n" + rows(np.arange(1500.0), TAUL, QL, VL),
        "has no column t; it has: timestep, tau, q, velocity. Name it with --columns t=... (for example --columns "
        "t=timestep)",
    ),
    "counts in a second row": (
        "t,tau,q\ns,Nm,inc\n" + rows(LONG, TAUL, np.rint(1e4 * QL)),
        '"q" is in counts; say how large one is, for example --units "q=0.0055 deg"',
    ),
    "a signal a line without names": (
        rows(*np.transpose(S)),
        "does not name its 3 columns; say which is which, for example --columns t=#1 tau=#2 q=#3. First rows as read: ",
    ),
}
"""Text, and what the sentence says."""


@pytest.mark.parametrize("why", ASKED)
def test_what_is_ambiguous_is_refused_with_the_option_that_decides(tmp_path: Path, why: str) -> None:
    text, sentence = ASKED[why]
    with pytest.raises(RecordingError, match=re.escape(sentence)):
        as_read(tmp_path, text)


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
        ("20 Hz or 20 kHz", {}, {"t": "20 us"}, {}),
    ],
)
def test_the_option_that_a_refusal_names_decides(
    tmp_path: Path, why: str, columns: dict[str, str], units: dict[str, str], layout: dict[str, str]
) -> None:
    recording = as_read(tmp_path, ASKED[why][0], columns, units=units, layout=layout)
    np.testing.assert_allclose(recording["tau"][: len(T)], TAU, atol=1e-8)
    np.testing.assert_allclose(recording["q"][: len(T)], Q, atol=1e-8)
    np.testing.assert_allclose(recording.sample_time, 1e-3, rtol=1e-9)


def test_the_option_that_show_prints_for_a_time_in_milliseconds_reads_it_so(tmp_path: Path) -> None:
    shown = preview(written(tmp_path / "run.csv", ASKED["a hint of the time that keeps its unit"][0]))
    assert "t=ms" in shown.said.partition("--units")[2]
    np.testing.assert_allclose(shown.recording.t, 1e-3 * LONG, atol=1e-9)


PLAIN = "t,tau,q\n" + three(",")
HOLE = three(" ", columns=(TAU[:1000], Q[:1000])) + "overrun\n" + three(" ", columns=(TAU[1000:], Q[1000:]))
LINE, PERIOD = (
    "^--layout header=.{1,100}: it is the line of the names, from 1 to",
    "it is the time between two rows, for ex",
)
UNFIT: list[tuple[str, dict[str, str], dict[str, str], str]] = [
    *((PLAIN, {"q": column}, {}, 'no column "#') for column in ("#0", "#4", "#²", "#" + "9" * 5000)),
    *((PLAIN, {}, {"header": line}, LINE) for line in ("-1", "9999", "²", "9" * 5000, "1e400", "two")),
    *((PLAIN, {}, {"period": one}, PERIOD) for one in ("0", "-1ms", "soon", "1.0.0ms", "1 h")),
    (HOLE, {"tau": "#1", "q": "#2"}, {"period": "1ms"}, "needs evenly spaced rows: .*such as 'overrun'"),
    (PLAIN, {}, {"separator": "colon"}, '"colon" is none; choices are: comma, semicolon, tab, blank, bar'),
    (rows(*S, 7 * QL), {"t": "#1", "q": "#2"}, {}, r"for example --columns tau=#3\. First rows as read"),
]


@pytest.mark.parametrize(("text", "columns", "layout", "sentence"), UNFIT)
def test_an_option_that_does_not_fit_the_text_is_refused(
    tmp_path: Path, text: str, columns: dict[str, str], layout: dict[str, str], sentence: str
) -> None:
    with pytest.raises(RecordingError, match=sentence):
        as_read(tmp_path, text, columns, layout=layout)


@pytest.mark.parametrize(
    ("names", "q_d", "notes"),
    [
        ("setpoint_position,motor_temperature", "setpoint_position", ['q_d = "setpoint_position"; --columns says it']),
        ("q_d,q_ref", "q_d", []),
        ("q_ref,q_cmd", "", []),
    ],
)
def test_a_set_point_of_another_name_is_read_beside_our_own_names_and_of_two_none_is_guessed(
    tmp_path: Path, names: str, q_d: str, notes: list[str]
) -> None:
    recording = as_read(tmp_path, f"t,tau,q,{names}\n" + rows(T, TAU, Q, 2 * Q, 3 * Q))
    assert list(recording.columns) == ["t", "tau", "q", *("q_d" if one == q_d else one for one in names.split(","))]
    assert not q_d or np.allclose(recording["q_d"], 2 * Q, atol=1e-8)
    assert [note in said for note, said in zip(notes, recording.notes, strict=True)] == [True] * len(notes)


def test_what_names_were_taken_for_is_said_and_when_a_recording_began_is_kept(tmp_path: Path) -> None:
    text = "time,torque_cmd,torque_act,pos_act,pos_cmd,pos_error\n" + rows(T, TAU, -TAU, Q, 2 * Q, Q)
    recording = as_read(tmp_path, text)
    np.testing.assert_allclose(recording["q_d"], 2 * Q, atol=1e-8)
    said = " ".join(recording.notes)
    assert 'tau = "torque_cmd", q = "pos_act", q_d = "pos_cmd"' in said
    assert 'no unit is stated for "torque_cmd" (tau in N.m or N), "pos_act" (q in rad or m)' in said
    assert "were left out: torque_act." in said
    stamps = [str(np.datetime64("2024-03-01T23:59:59", "ms") + np.timedelta64(row, "ms")) for row in range(len(T))]
    dated = as_read(tmp_path, "timestamp,torque,angle\n" + rows(stamps, TAU, Q))
    assert dated.origin["start"] == "2024-03-01T23:59:59.000"
    read = as_read(tmp_path, "t,tau,q" + rows(*S))
    np.testing.assert_allclose(read["q"], QL[1:], atol=1e-8)
    assert "the first row was left out; names and first value stand in it as one word." in read.notes[0]


@pytest.mark.parametrize(
    ("parted", "header", "said"),
    [
        (split_unit, "q (ref)", ("q (ref)", "")),
        (split_unit, "effort[0]", ("effort[0]", "")),
        (split_unit, "x [furlong]", ("x", "furlong")),
        (split_unit, "Drehzahl in 1/min", ("Drehzahl", "rpm")),
        (split_unit, "speed/rad/s", ("speed/rad/s", "")),
        (split_unit, "Position (Degrees)", ("Position", "deg")),
        (split_unit, "v [rad/(s)]", ("v", "rad/(s)")),
        (split_unit, "in s", ("time", "s")),
        (split_unit, "X1 Lageistwert/mm", ("X1 Lageistwert", "mm")),
        (split_unit, "/axis/position/rad", ("/axis/position/rad", "")),
        (split_unit, "[V]", ("[V]", "V")),
        (suffixed_unit, "vel_rad_s", "rad/s"),
        (suffixed_unit, "t_us", "us"),
        (suffixed_unit, "force_kN", "kN"),
        (suffixed_unit, "position_mm", "mm"),
        (suffixed_unit, "q_m", ""),
        (suffixed_unit, "load_A", ""),
    ],
)
def test_a_unit_is_parted_from_a_name_and_may_end_it(
    parted: Callable[[str], object], header: str, said: object
) -> None:
    assert parted(header) == said


def two_files(folder: Path) -> list[Path]:
    one = written(folder / "run1.csv", PLAIN)
    return [one, written(folder / "run3.csv", "t,load,current,q\n" + rows(T, Q, TAU, Q))]


def test_options_may_hold_for_one_file(tmp_path: Path) -> None:
    paths = two_files(tmp_path)
    given, units = ["run3.csv:tau=current"], [f"{paths[1]}:q=deg", "tau=mN.m"]
    first, second = read_recordings(paths, {}, given, units, "rotary")
    np.testing.assert_allclose([first["tau"], second["tau"]], [1e-3 * TAU, 1e-3 * TAU], atol=1e-8)
    np.testing.assert_allclose([first["q"], second["q"]], [Q, Q / DEG], atol=1e-8)


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
