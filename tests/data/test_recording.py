"""A recording is read as it is, judged in one sentence, and never repaired; signals are made, or replay one."""

import errno
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calls import calls_of
from pydantic import TypeAdapter, ValidationError
from tables import written

from cosim.data.recording import Recording
from cosim.data.set_points import PIECE, Star
from cosim.data.signals import (
    Chirp,
    Generator,
    Multisine,
    Noise,
    Ramp,
    Recorded,
    Sidereal,
    Signal,
    Sine,
    Slews,
    Steps,
    check_signal,
)
from cosim.data.star import SIDEREAL_RATE
from cosim.data.writer import StreamWriter
from cosim.support.errors import InputError, OutputError, RecordingError, SignalError, UnitError
from cosim.support.units import conversion, unit

ROWS = 200


def columns(rows: int = ROWS) -> dict[str, np.ndarray]:
    t = np.arange(rows) * 1e-3
    return {"t": t, "tau": 2 * np.cos(7 * t), "q": 0.1 * np.sin(7 * t)}


def csv_file(path: Path, table: dict[str, np.ndarray], header: str = "") -> Path:
    cells = [[x if isinstance(x, str) else repr(float(x)) for x in column] for column in table.values()]
    return written(path, header or ",".join(table), *cells)


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".csv.gz"])
def test_what_is_written_is_read_back_bit_for_bit_and_parquet_keeps_units_and_origin(
    tmp_path: Path, suffix: str
) -> None:
    table = columns() | {"temperature": np.full(ROWS, 20.5)}
    recording = Recording("run", table, {"t": "s", "tau": "N", "q": "m"}, {"command": "cosim run x"})
    back = Recording.read(recording.write(tmp_path / f"run{suffix}"))
    assert back.columns == ("t", "tau", "q", "temperature")
    assert all(np.array_equal(back[name], recording[name]) for name in recording)
    assert len(back.sha256) == 64
    if suffix == ".parquet":
        assert back.units == {"t": "s", "tau": "N", "q": "m"}
        assert back.origin["command"] == "cosim run x"


def test_units_of_the_user_become_si_and_those_of_different_kinds_do_not_mix(tmp_path: Path) -> None:
    table = columns() | {"q_d": columns()["q"], "temperature": np.full(ROWS, 68.0)}
    path = csv_file(tmp_path / "run.csv", table, "t [ms],tau,q,q_d,temperature")
    units = {"tau": "mN.m", "q": "arcsec", "temperature": "degF"}
    recording = Recording.read(path, units=units)
    assert recording.units == {"t": "s", "tau": "N.m", "q": "rad", "q_d": "rad", "temperature": "degC"}
    np.testing.assert_allclose(recording["q"], table["q"] * np.pi / 648000)
    np.testing.assert_array_equal(recording["q_d"], recording["q"])
    np.testing.assert_allclose(recording["temperature"], 20.0)
    np.testing.assert_allclose(recording.sample_time, 1e-6)
    assert conversion("N.m", "mN.m") == (1000.0, 0.0)
    assert conversion("", "V") == (1.0, 0.0)
    with pytest.raises(UnitError, match=r'"N.m" cannot become "rad": they are different kinds of quantity'):
        conversion("N.m", "rad")
    with pytest.raises(InputError, match='"furlong" is no unit known here; known are: 1, %,'):
        unit("furlong")


def test_gaps_and_jitter_are_reported_and_left_as_they_are(tmp_path: Path) -> None:
    keep = np.r_[0:50, 60:ROWS]
    table = {name: column[keep] for name, column in columns().items()}
    table["t"] = table["t"] + np.random.default_rng(1).uniform(-5e-5, 5e-5, len(keep))
    recording = Recording.read(csv_file(tmp_path / "run.csv", table))
    (gap,) = recording.gaps
    assert (gap.row, gap.missing) == (50, 10)
    np.testing.assert_array_equal(recording.t, table["t"])
    assert recording.jitter == pytest.approx(5e-5 / 1e-3 * np.sqrt(2 / 3), rel=0.1)  # two even draws
    jitter, gaps = recording.quality()
    assert "jitters" in jitter
    assert "1 gap(s)" in gaps


def test_columns_are_renamed_a_name_taken_over_is_kept_and_what_is_no_number_is_left_out(tmp_path: Path) -> None:
    table = columns() | {"force": 3 * columns()["tau"], "note": np.full(ROWS, np.nan)}
    recording = Recording.read(csv_file(tmp_path / "run.csv", table), {"tau": "force"})
    assert recording.columns == ("t", "tau_original", "q", "tau")
    np.testing.assert_array_equal(recording["tau"], table["force"])
    assert recording.quality()[-1] == (
        'run: column "note" was left out because it holds nan at row 1, which is not a finite number (200 such rows).'
    )


def spoiled(name: str, row: int, value: float) -> dict[str, np.ndarray]:
    table = columns()
    table[name][row] = value
    return table


FULL = columns()
OOPS = {"tau": ["1"] * 3 + ["oops"] * 197}


@pytest.mark.parametrize(
    ("table", "given", "sentence"),
    [
        (spoiled("t", 100, 0.0), {}, "time runs backwards at row 101 (0.099 s to 0 s). These are 2 recordings, if"),
        (spoiled("t", 100, 0.099), {}, 'stands still at row 101 (0.099 s to 0.099 s) and its rows differ: "q" is '),
        (spoiled("q", 6, np.nan), {}, 'column "q" holds nan at row 7, which is not a finite number.'),
        (spoiled("tau", 6, np.inf), {}, 'column "tau" holds inf at row 7, which is not a finite number.'),
        (FULL | {"q": np.full(ROWS, np.inf)}, {}, 'column "q" holds inf at row 1, which is not a finite number ('),
        (FULL | {"q": np.full(ROWS, 2.5)}, {}, 'column "q" is 2.5 in every row; a constant signal tells nothing.'),
        (FULL | {"tau": np.zeros(ROWS)}, {}, 'column "tau" is 0 in every row; a constant signal tells nothing.'),
        (columns(9), {}, "has 9 rows; at least 100 are needed."),
        (FULL | OOPS, {}, 'column "tau" holds "oops" at row 4, which is not a number'),
        (FULL, {"columns": {"tau": "torque"}}, 'has no column "torque" to serve as tau; it has: t, tau, q.'),
        (FULL, {"units": {"position": "deg"}}, 'has no column "position" to give a unit to; it has: t, tau, q.'),
        (FULL, {"columns": {"load": "tau"}}, "has no column tau; it has: t, load, q. Name it with --columns tau=..."),
        (FULL, {"columns": {"angle": "q"}}, "has no column q or v; it has: t, tau, angle."),
        (FULL, {"required": ("tau", "cable|oil")}, "has no column cable or oil; it has: t, tau, q. Name it with "),
    ],
)
def test_numbers_that_break_a_rule_and_names_that_are_not_there_are_named(
    tmp_path: Path, table: dict[str, np.ndarray], given: dict[str, Any], sentence: str
) -> None:
    path = csv_file(tmp_path / "run.csv", table)
    with pytest.raises(RecordingError, match=re.escape(sentence)) as caught:
        Recording.read(path, **given)
    assert str(path) in str(caught.value)


def test_nothing_is_overwritten_or_left_half_written(tmp_path: Path) -> None:
    recording = Recording("run", columns())
    path = recording.write(tmp_path / "run.csv")
    with pytest.raises(OutputError, match=r"run.csv exists already; give --force to overwrite it."):
        recording.write(path)
    recording.write(path, force=True)
    with pytest.raises(OutputError, match=r"cannot be written; a recording becomes: .parquet, .csv, .csv.gz"):
        recording.write(tmp_path / "run.xlsx")
    with pytest.raises(OutputError, match=r"cannot be made: .*run.csv is a file"):
        recording.write(path / "deeper" / "run.csv")
    assert [item.name for item in tmp_path.iterdir()] == ["run.csv"]


def test_a_stream_is_a_complete_file_even_when_the_run_breaks(tmp_path: Path) -> None:
    table = columns()

    def interrupted() -> None:
        with StreamWriter(tmp_path / "run.parquet", {"t": "s", "tau": "", "q": "rad"}, {}) as file:
            file.write(table)
            file.origin["interrupted"] = True
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    back = Recording.read(tmp_path / "run.parquet")
    assert back.origin["interrupted"] is True
    np.testing.assert_array_equal(back["q"], table["q"])


def test_a_stream_that_finds_the_disk_full_says_so_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("cosim.data.writer.GROUP", 1)
    monkeypatch.setattr("pyarrow.parquet.ParquetWriter.write_table", full)
    stream = StreamWriter(tmp_path / "run.parquet", {"t": "s", "tau": "", "q": "rad"}, {})
    stream.write(columns())
    with pytest.raises(OSError, match="No space left"):
        stream.write(columns())
    with pytest.raises(OutputError, match=r"run.parquet cannot be written: No space left on device."):
        stream.close()
    assert not list(tmp_path.iterdir())


# Signals: motions whose parts belong together, noise that a seed repeats, recordings replayed by a stated rule.

STEP = 1e-4
SLEWS: dict[str, Any] = {"kind": "slews", "max_velocity": 0.5, "max_acceleration": 2.0, "max_jerk": 20.0}
MOTIONS = [
    Sine(kind="sine", frequency=0.7, amplitude=0.3, phase=0.4, smooth_start=0.8),
    Sine(kind="sine", frequency=0.2, max_velocity=3.634e-4),
    Multisine(kind="multisine", frequencies=[0.3, 1.1, 2.9], amplitudes=[1.0, 0.5, 0.1], seed=4, smooth_start=1.0),
    Chirp(kind="chirp", start=0.1, stop=3.0, duration=4.0, amplitude=0.2),
    Slews(positions=[0.0, 1.0, 0.99, -0.2], dwell=0.1, **SLEWS),
    Ramp(kind="ramp", velocity=0.4, start=1.0, smooth_start=0.5),
]


def values(signal: Signal, ticks: int = 30_000, chunk: int = 30_000) -> np.ndarray:
    stream = signal.stream(STEP)
    return np.concatenate([stream(np.arange(k, min(k + chunk, ticks))) for k in range(0, ticks, chunk)], axis=1)


@pytest.mark.parametrize("signal", MOTIONS, ids=lambda signal: signal.kind)
def test_velocity_and_acceleration_are_the_derivatives(signal: Signal) -> None:
    position, velocity, acceleration = values(signal)
    for whole, slope, allowed in ((position, velocity, 2e-5), (velocity, acceleration, 3e-3)):
        difference = (whole[2:] - whole[:-2]) / (2 * STEP)
        np.testing.assert_allclose(difference, slope[1:-1], atol=allowed * np.abs(slope).max())
    assert list(signal.outputs.values()) == ["rad", "rad/s", "rad/s2"]


def test_a_smooth_start_begins_at_rest_and_ends_in_the_sine_which_reaches_its_greatest_velocity() -> None:
    whole, plain = (
        values(Sine(kind="sine", frequency=0.7, amplitude=0.3, phase=0.4, smooth_start=start)) for start in (0.8, 0.0)
    )
    np.testing.assert_array_equal(whole[:, 0], 0.0)
    np.testing.assert_array_equal(whole[:, 8000:], plain[:, 8000:])
    assert values(Sine(kind="sine", frequency=0.5, max_velocity=3.0))[1].max() == 3.0


@pytest.mark.parametrize("jerk", [2.0, 20.0, 1e4])
@pytest.mark.parametrize("distance", [1e-3, 0.1, 1.0])
def test_slews_keep_their_limits_and_arrive(jerk: float, distance: float) -> None:
    limits = SLEWS | {"max_jerk": jerk}
    q, v, a = values(Slews(positions=[0.2, 0.2 + distance, 0.2], dwell=0.3, **limits), ticks=120_000)
    assert np.abs(v).max() <= 0.5 * (1 + 1e-9)
    assert np.abs(a).max() <= 2.0 * (1 + 1e-9)
    assert np.abs(np.diff(a)).max() <= jerk * STEP * (1 + 1e-6)
    np.testing.assert_allclose((q.max(), q.min(), q[-1]), (0.2 + distance, 0.2, 0.2), atol=1e-12)
    np.testing.assert_array_equal((v[-1], a[-1]), (0.0, 0.0))
    at_rest = int(np.sum((v == 0) & (np.abs(q - 0.2 - distance) < 1e-12)))
    assert abs(at_rest - 3000) <= 2


def test_programmes_rest_step_and_turn_when_they_say() -> None:
    q, v, _ = values(Slews(positions=[0.0, 0.1, 0.2], dwell=[0.2, 1.0, 0.0], **SLEWS), ticks=60_000)
    for position, seconds in ((0.0, 0.2), (0.1, 1.0)):
        at_rest = int(np.sum((v == 0) & (np.abs(q - position) < 1e-12)))
        assert abs(at_rest * STEP - seconds) <= 2 * STEP
    steps = Steps(kind="steps", times=[0.0003, 0.0007], values=[1.0, -2.0], initial=0.5)
    np.testing.assert_array_equal(values(steps, 9)[0], [0.5] * 3 + [1.0] * 4 + [-2.0] * 2)
    position, velocity, acceleration = values(Sidereal(kind="sidereal", start=0.5))
    np.testing.assert_array_equal((velocity[-1], acceleration[-1]), (SIDEREAL_RATE, 0.0))
    np.testing.assert_allclose(2 * np.pi / SIDEREAL_RATE, 86164.1, atol=0.05)  # once in a sidereal day
    np.testing.assert_allclose(position, 0.5 + SIDEREAL_RATE * STEP * np.arange(30_000), atol=1e-15)
    smooth = values(Sidereal(kind="sidereal", start=0.5, smooth_start=1.0))
    np.testing.assert_array_equal(smooth[:, 0], [0.5, 0.0, 0.0])
    star = values(Star(kind="star", latitude_deg=49.0, declination_deg=30.0), ticks=1)
    np.testing.assert_allclose(star[3:5, 0], [np.deg2rad(90 - 49 + 30), 0.0], atol=1e-12)  # it culminates at the start


@pytest.mark.parametrize(("ticks", "chunk"), [(1000, 7), (2 * PIECE + 5, 9000)])
@pytest.mark.parametrize("signal", [*MOTIONS, Noise(kind="noise", rms=2.0, seed=3)], ids=lambda signal: signal.kind)
def test_chunks_do_not_matter(signal: Signal, ticks: int, chunk: int) -> None:
    np.testing.assert_array_equal(values(signal, ticks, chunk), values(signal, ticks, ticks))


def test_a_sum_of_many_sines_takes_them_together_and_adds_them_in_their_order() -> None:
    many = Multisine(kind="multisine", frequencies=np.linspace(0.1, 400, 3000).tolist(), amplitudes=1e-3)
    values(many, 1, 1)  # what is loaded once
    assert calls_of(lambda: values(many, 1, 1)) < 300, "46; each sine apart 12,000"
    together = values(many, 40, 40)
    np.testing.assert_array_equal(values(many, 40, 1), together)


def test_a_sum_of_too_many_sines_is_refused_with_what_to_do_and_few_may_go_on_for_ever() -> None:
    gusts = Multisine(kind="multisine", frequencies=[0.1 * k for k in range(1, 11)], amplitudes=1e-3)
    check_signal("gusts", gusts, 1e-4, 10**9)
    many = Multisine(kind="multisine", frequencies=np.linspace(0.1, 400, 100_000).tolist(), amplitudes=1e-3)
    check_signal("sum", many, 1e-4, 20_000)
    rule = "has 100,000 frequencies; in 150,000 steps that is 1.5e+10 sines, and 2e+09 are the most. Take fewer"
    with pytest.raises(SignalError, match=re.escape(rule)):
        check_signal("sum", many, 1e-4, 150_000)


def test_noise_is_white_and_the_phases_of_a_multisine_lie_all_around_as_their_seeds_say() -> None:
    one = values(Noise(kind="noise", rms=2.0, seed=3))[0]
    np.testing.assert_array_equal(one, values(Noise(kind="noise", rms=2.0, seed=3))[0])
    assert not np.array_equal(one, values(Noise(kind="noise", rms=2.0, seed=4))[0])
    assert abs(one.std() - 2.0) < 0.05  # five standard deviations of the estimate
    assert abs(np.corrcoef(one[1:], one[:-1])[0, 1]) < 0.03
    """Forty tones of 1 to 40 Hz over one second: a Fourier sum gives each its amplitude and its phase."""
    t, hertz = np.arange(1000) / 1000, np.arange(1.0, 41.0)

    def tones(seed: int) -> np.ndarray:
        one = Multisine(kind="multisine", frequencies=hertz.tolist(), amplitudes=0.5, seed=seed)
        return np.fft.rfft(np.asarray(one.motion(t)[0]))[1:41] / 500

    first, again, other = tones(1), tones(1), tones(2)
    np.testing.assert_allclose(np.abs(first), 0.5, rtol=1e-9)
    np.testing.assert_array_equal(first, again)
    for found in (first, other):
        turns = np.sort(np.mod(np.angle(found) / (2 * np.pi), 1))
        assert np.diff([*turns, turns[0] + 1]).max() < 0.3, "no third of the circle is without"
    assert np.abs(first - other).max() > 0.1


def test_a_recording_is_replayed_held_or_joined_and_one_that_cannot_be_is_named(tmp_path: Path) -> None:
    table = {"t": 5.0 + np.arange(4) * 2e-4, "load": np.array([1.0, 3.0, 2.0, 2.0])}
    path = Recording("run", table).write(tmp_path / "run.csv")
    held = Recorded(kind="recorded", file=path, column="load", interpolation="hold")
    joined = Recorded(kind="recorded", file=path, column="load")
    np.testing.assert_array_equal(values(held, 9)[0], [1, 1, 3, 3, 2, 2, 2, 2, 2])
    np.testing.assert_allclose(values(joined, 9)[0], [1, 2, 3, 2.5, 2, 2, 2, 2, 2])
    with pytest.raises(SignalError, match=r'run.csv has no column "tau" to replay; it has: t, load.'):
        Recorded(kind="recorded", file=path, column="tau").stream(STEP)
    with pytest.raises(RecordingError, match="does not exist"):
        Recorded(kind="recorded", file=tmp_path / "none.csv", column="tau").stream(STEP)


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        ({"kind": "sine", "frequency": 1.0}, "give either amplitude or max_velocity"),
        ({"kind": "sine", "frequency": -1.0, "amplitude": 1.0}, "greater than 0"),
        ({"kind": "multisine", "frequencies": [1.0], "amplitudes": [1.0, 2.0]}, "2 amplitudes for 1 frequencies"),
        ({"kind": "steps", "times": [1.0, 0.5], "values": [1.0, 2.0]}, "times must grow and be as many as values"),
        ({"kind": "noise", "rms": 1.0}, "seed"),
    ],
)
def test_what_makes_no_signal_is_refused(wrong: dict[str, Any], rule: str) -> None:
    with pytest.raises(ValidationError, match=re.escape(rule)):
        TypeAdapter(Generator).validate_python(wrong)
