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


DAYS = [f"{45352.5 + t / 86400:.11f}" for t in T]
SECONDS = [f"2024-03-01 12:00:{int(10 * t):02d}" for t in T]
SHARE = {"units": {"tau": "0.04 N.m"}}
ASKED = [
    *(
        (f"t,{name},position", (T, TAU, Q), rf'is in {stated} of a torque .*"tau=0.04 N.m"', SHARE, (T, 0.04 * TAU))
        for name, stated in (("torque [%]", "%"), ("torque_permille", "0.1 %"), ("torque (‰)", "0.1 %"))
    ),
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


def test_a_single_group_is_no_thousand() -> None:
    assert grouped(np.array(["1,931", "2,125"], dtype=object), ".").dtype == object


@pytest.mark.parametrize(
    ("text", "size", "si"),
    [
        ("oz-in", 0.0070615518, "N.m"),
        ("ozf·in", 0.0070615518, "N.m"),
        ("lb-ft", 1.3558179, "N.m"),
        ("ft.lbf", 1.3558179, "N.m"),
        ("lbf in", 0.11298483, "N.m"),
        ("kgf.cm", 0.0980665, "N.m"),
        ("Newton-Meter", 1.0, "N.m"),
        ("mNewtonMeter", 1e-3, "N.m"),
        ("NM", 1.0, "N.m"),
        ("Grad", np.pi / 180, "rad"),
        ("GRAD", np.pi / 180, "rad"),
        ("gon", np.pi / 200, "rad"),
        ("DEG", np.pi / 180, "rad"),
        ("′", np.pi / 10800, "rad"),
    ],
)
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
def test_words_for_no_value_are_told_and_cost_no_other_column(tmp_path: Path, word: str) -> None:
    holes = [word if row % 90 == 5 else f"{x:.6f}" for row, x in enumerate(TAU)]
    read = Recording.read(written(tmp_path / "run.csv", "t,tau,q,load", T, TAU, Q, holes))
    assert "load" not in read
    with pytest.raises(RecordingError, match=r"holds nan at row 6, which is not a finite number \(5 such rows\)"):
        Recording.read(written(tmp_path / "run.csv", "t,tau,q", T, holes, Q))


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
