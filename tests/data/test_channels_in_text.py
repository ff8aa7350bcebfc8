"""Texts whose channels have times of their own: several columns of time, long form, camonitor, one channel a row."""

from pathlib import Path

import numpy as np
import pytest
from tables import written

from cosim.data.preview import preview
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
    return header + "".join(line.format(t=t, ms=1e3 * t, name=name, x=x) + "\n" for t, name, x in sorted(readings))


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
    "long form in milliseconds": long_form("time_ms,name,value\n", "{ms:.6g},{name},{x:.9g}"),
    "camonitor of EPICS": camonitor(),
}


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


@pytest.mark.parametrize(
    ("header", "last"),
    [("Time,Torque,Time,Position", "{t:.6g},{q:.9g}"), ("time,torque,position,state", "{q:.9g},{state}")],
)
def test_columns_of_time_that_are_alike_are_one_time_and_a_column_of_states_makes_no_long_form(
    tmp_path: Path, header: str, last: str
) -> None:
    lines = [f"{t:.6g},{torque(t):.9g}," + last.format(t=t, q=position(t), state="RUN" if t < 1 else "STOP") for t in T]
    (tmp_path / "run.csv").write_text("\n".join([header, *lines]))
    recording = Recording.read(tmp_path / "run.csv")
    assert recording.columns == ("t", "tau", "q")
    assert len(recording) == len(T)


def test_what_times_of_their_own_count_must_be_known_and_what_is_no_reading_is_left_out_with_a_note(
    tmp_path: Path,
) -> None:
    path = tmp_path / "run.txt"
    path.write_text(two_times("Time,Torque,Time,Position", factor=150.0))
    with pytest.raises(RecordingError, match=r"write the unit into the name: Time \[ms\]"):
        Recording.read(path)
    path.write_text(camonitor())
    assert "one line that is no reading was left out, such as 'M1:GONE" in " ".join(Recording.read(path).notes)


# A table whose rows hold one channel each, as an outer join of topics writes it, is put on one time base.

TR = np.arange(1200) / 1000


def sparse(path: Path, **channels: tuple[np.ndarray, np.ndarray]) -> Path:
    """Write each sample of each channel into a row of its own, if no other is of the same time."""
    table: dict[float, dict[str, float]] = {}
    for name, (t, x) in channels.items():
        for one, value in zip(t.tolist(), x.tolist(), strict=True):
            table.setdefault(round(one, 9), {})[name] = value
    times = sorted(table)
    cells = [[f"{table[t][name]:.9g}" if name in table[t] else "" for t in times] for name in channels]
    return written(path, ",".join(["t", *channels]), times, *cells)


@pytest.mark.parametrize("samples", [120, 300, 1200])
def test_two_topics_in_turn_are_joined_however_long_the_table_is(tmp_path: Path, samples: int) -> None:
    t = TR[:samples]
    channels = {"tau": (t, np.cos(9 * t)), "q": (t + 3e-4, 0.1 * np.sin(9 * t + 0.0027))}
    seen = preview(sparse(tmp_path / "run.csv", **channels))
    one = seen.recording
    assert seen.refused == ""
    assert (len(one), one.sample_time) == (samples - 1, pytest.approx(1e-3, rel=1e-6))
    np.testing.assert_allclose(one["q"], 0.1 * np.sin(9 * one.t), atol=1e-9)
    np.testing.assert_allclose(one["tau"], np.cos(9 * one.t), atol=2e-5)
    assert '"tau" (1,000 Hz, ' in one.notes[0]


def test_a_slow_column_in_full_rows_keeps_its_own_rate_and_a_third_topic_its_names(tmp_path: Path) -> None:
    late = TR[20:] + 3e-4
    channels = {"tau": (TR, np.cos(9 * TR)), "q": (TR[::10], np.sin(9 * TR[::10]))}
    one = Recording.read(sparse(tmp_path / "run.csv", **channels, temperature=(late[::50], 20 + late[::50])))
    assert one.sample_time == pytest.approx(0.01)
    np.testing.assert_allclose(one["q"], np.sin(9 * one.t), atol=1e-9)
    np.testing.assert_allclose(one["temperature"], 20 + np.clip(one.t, late[0], late[::50][-1]), atol=1e-6)
    assert one.t[0] == pytest.approx(0.01)


def test_topics_below_each_other_in_ms_are_joined(tmp_path: Path) -> None:
    """First all rows of one, then all of the other: time falls, and that is no other recording."""
    path = tmp_path / "run.csv"
    rows = [f"{1e3 * t:.1f},{np.cos(9 * t):.6f}," for t in TR] + [f"{1e3 * t:.1f},,{np.sin(9 * t):.6f}" for t in TR]
    path.write_text("\n".join(["stamp,torque,angle", *rows]) + "\n")
    for options in ({}, {"columns": {"t": "stamp"}, "units": {"t": "ms"}}):
        one = Recording.read(path, **options)
        assert (len(one), one.duration) == (len(TR), pytest.approx(TR[-1]))
        np.testing.assert_allclose(one["q"], np.sin(9 * TR), atol=1e-6)


def test_a_table_of_one_kind_of_values_in_memory_is_joined_too() -> None:
    t = np.sort(np.concatenate([TR, TR + 4e-4]))
    tau = np.where(np.arange(len(t)) % 2 == 0, np.cos(9 * t), np.nan)
    q = np.where(np.arange(len(t)) % 2 == 1, np.sin(9 * t), np.nan)
    one = Recording.of({"t": t, "tau": tau, "q": q})
    np.testing.assert_allclose(one["q"], np.sin(9 * one.t), atol=1e-12)
