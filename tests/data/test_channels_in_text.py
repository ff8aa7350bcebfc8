"""Texts whose channels have times of their own: several columns of time, long form, and the output of camonitor."""

from pathlib import Path

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.support.errors import RecordingError

T = np.arange(1500) / 500.0
SLOW = T[::2] + 0.0004


def torque(t: np.ndarray) -> np.ndarray:
    return np.asarray(1.5 * np.cos(3 * t + 0.4))


def position(t: np.ndarray) -> np.ndarray:
    return np.asarray(np.sin(3 * t))


def two_times(header: str, sign: str = ",", factor: float = 1.0) -> str:
    lines = []
    for k, t in enumerate(T):
        row = [f"{factor * t:.9g}", f"{torque(t):.9g}"]
        row += [f"{factor * SLOW[k]:.9g}", f"{position(SLOW[k]):.9g}"] if k < len(SLOW) else ["", ""]
        lines.append(sign.join(row))
    return header + "\n" + "\n".join(lines) + "\n"


def long_form(header: str, line: str = "{t:.6f},{name},{x:.9g}", names: tuple[str, str] = ("torque", "pos")) -> str:
    readings = [(t, names[0], torque(t)) for t in T] + [(t, names[1], position(t)) for t in SLOW]
    return header + "".join(line.format(t=t, name=name, x=x) + "\n" for t, name, x in sorted(readings))


def stamped(t: float) -> str:
    return str(np.datetime64("2024-03-01T12:00:00", "us") + np.timedelta64(round(1e6 * t), "us")).replace("T", " ")


def camonitor() -> str:
    readings = [(t, "M1:TORQUE", torque(t)) for t in T] + [(t, "M1:POS", position(t)) for t in SLOW]
    lines = [f"{name:30} {stamped(t)} {x:.9g}" for t, name, x in sorted(readings)]
    lines[700] += " HIGH MINOR"
    return "\n".join(["M1:GONE                        *** Not connected (PV not found)", *lines]) + "\n"


READ = {
    "a time each": two_times("Time,Torque,Time,Position"),
    "a time each with its number": two_times("Time 1;Torque;Time 2;Position", ";"),
    "a time each in milliseconds": two_times("Time [ms],Torque,Time [ms],Position", factor=1e3),
    "a time each and a row of units": two_times("Time,Torque,Time,Position\nms,Nm,ms,rad", factor=1e3),
    "LabVIEW with several X columns": two_times("X_Value\tTorque\tX_Value\tPosition", "\t"),
    "the text of VirtualBench": two_times(
        "Timestamp,2020-03-16,Timestamp,2020-03-16\nInterval,0.002,Interval,0.004\n"
        'Channel name,"Torque",Channel name,"Position"\nUnit,"Nm",Unit,"rad"'
    ),
    "long form": long_form("time,name,value\n"),
    "long form of a historian": long_form("Timestamp;Tagname;Value\n", "{t:.6f};{name};{x:.9g}"),
    "long form without names of columns": long_form(""),
    "long form with units": long_form("time,signal,value,unit\n", "{t:.6f},{name},{x:.9g},", ("torque", "pos")),
    "long form in milliseconds": long_form("time_ms,name,value\n", "{t},{name},{x:.9g}").replace("\n", "\n"),
    "camonitor of EPICS": camonitor(),
}
READ["long form in milliseconds"] = "time_ms,name,value\n" + "".join(
    f"{1e3 * float(line.split(',')[0]):.6g},{line.split(',', 1)[1]}\n" for line in long_form("").splitlines()
)


@pytest.mark.parametrize("how", READ)
def test_channels_with_times_of_their_own_are_joined_by_time(tmp_path: Path, how: str) -> None:
    path = tmp_path / "run.txt"
    path.write_text(READ[how], "utf-8")
    recording = Recording.read(path)
    assert recording.sample_time == pytest.approx(0.004, rel=1e-4)
    t = recording.t - recording.t[0] + SLOW[0]
    inner = slice(5, -5)
    np.testing.assert_allclose(recording["q"][inner], position(t)[inner], atol=1e-4)
    np.testing.assert_allclose(recording["tau"][inner], torque(t)[inner], atol=5e-3)
    assert any("channels with times of their own were put on the times of" in note for note in recording.notes)


def test_columns_of_time_that_are_alike_are_one_time(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = "".join(f"{t:.6g},{torque(t):.9g},{t:.6g},{position(t):.9g}\n" for t in T)
    path.write_text("Time,Torque,Time,Position\n" + rows)
    recording = Recording.read(path)
    assert recording.columns == ("t", "tau", "q")
    assert len(recording) == len(T)


def test_what_times_of_their_own_count_must_be_known(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(two_times("Time,Torque,Time,Position", factor=150.0))
    with pytest.raises(RecordingError, match=r"write the unit into the name: Time \[ms\]"):
        Recording.read(path)


def test_what_is_no_reading_of_camonitor_is_left_out_with_a_note(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(camonitor())
    assert "one line that is no reading was left out, such as 'M1:GONE" in " ".join(Recording.read(path).notes)


def test_a_column_of_states_makes_no_long_form(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = "".join(f"{t:.6g},{torque(t):.9g},{position(t):.9g},{'RUN' if t < 1 else 'STOP'}\n" for t in T)
    path.write_text("time,torque,position,state\n" + rows)
    assert len(Recording.read(path)) == len(T)
