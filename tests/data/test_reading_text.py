"""Text is read as it was meant, however a machine, a tool or a person wrote it."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from tables import rows

from cosim.data.recording import Recording

T = np.arange(3000) * 1e-3
TAU, Q = 2 * np.cos(7 * T), 0.1 * np.sin(7 * T)
RAD = (T, TAU, Q)
DEG = 180 / np.pi
DEGREES = (*RAD[:2], RAD[2] / DEG)
T15 = np.arange(1500) / 1500.0
"""1.5 kHz for one second: in ms a step of 0.667, which may be taken for seconds."""
RAPID = (T15, 1.5 * np.cos(8 * T15 + 0.4), np.sin(8 * T15))
MS = (1e3 * T15, *RAPID[1:])
LONG = np.arange(1500) / 500.0
QL, VL, TAUL = np.sin(3 * LONG), 3 * np.cos(3 * LONG), 1.5 * np.cos(3 * LONG + 0.4)
S = (LONG, TAUL, QL)


def three(separator: str, decimal: str = ".", columns: Sequence[np.ndarray] = RAD, end: str = "") -> str:
    return rows(*columns, separator=separator, decimal=decimal, end=end)


def stamps(first: str) -> list[str]:
    start = np.datetime64(first, "ms")
    return [str(start + np.timedelta64(row, "ms")) for row in range(len(T))]


def dated(times: Sequence[str], separator: str = ",") -> str:
    return rows(times, TAU, Q, separator=separator)


MITSUBISHI = "Axis1\nNumber of sampling data,4\nSampling time interval(ms),0.667\n"
TEK = [["Record Length", "2500", ""], ["Sample Interval", "4e-5", ""], ["Source", "CH1", ""]]
BESIDE = [TEK[row] if row < len(TEK) else ["", "", ""] for row in range(len(LONG))]

GERMAN = [f"{t[8:10]}.{t[5:7]}.{t[:4]} {t[11:]}" for t in stamps("2024-03-01T23:59:58")]
READ = {
    # separators, numbers, lines, dates
    "semicolons and decimal commas": ("t;tau;q\n" + three(";", ","), RAD),
    "tabs": ("t\ttau\tq\n" + three("\t"), RAD),
    "tabs and decimal commas": ("Zeit [s]\tDrehmoment [Nm]\tWinkel [°]\n" + three("\t", ","), DEGREES),
    "bars": ("t|tau|q\n" + three("|"), RAD),
    "blanks under a commented header": ("# t tau q\n" + three("  "), RAD),
    "a commented header with commas": ("# t,tau,q\n" + three(","), RAD),
    "units in round brackets": ("t,tau (Nm),q (deg)\n" + three(","), DEGREES),
    "units as a standard divides them": ("t / s;M / Nm;phi / deg\n" + three(";", ","), DEGREES),
    "units at the end of names": ("time_s,Torque_Nm,pos_deg\n" + three(","), DEGREES),
    "a row of units": ("Time;Torque;Position\ns;Nm;deg\n" + three(";", ","), DEGREES),
    "a row of units in brackets": ("Time,Torque,Position\n[s],[Nm],[deg]\n" + three(","), DEGREES),
    "a preamble": ("Logger 7\nSerial,123\nDate,2024-03-01\n\nTime,Torque,Position\n" + three(","), RAD),
    "a preamble that ends with as many numbers": ("1000,0.001,5\nt,tau,q\n" + three(","), RAD),
    "a preamble of two lines of numbers": ("Logger 7\n12;1;0,5\n13;2;0,5\n\nt;tau;q\n" + three(";", ","), RAD),
    "a separator at the end of each row": ("t;tau;q;\n" + three(";", end=";"), RAD),
    "quoted numbers": ('"t";"tau";"q"\n"' + three('";"', ",", end='"').replace("\n", '\n"').rstrip('"'), RAD),
    "a byte order mark": ("\ufefft,tau,q\n" + three(","), RAD),
    "UTF-16": (("t,tau,q\n" + three(",")).encode("utf-16"), RAD),
    "UTF-16 without a mark": (("t,tau,q\n" + three(",")).encode("utf-16-le"), RAD),
    "cp1252": (("t;tau;q [°]\n" + three(";", ",")).encode("cp1252"), DEGREES),
    "lines that end as on an old Macintosh": (("t,tau,q\n" + three(",")).replace("\n", "\r"), RAD),
    "lines that end as on Windows": (("t,tau,q\n" + three(",")).replace("\n", "\r\n"), RAD),
    "milliseconds": ("t,tau,q\n" + three(",", columns=(T * 1e3, TAU, Q)), RAD),
    "microseconds": ("t,tau,q\n" + three(",", columns=(1_000_000 * T, TAU, Q)), RAD),
    "nanoseconds since 1970": (
        "t,tau,q\n" + dated([str(1_709_331_184_123_456_789 + k * 10**6) for k in range(len(T))]),
        RAD,
    ),
    "milliseconds since 1970": ("t,tau,q\n" + dated([str(1_709_331_184_123 + k) for k in range(len(T))]), RAD),
    "ISO time stamps": ("timestamp,torque,angle\n" + dated(stamps("2024-03-01T23:59:59")), RAD),
    "ISO time stamps with a zone": ("time,tau,q\n" + dated([f"{t}+01:00" for t in stamps("2024-03-01T22:00:00")]), RAD),
    "German dates": ("Uhrzeit;Moment;Lage\n" + dated(GERMAN, ";"), RAD),
    "German dates and decimal commas": (
        "Zeit;Moment;Lage\n"
        + "".join(f"{t};{x}" for t, x in zip(GERMAN, three(";", ",", (TAU, Q)).splitlines(True), strict=True)),
        RAD,
    ),
    "a clock past midnight": ("time,tau,q\n" + dated([t[11:] for t in stamps("2024-03-01T23:59:59")]), RAD),
    "names that say command and actual": (
        "time,torque_cmd,torque_act,pos_act,pos_cmd,pos_error\n" + three(",", columns=(T, TAU, -TAU, Q, 2 * Q, Q)),
        RAD,
    ),
    "a word at the end": ("t,tau,q\n" + three(",") + "EOF\n", RAD),
    # a factor of 1000: the time
    "a time called ms": ("ms,torque,position\n" + rows(*MS), RAPID),
    "a time called ms below a preamble": ("drive 7\n\nms;torque;position\n" + rows(*MS, separator=";"), RAPID),
    "a time called millisec": ("millisec,torque,position\n" + rows(*MS), RAPID),
    "a time called timeMs": ("timeMs,torqueNm,posRad\n" + rows(*MS), RAPID),
    "a time called t_msec": ("t_msec,torque,position\n" + rows(*MS), RAPID),
    "a time called elapsed ms": ("elapsed ms since start,torque,position\n" + rows(*MS), RAPID),
    "ms in braces": ("t {ms},torque {Nm},position {rad}\n" + rows(*MS), RAPID),
    "ms behind a comma": ('"time, ms","torque, Nm","position, rad"\n' + rows(*MS), RAPID),
    "ms in a second row": ("t,tau,q\nms,N.m,rad\n" + rows(*MS), RAPID),
    "ms in a row above the names": ("[ms],[Nm],[rad]\nt,tau,q\n" + rows(*MS), RAPID),
    "ms in a row of units of which one is not known": ("t,tau,q,load\nms,Nm,rad,wobble\n" + rows(*MS, MS[2]), RAPID),
    "units alone": ("ms,Nm,rad\n" + rows(*MS), RAPID),
    "units alone in brackets": ("[ms];[Nm];[rad]\n" + rows(*MS, separator=";"), RAPID),
    "units in front of an unnamed time": (
        MITSUBISHI + "Time,Analog 1,Analog 2\nms,Position,Torque\n" + rows(MS[0], MS[2], MS[1]),
        RAPID,
    ),
    "milliseconds whose letters shout": ("Time [MS],Torque [NM],Pos [RAD]\n" + rows(*MS), RAPID),
    "units of a preamble, column by column": ("Unit,ms,Nm,rad\nt,tau,q\n" + rows(*MS), RAPID),
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
        S,
        {"columns": {"tau": "axis 1.torque", "q": "axis 1.position"}},
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
    "a matrix of MATLAB": ("% t tau q\nlog = [\n" + rows(*S, separator=" ", end=";") + "];\n", S),
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
        "t,tau,q,state\n" + rows(*S, ["RUN" if k % 5 else "FAULT 7" for k in range(len(LONG))]),
        S,
    ),
    # tables
    "a signal a line": (rows(("t", "tau", "q"), *zip(*S, strict=True)), S),
    "a signal a line with its unit": (rows(("t,ms", "tau,Nm", "q,rad"), *zip(*MS, strict=True)), RAPID),
    "a signal a line with the unit in its name": (
        rows(("t [ms]", "tau", "q"), *zip(1e3 * LONG, TAUL, QL, strict=True)),
        S,
    ),
    "cells beside the samples": (
        rows(*zip(*BESIDE, strict=True), LONG, TAUL, QL),
        S,
        {"columns": {"t": "#4", "tau": "#5", "q": "#6"}},
    ),
    # what a person states counts
    "the line of the names": ("a,b,c\nt,tau,q\nx,y,z\n" + three(","), RAD, {"layout": {"header": "2"}}),
    "separator and decimal sign": (
        "t;tau;q\n" + three(";", ","),
        RAD,
        {"layout": {"separator": "semicolon", "decimal": "comma"}},
    ),
    "seconds that are stated": ("t [s],tau,q\n" + rows(1e3 * T, TAU, Q), (1e3 * T, TAU, Q)),
    "the unit in a name where its owner says which column it is": (
        "ms,a_mNm,b [mdeg]\n" + rows(MS[0], 1e3 * MS[1], 1e3 * DEG * MS[2]),
        RAPID,
        {"columns": {"t": "ms", "tau": "a_mNm", "q": "b"}},
    ),
}
"""Text, (t, tau, q) that are meant, and the options that a person would have to give."""


@pytest.mark.parametrize("how", READ)
def test_a_table_is_read_as_it_was_meant(tmp_path: Path, how: str) -> None:
    text, (t, tau, q), *options = READ[how]
    path = tmp_path / "run.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    recording = Recording.read(path, **(options[0] if options else {}))
    np.testing.assert_allclose(recording.t - recording.t[0], t, atol=1e-8)
    np.testing.assert_allclose([recording["tau"], recording["q"]], [tau, q], atol=1e-8)
