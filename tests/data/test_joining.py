"""Channels with times of their own become one table: common span, gaps that stay, nothing invented between samples."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.data.columns import Columns, Request
from cosim.data.joining import on_one_time
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


def test_samples_that_are_invalid_are_a_gap_too() -> None:
    read = np.where((T > 2) & (T < 2.3), np.nan, position(T))
    found = joined(channels(Torque=(T, torque(T)), Angle=(T, read)))
    np.testing.assert_array_equal(found.values["t"], T[np.isfinite(read)])
    assert 'run: invalid samples were left out: 299 of "Angle".' in found.notes


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


def test_a_slower_torque_gives_the_rows_and_the_position_is_read_on_a_curve() -> None:
    slow = T[::7] + 0.0004
    found = joined(channels(Torque=(slow, torque(slow)), Angle=(T, position(T))))
    np.testing.assert_array_equal(found.values["Torque"], torque(found.values["t"]))
    np.testing.assert_allclose(found.values["Angle"][1:-1], position(found.values["t"])[1:-1], atol=1e-10)


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


def test_of_equally_fast_channels_the_position_stays_as_it_was_read() -> None:
    late = T + 0.0003
    found = joined(channels(Torque=(T, torque(T)), Angle=(late, position(late))))
    np.testing.assert_array_equal(found.values["Angle"], position(found.values["t"]))
    np.testing.assert_allclose(found.values["Torque"], torque(found.values["t"]), atol=5 * 16 * 1e-6 / 8)


def test_a_set_point_holds_until_the_next() -> None:
    slow = T[::100]
    found = joined(channels(torque=(T, torque(T)), pos=(T, position(T)), pos_setpoint=(slow, np.floor(10 * slow))))
    np.testing.assert_array_equal(found.values["pos_setpoint"], np.floor(10 * found.values["t"] + 1e-9))


def test_a_slow_temperature_is_read_on_a_line_and_holds_for_one_period_at_its_ends() -> None:
    slow = np.arange(0.1, 3.95, 0.2)
    found = joined(channels(tau=(T, torque(T)), q=(T, position(T)), temperature=(slow, 20 + slow)))
    np.testing.assert_array_equal(found.values["t"], T)
    np.testing.assert_allclose(found.values["temperature"], 20 + np.clip(T, slow[0], slow[-1]))
    assert '"temperature" (5 Hz, ' in found.notes[0]
    assert "0.3 s apart" in found.notes[0]


def test_a_channel_that_would_cost_too_many_rows_or_holds_a_text_is_left_out() -> None:
    words = np.array(["bad" if k == 7 else 0.0 for k in range(len(T))], dtype=object)
    found = joined(channels(tau=(T, torque(T)), q=(T, position(T)), fan=(T[:2000], T[:2000]), word=(T, words)))
    assert list(found.values) == ["t", "tau", "q"]
    assert len(found.values["t"]) == len(T)
    assert "run: channels that do not cover these rows were left out: fan." in found.notes


def test_a_position_of_one_turn_is_not_read_between_its_end_and_its_start() -> None:
    turned = np.mod(3 * T, 2 * np.pi)
    slow = T[::10] + 0.0005
    found = joined(channels(tau=(slow, torque(slow)), q=(T, turned)))
    np.testing.assert_allclose(found.values["q"], 3 * found.values["t"], atol=1e-9)


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
