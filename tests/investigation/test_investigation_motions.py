"""Motions of an investigation: inside their limits whatever these are, and smooth."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.data.recording import Recording
from cosim_investigation.families import FAMILIES, fast_sweeps, motions, slow_sweep, stop_and_go
from cosim_investigation.limits import Limits
from cosim_investigation.motions import FADE, Motion, Rest, Room, Tones, room_of

SIZES = st.floats(1e-3, 10.0)
LIMITS = Limits(-1.0, 1.0, 0.5, 2.0, 50.0, 5.0)


@settings(deadline=None)
@given(low=SIZES, high=SIZES, speed=SIZES, acceleration=SIZES, frequency=st.floats(0.3, 30.0), turned=st.booleans())
def test_no_motion_leaves_a_limit(low, high, speed, acceleration, frequency, turned) -> None:
    limits = Limits(-low, high, speed, acceleration, 1.0, frequency)
    for motion in motions(room_of(limits, 0.0, 10.0, 1, turned)):
        asked = motion.sampled(np.arange(0.0, motion.seconds, 4e-3))
        assert limits.left_by(*asked) == "", motion.family


@pytest.mark.parametrize("acceleration", np.geomspace(0.4, 2.0, 12))
def test_a_short_motion_that_first_moves_to_the_middle_has_time_for_its_tones(acceleration: float) -> None:
    """The way to the middle and back once took all of the 8 s, and nothing was left to tone in."""
    limits = replace(LIMITS, speed=2.0, acceleration=float(acceleration))
    for motion in motions(room_of(limits, 0.9, 8.0, 1, False)):
        assert motion.seconds == pytest.approx(8.0)
        assert all(part.lasts >= 2.0 for part in motion.parts if isinstance(part, Tones)), motion.family


@settings(deadline=None)
@given(low=st.floats(0.05, 20.0), wide=st.floats(1.01, 10.0), frequency=st.floats(0.3, 30.0), turned=st.booleans())
def test_no_tone_lies_in_the_forbidden_band(low: float, wide: float, frequency: float, turned: bool) -> None:
    limits = replace(LIMITS, frequency=frequency).with_given({"forbidden": f"{low}:{low * wide}"})
    for motion in motions(room_of(limits, 0.0, 10.0, 1, turned)):
        tones = [part for part in motion.parts if isinstance(part, Tones)]
        assert all(not low <= hertz <= low * wide for one in tones for hertz in one.hertz), motion.family
        assert limits.left_by(*motion.sampled(np.arange(0.0, motion.seconds, 4e-3))) == "", motion.family


@pytest.mark.parametrize("number", range(len(FAMILIES)))
def test_a_motion_lasts_as_long_as_asked_begins_and_ends_at_rest_and_is_smooth(number: int) -> None:
    for home, turned in product((0.0, 0.8), (False, True)):
        room = room_of(LIMITS, home, 12.0, 3, turned)
        motion = FAMILIES[number](room)
        t = np.arange(0.0, motion.seconds, 1e-3)
        q, v, a = motion.sampled(t)
        assert motion.seconds == pytest.approx(room.seconds)
        assert [q[0], v[0], a[0], v[-1], a[-1]] == pytest.approx([0.0] * 5)
        assert np.ptp(q) > 0, motion.family
        assert q[-1] == pytest.approx(0.0), motion.family  # back where it began: a drive is there before the next one
        assert np.abs(np.gradient(q, t) - v).max() < 1e-3 * 0.5  # half a step of the acceleration
        assert np.abs(np.diff(a)).max() < 2 * 20 * 2.0 * 1e-3  # jerk: 20 accelerations a second, half of it to spare


@pytest.mark.parametrize("family", [slow_sweep, fast_sweeps])
@pytest.mark.parametrize("home", [0.0, 0.8])
def test_a_sweep_goes_both_ways_as_far_as_the_time_allows(family: Callable[[Room], Motion], home: float) -> None:
    reach = []
    for seconds in (8.0, 20.0):
        q, _, _ = family(room_of(LIMITS, home, seconds, 3, False)).sampled(np.arange(0.0, seconds, 1e-2))
        assert q.min() < 0 < q.max()
        reach.append(np.ptp(q))
    assert reach[1] == pytest.approx(1.8, rel=1e-3)
    assert reach[0] < 1.2


@pytest.mark.parametrize("seconds", [4.0, 8.0, 30.0])
@pytest.mark.parametrize("home", [0.0, 0.8])
def test_a_slow_sweep_is_so_slow_that_it_rests_no_longer_than_it_must(seconds: float, home: float) -> None:
    """An end is nearer than the other one, and a ramp shorter than its share: a few hundredths of a second are left."""
    last = slow_sweep(room_of(LIMITS, home, seconds, 3, False)).parts[-1]
    assert isinstance(last, Rest)
    assert last.lasts == pytest.approx(FADE, abs=0.06)


def test_a_stop_and_go_rests_for_different_times_whatever_the_time() -> None:
    for seconds, least in ((8.0, 2.0), (20.0, 2.9)):
        t = np.arange(0.0, seconds, 1e-3)
        moving = np.abs(stop_and_go(room_of(LIMITS, 0.0, seconds, 3, False)).sampled(t)[1]) > 1e-6
        starts, stops = (np.flatnonzero(np.diff(moving.astype(int)) == way) for way in (1, -1))
        rests = t[starts[1:4]] - t[stops[:3]]
        assert len(starts) >= (4 if seconds < 10 else 6)
        assert rests[2] > least  # long enough for a contact to settle
        assert rests[2] / rests[0] == pytest.approx(10.0, rel=0.02)  # 3 s after 0.3 s, or a share of both


def test_a_recording_that_overshoots_is_named() -> None:
    t = np.arange(0.0, 10.0, 1e-2)
    recording = Recording.of({"t": t, "tau": np.sin(t), "q": 1.2 * np.sin(t)})
    assert LIMITS.left_in(recording).startswith("position 1.2 beyond 1")
    below = Recording.of({"t": t, "tau": np.sin(t), "q": -0.15 - 0.6 * np.cos(0.5 * t)})
    assert replace(LIMITS, low=-0.7).left_in(below) == "position -0.75 beyond -0.7"
    assert LIMITS.that_allow(recording) == "speed=1.4 position=-1.4:1.4"
    assert LIMITS.with_given({"speed": "1.4", "position": "-1.4:1.4"}).left_in(recording) == ""
    still = Recording.of({"t": t, "tau": 60 * np.sin(t), "q": 0.4 * np.sin(t)})
    assert LIMITS.left_in(still).startswith("torque")
    late = np.delete(np.arange(0.0, 10.0, 2e-3), np.arange(2000, 2040))  # a gap of late cycles is no speed
    assert LIMITS.left_in(Recording.of({"t": late, "tau": np.sin(late), "q": 0.45 * np.sin(late)})) == ""
    fast = Recording.of({"t": late, "tau": np.sin(late), "q": 0.2 * np.sin(3 * late)})
    assert LIMITS.left_in(fast).startswith("speed 0.6")


def test_the_other_end_comes_first_in_a_turned_motion_and_a_tone_has_the_frequency_that_is_wanted() -> None:
    straight, turned = (FAMILIES[0](room_of(LIMITS, 0.0, 12.0, 3, way)) for way in (False, True))
    t = np.arange(0.0, 12.0, 1e-2)
    assert np.allclose(straight.sampled(t)[0], -turned.sampled(t)[0])
    room = Room(0.0, 1.0, 2.0, 3.0, 4.0, 30.0, 1)
    assert [room.outside(hertz) for hertz in (0.01, 0.9, 40.0)] == [0.01, 0.9, 40.0]
