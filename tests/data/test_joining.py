"""Channels with times of their own become one table: common span, gaps that stay, nothing invented; and in texts."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tables import written

from cosim.data.columns import Columns, Request
from cosim.data.joining import on_one_time
from cosim.data.preview import preview
from cosim.data.recording import REQUIRED, Recording
from cosim.support.errors import RecordingError

PATH = Path("run.mf4")
T = np.arange(4000) / 1000


def position(t: np.ndarray) -> np.ndarray:
    return np.asarray(0.3 * np.sin(4 * t) + 0.05 * t)


def torque(t: np.ndarray) -> np.ndarray:
    return np.asarray(5 * np.cos(4 * t))


def channels(**own: tuple[np.ndarray, np.ndarray]) -> Columns:
    """Channels, each (times, values); equal names of units as a file states them."""
    return Columns({name: x for name, (_, x) in own.items()}, clocks={name: t for name, (t, _) in own.items()})


def joined(found: Columns, required: tuple[str, ...] = REQUIRED, **columns: str) -> Columns:
    return on_one_time(Request(PATH, columns, required=required), found)


SHORT = {"late": T >= 1, "early": T < 2.5, "both": (T >= 0.7) & (T < 3.1), "gap": (T < 1) | (T > 1.5)}


@pytest.mark.parametrize("part", SHORT)
@pytest.mark.parametrize("short", ["Torque", "Angle"])
def test_only_the_common_span_is_kept_and_a_gap_of_a_channel_is_a_gap_of_the_recording(part: str, short: str) -> None:
    there, whole = SHORT[part], {"Torque": torque(T), "Angle": position(T)}
    found = joined(channels(**{name: (T[there], x[there]) if name == short else (T, x) for name, x in whole.items()}))
    np.testing.assert_array_equal(found.values["t"], T[there])
    for name, x in whole.items():
        np.testing.assert_array_equal(found.values[name], x[there])
    assert '"Angle" (1,000 Hz, ' in found.notes[0]
    assert 'the times of "Torque" (1,000 Hz, ' in found.notes[0]
    assert ("1 gap)" in found.notes[0]) == (part == "gap")


def test_invalid_samples_are_a_gap_too_and_nothing_is_read_between_the_end_and_the_start_of_a_turn() -> None:
    read = np.where((T > 2) & (T < 2.3), np.nan, position(T))
    found = joined(channels(Torque=(T, torque(T)), Angle=(T, read)))
    np.testing.assert_array_equal(found.values["t"], T[np.isfinite(read)])
    assert 'run: invalid samples were left out: 299 of "Angle".' in found.notes
    turned = np.mod(3 * T, 2 * np.pi)
    slow = T[::10] + 0.0005
    found = joined(channels(tau=(slow, torque(slow)), q=(T, turned)))
    np.testing.assert_allclose(found.values["q"], 3 * found.values["t"], atol=1e-9)


def test_a_faster_torque_is_its_mean_over_the_interval_of_each_row() -> None:
    """The mean keeps the impulse: a pulse of 3 ms between two positions of 10 ms is in one row."""
    pulse = np.where((T >= 1.0085) & (T < 1.0115), 10.0, 0.0)
    slow = T[::10]
    found = joined(channels(Torque=(T, pulse), Angle=(slow, position(slow))))
    t, mean = found.values["t"], found.values["Torque"]
    np.testing.assert_array_equal(found.values["Angle"], position(t))
    assert mean[np.argmin(np.abs(t - 1.01))] == pytest.approx(3.0)
    assert 0.01 * mean.sum() == pytest.approx(1e-3 * pulse.sum())
    assert '"Torque" (1,000 Hz, 0 s to 3.999 s) by its mean' in found.notes[0]
    assert 'times of "Angle" (100 Hz' in found.notes[0]


def test_a_slower_torque_gives_the_rows_and_of_equally_fast_ones_the_position_stays_as_it_was_read() -> None:
    slow, late = T[::7] + 0.0004, T + 0.0003
    found = joined(channels(Torque=(slow, torque(slow)), Angle=(T, position(T)))).values
    np.testing.assert_array_equal(found["Torque"], torque(found["t"]))
    np.testing.assert_allclose(found["Angle"][1:-1], position(found["t"])[1:-1], atol=1e-10)  # on a curve
    found = joined(channels(Torque=(T, torque(T)), Angle=(late, position(late)))).values
    np.testing.assert_array_equal(found["Angle"], position(found["t"]))
    np.testing.assert_allclose(found["Torque"], torque(found["t"]), atol=5 * 16 * 1e-6 / 8)


@pytest.mark.parametrize(("closer", "missing", "lines"), [(2.8e-4, [], [98, 100]), (0.0, [100, 101], [98, 102])])
def test_a_position_is_read_on_a_line_beside_a_short_step_or_a_hole(
    closer: float, missing: list[int], lines: list[int]
) -> None:
    """A curve through two samples that nearly coincide, or through a hole, swings between them."""
    kept = np.delete(np.arange(200), missing)
    t, x = T[kept] + closer * ((kept == 99) - 1.0 * (kept == 100)), np.cos(kept * np.pi / 2)
    slow = T[10:190:2] + 3e-4
    found = joined(channels(Torque=(slow, torque(slow)), Angle=(t, x))).values
    is_line = np.isclose(found["Angle"], np.interp(found["t"], t, x), atol=1e-9)
    np.testing.assert_array_equal(found["t"][is_line], slow[np.array(lines) // 2 - 5])


def test_a_set_point_holds_a_temperature_is_read_on_a_line_and_what_costs_too_much_is_left_out() -> None:
    slow, warm = T[::100], np.arange(0.1, 3.95, 0.2)
    words = np.array(["bad" if k == 7 else 0.0 for k in range(len(T))], dtype=object)
    others = {"fan": (T[:2000], T[:2000]), "word": (T, words), "temperature": (warm, 20 + warm)}
    found = joined(channels(tau=(T, torque(T)), q=(T, position(T)), q_d=(slow, np.floor(10 * slow)), **others))
    assert {*found.values} == {"t", "tau", "q", "q_d", "temperature"}
    np.testing.assert_array_equal(found.values["t"], T)
    np.testing.assert_array_equal(found.values["q_d"], np.floor(10 * T + 1e-9))
    np.testing.assert_allclose(
        found.values["temperature"], 20 + np.clip(T, warm[0], warm[-1])
    )  # for a period at its ends
    said = " ".join(found.notes)
    assert '"temperature" (5 Hz, ' in said
    assert "0.3 s apart" in said
    assert "run: channels that do not cover these rows were left out: fan." in found.notes
    assert "run: channels without numbers of their own times were left out: word." in found.notes


def test_channels_of_one_time_are_a_table_and_those_without_a_common_time_are_refused() -> None:
    found = joined(channels(tau=(T, torque(T)), q=(T, position(T))))
    assert found.notes == ()
    np.testing.assert_array_equal(found.values["q"], position(T))
    rule = r'run.mf4: "Torque" \(1,000 Hz, 0 s to 3.999 s\) and "Angle" .* no times in common'
    with pytest.raises(RecordingError, match=rule):
        joined(channels(Torque=(T, torque(T)), Angle=(T + 10, position(T))))


@settings(max_examples=60, deadline=None)
@given(
    rates=st.tuples(st.floats(50, 2000), st.floats(50, 2000)),
    starts=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    jitter=st.floats(0, 0.3),
    seed=st.integers(0, 2**32 - 1),
)
def test_whatever_the_clocks_no_value_comes_from_outside_its_channel(
    rates: tuple[float, float], starts: tuple[float, float], jitter: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    clocks = [
        start + (np.arange(int(3 * rate)) + jitter * rng.uniform(-0.5, 0.5, int(3 * rate))) / rate
        for rate, start in zip(rates, starts, strict=True)
    ]
    found = joined(channels(tau=(clocks[0], torque(clocks[0])), q=(clocks[1], position(clocks[1]))))
    t, slowest = found.values["t"], 1 / min(rates)
    assert t[0] >= max(clock[0] for clock in clocks) - slowest
    assert t[-1] <= min(clock[-1] for clock in clocks) + slowest
    assert len(t) >= 0.9 * (min(c[-1] for c in clocks) - max(c[0] for c in clocks)) * min(rates) - 5
    np.testing.assert_allclose(found.values["q"], position(t), atol=5 * slowest**2)
    np.testing.assert_allclose(found.values["tau"], torque(t), atol=0.2 + 20 * slowest)


def test_mdf_groups_of_two_devices_are_joined_and_bits_of_invalidity_count(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "two.mf4"
    bad = (T > 2) & (T < 2.1)
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(torque(T), T, name="Torque", unit="Nm", invalidation_bits=bad)], acq_name="drive")
        late = T[T >= 1]
        file.append([asammdf.Signal(position(late), late, name="Angle", unit="rad")], acq_name="encoder")
        file.append([asammdf.Signal(np.zeros(100), T[:100], name="Angle", unit="rad")], acq_name="old encoder")
        file.save(path)
    recording = Recording.read(path, {"q": "encoder.Angle"})
    np.testing.assert_array_equal(recording.t, T[(T >= 1) & ~bad])
    np.testing.assert_array_equal(recording["q"], position(recording.t))
    assert any('put on the times of "Torque"' in note for note in recording.notes)


# Texts whose channels have times of their own: several columns of time, long form, camonitor, one channel a row.

TC = np.arange(1500) / 500.0
SLOW = TC[::2] + 0.0004


def two_times(header: str, sign: str = ",", factor: float = 1.0) -> str:
    lines = []
    for k, t in enumerate(TC):
        row = [f"{factor * t:.9g}", f"{torque(t):.9g}"]
        row += [f"{factor * SLOW[k]:.9g}", f"{position(SLOW[k]):.9g}"] if k < len(SLOW) else ["", ""]
        lines.append(sign.join(row))
    return header + "\n" + "\n".join(lines) + "\n"


def long_form(header: str, line: str = "{t:.6f},{name},{x:.9g}", names: tuple[str, str] = ("torque", "pos")) -> str:
    readings = [(t, names[0], torque(t)) for t in TC] + [(t, names[1], position(t)) for t in SLOW]
    return header + "".join(line.format(t=t, ms=1e3 * t, name=name, x=x) + "\n" for t, name, x in sorted(readings))


def stamped(t: float) -> str:
    return str(np.datetime64("2024-03-01T12:00:00", "us") + np.timedelta64(round(1e6 * t), "us")).replace("T", " ")


def camonitor() -> str:
    readings = [(t, "M1:TORQUE", torque(t)) for t in TC] + [(t, "M1:POS", position(t)) for t in SLOW]
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
    lines = [
        f"{t:.6g},{torque(t):.9g}," + last.format(t=t, q=position(t), state="RUN" if t < 1 else "STOP") for t in TC
    ]
    (tmp_path / "run.csv").write_text("\n".join([header, *lines]))
    recording = Recording.read(tmp_path / "run.csv")
    assert recording.columns == ("t", "tau", "q")
    assert len(recording) == len(TC)


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


def test_topics_below_each_other_in_ms_and_a_table_in_memory_are_joined_too(tmp_path: Path) -> None:
    """First all rows of one, then all of the other: time falls, and that is no other recording."""
    path = tmp_path / "run.csv"
    rows = [f"{1e3 * t:.1f},{np.cos(9 * t):.6f}," for t in TR] + [f"{1e3 * t:.1f},,{np.sin(9 * t):.6f}" for t in TR]
    path.write_text("\n".join(["stamp,torque,angle", *rows]) + "\n")
    for options in ({}, {"columns": {"t": "stamp"}, "units": {"t": "ms"}}):
        one = Recording.read(path, **options)
        assert (len(one), one.duration) == (len(TR), pytest.approx(TR[-1]))
        np.testing.assert_allclose(one["q"], np.sin(9 * TR), atol=1e-6)
    t = np.sort(np.concatenate([TR, TR + 4e-4]))
    tau = np.where(np.arange(len(t)) % 2 == 0, np.cos(9 * t), np.nan)
    q = np.where(np.arange(len(t)) % 2 == 1, np.sin(9 * t), np.nan)
    one = Recording.of({"t": t, "tau": tau, "q": q})
    np.testing.assert_allclose(one["q"], np.sin(9 * one.t), atol=1e-12)
