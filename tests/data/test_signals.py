"""Signals: motions whose parts belong together, noise that a seed repeats, recordings replayed by a stated rule."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calls import calls_of
from pydantic import TypeAdapter, ValidationError

from cosim.data.recording import Recording
from cosim.data.set_points import PIECE
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
from cosim.support.errors import RecordingError, SignalError

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


def test_a_smooth_start_begins_at_rest_and_ends_in_the_sine() -> None:
    whole = values(Sine(kind="sine", frequency=0.7, amplitude=0.3, phase=0.4, smooth_start=0.8))
    plain = values(Sine(kind="sine", frequency=0.7, amplitude=0.3, phase=0.4))
    np.testing.assert_array_equal(whole[:, 0], 0.0)
    np.testing.assert_array_equal(whole[:, 8000:], plain[:, 8000:])


def test_a_sine_reaches_its_greatest_velocity() -> None:
    velocity = values(Sine(kind="sine", frequency=0.5, max_velocity=3.0))[1]
    assert velocity.max() == 3.0


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


def test_a_dwell_programme_rests_as_long_as_it_says() -> None:
    q, v, _ = values(Slews(positions=[0.0, 0.1, 0.2], dwell=[0.2, 1.0, 0.0], **SLEWS), ticks=60_000)
    for position, seconds in ((0.0, 0.2), (0.1, 1.0)):
        at_rest = int(np.sum((v == 0) & (np.abs(q - position) < 1e-12)))
        assert abs(at_rest * STEP - seconds) <= 2 * STEP


def test_the_stars_turn_once_in_a_sidereal_day_and_a_ramp_begins_where_it_says() -> None:
    position, velocity, acceleration = values(Sidereal(kind="sidereal", start=0.5))
    np.testing.assert_array_equal((velocity[-1], acceleration[-1]), (SIDEREAL_RATE, 0.0))
    np.testing.assert_allclose(2 * np.pi / SIDEREAL_RATE, 86164.1, atol=0.05)
    np.testing.assert_allclose(position, 0.5 + SIDEREAL_RATE * STEP * np.arange(30_000), atol=1e-15)
    smooth = values(Sidereal(kind="sidereal", start=0.5, smooth_start=1.0))
    np.testing.assert_array_equal(smooth[:, 0], [0.5, 0.0, 0.0])


def test_steps_act_from_the_tick_of_their_time() -> None:
    signal = Steps(kind="steps", times=[0.0003, 0.0007], values=[1.0, -2.0], initial=0.5)
    np.testing.assert_array_equal(values(signal, 9)[0], [0.5] * 3 + [1.0] * 4 + [-2.0] * 2)


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


def test_a_few_sines_may_go_on_for_ever() -> None:
    gusts = Multisine(kind="multisine", frequencies=[0.1 * k for k in range(1, 11)], amplitudes=1e-3)
    check_signal("gusts", gusts, 1e-4, 10**9)


def test_a_sum_of_too_many_sines_is_refused_with_what_to_do() -> None:
    many = Multisine(kind="multisine", frequencies=np.linspace(0.1, 400, 100_000).tolist(), amplitudes=1e-3)
    rule = re.escape(
        "has 100,000 frequencies; in 150,000 steps that is 1.5e+10 sines, and 2e+09 are the most. Take fewer"
    )
    with pytest.raises(SignalError, match=rule):
        check_signal("sum", many, 1e-4, 150_000)
    check_signal("sum", many, 1e-4, 20_000)


def test_noise_is_white_of_its_size_and_repeats_by_its_seed() -> None:
    one = values(Noise(kind="noise", rms=2.0, seed=3))[0]
    np.testing.assert_array_equal(one, values(Noise(kind="noise", rms=2.0, seed=3))[0])
    assert not np.array_equal(one, values(Noise(kind="noise", rms=2.0, seed=4))[0])
    assert abs(one.std() - 2.0) < 0.05  # five standard deviations of the estimate
    assert abs(np.corrcoef(one[1:], one[:-1])[0, 1]) < 0.03


def test_a_recording_is_replayed_held_or_joined(tmp_path: Path) -> None:
    table = {"t": 5.0 + np.arange(4) * 2e-4, "load": np.array([1.0, 3.0, 2.0, 2.0])}
    path = Recording("run", table).write(tmp_path / "run.csv")
    held = Recorded(kind="recorded", file=path, column="load", interpolation="hold")
    joined = Recorded(kind="recorded", file=path, column="load")
    np.testing.assert_array_equal(values(held, 9)[0], [1, 1, 3, 3, 2, 2, 2, 2, 2])
    np.testing.assert_allclose(values(joined, 9)[0], [1, 2, 3, 2.5, 2, 2, 2, 2, 2])


def test_a_recording_that_cannot_be_replayed_is_named(tmp_path: Path) -> None:
    path = Recording("run", {"t": np.arange(4.0), "load": np.arange(4.0)}).write(tmp_path / "run.csv")
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


def test_the_phases_of_a_multisine_lie_all_around_and_its_seed_says_where() -> None:
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
