"""Tables that people and tools write strangely: each is read as it was meant, or the sentence names what decides."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import RecordingError

ROWS = 1500
T = np.arange(ROWS) / 1500.0
"""1.5 kHz for one second: in ms a step of 0.667, which may be taken for seconds."""
Q, V, TAU = np.sin(8 * T), 8 * np.cos(8 * T), 1.5 * np.cos(8 * T + 0.4)
DEG = 180 / np.pi
LONG = np.arange(ROWS) / 500.0
"""3 s at 500 Hz."""
QL, VL, TAUL = np.sin(3 * LONG), 3 * np.cos(3 * LONG), 1.5 * np.cos(3 * LONG + 0.4)
MS = (1e3 * T, TAU, Q)
S = (LONG, TAUL, QL)


def rows(*columns: Sequence[float] | np.ndarray, separator: str = ",", decimal: str = ".", end: str = "") -> str:
    cells = [[one if isinstance(one, str) else f"{one:.9g}".replace(".", decimal) for one in c] for c in columns]
    return "".join(separator.join(row) + end + "\n" for row in zip(*cells, strict=True))


def wide(*columns: np.ndarray, names: Sequence[str] = ()) -> str:
    """A signal a line."""
    leads = [[name] for name in names] or [[] for _ in columns]
    lines = (",".join([*lead, *(f"{x:.9g}" for x in one)]) for lead, one in zip(leads, columns, strict=True))
    return "\n".join(lines) + "\n"


MITSUBISHI = "Axis1\nNumber of sampling data,4\nSampling time interval(ms),0.667\n"
TEK = [["Record Length", "2500", ""], ["Sample Interval", "4e-5", ""], ["Source", "CH1", ""]]
BESIDE = [TEK[row] if row < len(TEK) else ["", "", ""] for row in range(ROWS)]

READ = {
    # a factor of 1000: the time
    "a time called ms": ("ms,torque,position\n" + rows(*MS), MS),
    "a time called ms below a preamble": ("drive 7\n\nms;torque;position\n" + rows(*MS, separator=";"), MS),
    "a time called millisec": ("millisec,torque,position\n" + rows(*MS), MS),
    "a time called timeMs": ("timeMs,torqueNm,posRad\n" + rows(*MS), MS),
    "a time called t_msec": ("t_msec,torque,position\n" + rows(*MS), MS),
    "a time called elapsed ms": ("elapsed ms since start,torque,position\n" + rows(*MS), MS),
    "ms in braces": ("t {ms},torque {Nm},position {rad}\n" + rows(*MS), MS),
    "ms behind a comma": ('"time, ms","torque, Nm","position, rad"\n' + rows(*MS), MS),
    "ms in a second row": ("t,tau,q\nms,N.m,rad\n" + rows(*MS), MS),
    "ms in a row above the names": ("[ms],[Nm],[rad]\nt,tau,q\n" + rows(*MS), MS),
    "ms in a row of units of which one is not known": ("t,tau,q,load\nms,Nm,rad,wobble\n" + rows(*MS, Q), MS),
    "units alone": ("ms,Nm,rad\n" + rows(*MS), MS),
    "units alone in brackets": ("[ms];[Nm];[rad]\n" + rows(*MS, separator=";"), MS),
    "units in front of an unnamed time": (
        MITSUBISHI + "Time,Analog 1,Analog 2\nms,Position,Torque\n" + rows(MS[0], Q, TAU),
        MS,
    ),
    "milliseconds whose letters shout": ("Time [MS],Torque [NM],Pos [RAD]\n" + rows(*MS), MS),
    "units of a preamble, column by column": ("Unit,ms,Nm,rad\nt,tau,q\n" + rows(*MS), MS),
    # a factor of 1000: position and torque
    "mrad": ("t,tau,q [mrad]\n" + rows(LONG, TAUL, 1e3 * QL), S),
    "mdeg behind a name": ("t,tau,pos_mdeg\n" + rows(LONG, TAUL, 1e3 * DEG * QL), S),
    "thousandths of a degree": ("t,torque,position [0.001°]\n" + rows(LONG, TAUL, 1e3 * DEG * QL), S),
    "mN.m behind a blank": ("t,torque mNm,position rad\n" + rows(LONG, 1e3 * TAUL, QL), S),
    "mN.m in a second row": ("t,tau,q\ns,mN·m,mrad\n" + rows(LONG, 1e3 * TAUL, 1e3 * QL), S),
    "thousandths whose unit has a capital": ("t,tau,pos_mDeg\n" + rows(LONG, TAUL, 1e3 * DEG * QL), S),
    "thousandths of German degrees": (
        "Zeit (sek.);Drehmoment (mNm);Winkel (mGrad)\n" + rows(LONG, 1e3 * TAUL, 1e3 * DEG * QL, separator=";"),
        S,
    ),
    "a position beside its slope": ("time,effort,theta1,theta1_dot\n" + rows(*S, VL), S),
    "microradians": ("t,tau,angle_urad\n" + rows(LONG, TAUL, 1e6 * QL), S),
    # names
    "names with blanks, parted by two": ("time   motor torque   encoder position\n" + rows(*S, separator=" "), S),
    "names with blanks, parted by tabs": ("time\tmotor torque\tencoder position\n" + rows(*S, separator=" "), S),
    "names with blanks and units": ("time [s] motor torque [Nm] encoder position [rad]\n" + rows(*S, separator=" "), S),
    "names parted by commas above blanks": ("time, motor torque, position\n" + rows(*S, separator="  "), S),
    "a percent sign before the names": ("% time  torque  position\n" + rows(*S, separator=" "), S),
    "rows numbered without a name": (
        "torque position time\n"
        + "".join(f'"{k}" {line}\n' for k, line in enumerate(rows(TAUL, QL, LONG, separator=" ").splitlines(), 1)),
        S,
    ),
    "a row of types": ("time,torque,position\nLREAL,LREAL,LREAL\n" + rows(*S), S),
    "groups above the names": (
        ",axis 1,,axis 2,\ntime,torque,position,torque,position\n" + rows(LONG, TAUL, QL, 2 * TAUL, 2 * QL),
        (LONG, TAUL, QL),
        {"tau": "axis 1.torque", "q": "axis 1.position"},
    ),
    "names and the first row in one line": ("t,tau,q," + rows(*S), S),
    "names and the first row in one line of blanks": ("time torque position " + rows(*S, separator=" "), S),
    "names in single quotes": ("'t';'tau';'q'\n" + rows(*S, separator=";"), S),
    "names that end with a carriage return alone": ("t,tau,q\r" + rows(*S), S),
    "lines that end with two carriage returns": (("t,tau,q\n" + rows(*S)).replace("\n", "\r\r\n"), S),
    "empty cells behind the names": ("Time[s],Torque[Nm],Position[rad],,,,,\n" + rows(*S), S),
    "empty cells behind names without units": ("Time,Torque,Position,,,,,\n" + rows(*S), S),
    # signs around the numbers
    "semicolons at the end of rows of blanks": ("% t tau q\n" + rows(*S, separator=" ", end=";"), S),
    "semicolons at the end of rows of commas": ("%t,tau,q\n" + rows(*S, end=";"), S),
    "a matrix of MATLAB": (
        "% t tau q\nlog = [\n" + rows(*S, separator=" ", end=";") + "];\n",
        S,
    ),
    "comments between the rows": (
        "t tau q\n" + re.sub(r"(?m)^(0\.5 .*)$", r"% the load 1\n\1", rows(*S, separator=" ")),
        S,
    ),
    "comments behind the rows": ("t tau q\n" + rows(*S, separator=" ", end=" % fine"), S),
    "a last column that is often missing": (
        "t,tau,q,remark\n" + "".join(f"{one}{',9' * (k % 3 == 0)}\n" for k, one in enumerate(rows(*S).splitlines())),
        S,
    ),
    "a last column of words": (
        "t,tau,q,state\n" + rows(*S, ["RUN" if k % 5 else "FAULT 7" for k in range(ROWS)]),
        S,
    ),
    # tables
    "a signal a line": (wide(*S, names=("t", "tau", "q")), S),
    "a signal a line with its unit": (wide(1e3 * LONG, TAUL, QL, names=("t,ms", "tau,Nm", "q,rad")), S),
    "a signal a line with the unit in its name": (wide(1e3 * LONG, TAUL, QL, names=("t [ms]", "tau", "q")), S),
    "cells beside the samples": (
        rows(*zip(*BESIDE, strict=True), LONG, TAUL, QL),
        S,
        {"t": "#4", "tau": "#5", "q": "#6"},
    ),
}
"""Text, (t, tau, q) in ms or s as stated there, and the columns that a person would have to say."""


def as_read(folder: Path, text: str, columns: dict[str, str] | None = None) -> Recording:
    path = folder / "run.csv"
    path.write_text(text, encoding="utf-8", newline="")
    return Recording.read(path, columns)


@pytest.mark.parametrize("how", READ)
def test_a_strange_table_is_read_as_it_was_meant(tmp_path: Path, how: str) -> None:
    text, (t, tau, q), *said = READ[how]
    read = as_read(tmp_path, text, *said)
    seconds = t * (1e-3 if t is MS[0] else 1.0)
    np.testing.assert_allclose(read.t, seconds, atol=2e-6)
    np.testing.assert_allclose(read["tau"], tau, atol=1e-6)
    np.testing.assert_allclose(read["q"], q, atol=1e-6)


ASKED = {
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
    "no time": (
        "%timestep (500Hz),torque,position,velocity\n" + rows(np.arange(1500.0), TAUL, QL, VL),
        "has no column t; it has: timestep, tau, q, velocity. Name it with --columns t=... (for example --columns "
        "t=timestep)",
    ),
    "counts in a second row": (
        "t,tau,q\ns,Nm,inc\n" + rows(LONG, TAUL, np.rint(1e4 * QL)),
        '"q" is in counts; say how large one is, for example --units "q=0.0055 deg"',
    ),
    "a signal a line without names": (
        wide(*S),
        "does not name its 3 columns; say which is which, for example --columns t=#1 tau=#2 q=#3. First rows as read: ",
    ),
}
"""Text, and what the sentence says."""


@pytest.mark.parametrize("why", ASKED)
def test_what_a_strange_table_leaves_open_is_asked_with_the_option(tmp_path: Path, why: str) -> None:
    text, sentence = ASKED[why]
    with pytest.raises(RecordingError, match=re.escape(sentence)):
        as_read(tmp_path, text)


def test_the_option_that_show_prints_for_a_time_in_milliseconds_reads_it_so(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(ASKED["a hint of the time that keeps its unit"][0])
    shown = preview(path)
    assert "t=ms" in shown.said.partition("--units")[2]
    np.testing.assert_allclose(shown.recording.t, 1e-3 * LONG, atol=1e-9)


def test_the_unit_in_a_name_counts_where_its_owner_says_which_column_it_is(tmp_path: Path) -> None:
    read = as_read(tmp_path, "ms,a_mNm,b [mdeg]\n" + rows(*MS), {"t": "ms", "tau": "a_mNm", "q": "b"})
    np.testing.assert_allclose(read.t, T, atol=1e-8)
    np.testing.assert_allclose(read["tau"], 1e-3 * TAU, atol=1e-9)
    np.testing.assert_allclose(read["q"], 1e-3 * Q / DEG, atol=1e-10)


def test_a_first_row_that_is_one_word_with_the_names_is_left_out_with_a_note(tmp_path: Path) -> None:
    read = as_read(tmp_path, "t,tau,q" + rows(*S))
    np.testing.assert_allclose(read["q"], QL[1:], atol=1e-8)
    assert "the first row was left out; names and first value stand in it as one word." in read.notes[0]


def test_a_column_that_was_given_is_not_proposed_again(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(rows(*S, 7 * QL))
    with pytest.raises(RecordingError, match=r"for example --columns tau=#3\. First rows as read"):
        Recording.read(path, {"t": "#1", "q": "#2"})
