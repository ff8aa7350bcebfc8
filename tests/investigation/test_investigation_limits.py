"""Limits and budget of an investigation hold before anything moves, for a scenario's own motion and on a drive.

Its own motions stay inside their limits whatever these are, and are smooth.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from commands import call
from hypothesis import given, settings
from hypothesis import strategies as st
from investigations import CABLE, on_a_drive, written
from on_hardware import altered

from cosim.data.recording import Recording
from cosim.hardware.machine import Machine, read_machine
from cosim.hardware.words import ENTERED
from cosim.support.errors import HardwareError, InputError
from cosim_investigation.drive import thinned
from cosim_investigation.families import FAMILIES, fast_sweeps, motions, slow_sweep, stop_and_go
from cosim_investigation.investigate import investigate
from cosim_investigation.limits import KEPT, LARGEST, SMALLEST, Limits, frequency_of
from cosim_investigation.motions import FADE, Motion, Rest, Room, Tones, room_of

ABSURD = ("inf", "-inf", "nan", "1e308", "1e-300", "1e999", "-1", "0", "", "1:2:3", "x")


ENDS = ("-inf:inf", "-1:inf", "nan:1", "0:1e-300", "-1e308:1e308", "1", ":")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        *product(("speed", "acceleration", "torque", "frequency"), ABSURD, ["(a limit is|its ends)"]),
        *product(("position", "forbidden"), ENDS, [""]),
        *product(["forbidden"], ("5:5", "9:7", "0:3", "-1:3", "a:b", "1:2:3"), [".*forbidden=FROM:TO"]),
        ("position", "1:2", ".*stands at 0"),
        ("position", "2:1", "a limit is position=LOW:HIGH"),
        ("jerk", "3", "a limit is position=LOW:HIGH"),
        ("speed", "-1", ".*above 0"),
        ("frequency", "250", ".*shows less than 250 Hz"),
        ("frequency", "1e-09", r"a motion of 15 s has no tone below 0\.0741 Hz"),
    ],
)
def test_limits_that_an_axis_cannot_have_are_refused_before_anything_moves(tmp_path, name, text, said) -> None:
    with pytest.raises(InputError, match=rf"--limits {name}={text}: {said}"):
        investigate(*written(tmp_path)[:2], tmp_path / "out", limits={name: text})
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"position": "-0.05:0.05"}, r"position 0\.3 beyond 0\.05; --limits position=-0\.34:0\.34 would allow it"),
        ({"speed": "0.1"}, r"speed 0\.\d+ beyond 0\.1; --limits speed="),
        ({"acceleration": "0.05"}, r"acceleration \d\.\d+ beyond 0\.05; --limits acceleration="),
        ({"torque": "1.5"}, r"torque \d+\.\d+ beyond 1\.5; --limits torque="),
        ({"frequency": "0.2"}, r"frequency 0\.\d+ beyond 0\.2; --limits frequency="),
        ({"forbidden": "0.2:0.3"}, r"forbidden band of 0\.2 to 0\.3 Hz, in which a part of it lies"),
    ],
)
def test_the_own_motion_of_a_scenario_is_asked_for_every_limit_before_it_runs(tmp_path, limits, said) -> None:
    given, out = written(tmp_path, CABLE), tmp_path / "out"
    with pytest.raises(InputError, match=f"The first motion, the set point of axis, would leave a limit: {said}"):
        investigate(*given[:2], out, machine=given[2], limits=limits, seconds=10)
    assert not [*out.rglob("*.parquet")]


def test_what_a_set_point_visits_and_what_motions_before_strayed_narrow_the_limits() -> None:
    t = np.arange(0.0, 10.0, 1e-3)
    motion = (0.3 + 0.2 * np.sin(t), 0.2 * np.cos(t), -0.2 * np.sin(t))
    visited = Limits.visited(motion, 5.0, None)
    assert (visited.low, visited.high) == pytest.approx((0.3 - 0.2 / KEPT, 0.3 + 0.2 / KEPT), rel=1e-5)
    assert (visited.speed, visited.acceleration) == pytest.approx((0.2 / KEPT, 0.2 / KEPT), rel=1e-5)
    assert visited.frequency == pytest.approx(10 / (2 * np.pi), rel=1e-5)  # ten times that of its own motion
    assert visited.less(0.01, 0.02) == replace(
        visited, low=visited.low + 0.01, high=visited.high - 0.01, speed=visited.speed - 0.02
    )


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"budget": 17, "seconds": 8}, "the first two motions last 20 s, 12 s of them the set point of axis"),
        ({"budget": 5, "seconds": 10}, "--budget 5s: the first two motions last 22 s, 12 s of them the set point"),
        *[({"budget": budget}, "it is a time above 0") for budget in (np.inf, np.nan, 0.0, -1.0)],
        *[
            ({"seconds": one}, "a motion lasts from 8 to 3600 s")
            for one in (7.9, float("nan"), float("inf"), 1e9, -8.0)
        ],
    ],
)
def test_times_are_finite_and_the_own_motion_counts_in_the_budget_before_anything_moves(tmp_path, asked, said) -> None:
    out = tmp_path / "out"
    with pytest.raises(InputError, match=said):
        investigate(*written(tmp_path)[:2], out, **asked)
    assert not [*out.rglob("*.*")]


def test_a_first_motion_on_a_drive_is_asked_for_the_torque_that_the_card_says(tmp_path: Path) -> None:
    given, out = on_a_drive(tmp_path, CABLE), tmp_path / "out"
    limits = {"position": "-0.35:0.35", "torque": "1.5"}
    with pytest.raises(InputError, match=r"Even a small first motion, a sine of .*, would leave a limit: torque"):
        investigate(*given, out, machine=read_machine("simulated"), fast=True, seconds=10, limits=limits)
    assert not [*out.rglob("*.box")]


def test_every_family_stays_finite_in_time_and_in_limits_however_absurd_these_are() -> None:
    dice = np.random.default_rng(3)
    for _ in range(12):
        speed, acceleration, far = 10 ** dice.uniform(np.log10(SMALLEST), np.log10(LARGEST), 3)
        limits = Limits(
            -far * dice.random(), far * dice.random(), speed, acceleration, 1.0, 10 ** dice.uniform(-0.5, 2)
        )
        room = room_of(limits, 0.0, 10.0, 1, False)
        for family in FAMILIES:
            motion = family(room)
            moved = motion.sampled(np.arange(0, motion.seconds, 0.01))
            assert np.isfinite(moved).all()
            assert limits.left_by(*moved) == ""
            assert motion.seconds <= 10.0 + 1e-6


@pytest.mark.parametrize(
    ("tones", "hertz"),
    [
        ({2.0: 1.0}, 2.0),
        ({0.5: 1.0, 8.0: 0.3}, 8.0),  # a tenth of the energy of the acceleration
        ({0.5: 1.0, 8.0: 0.05}, 0.5),  # a four-hundredth
    ],
)
def test_a_motion_is_as_fast_as_the_tone_at_which_nearly_all_of_its_acceleration_ends(tones, hertz) -> None:
    t = np.arange(0, 20, 2e-3)
    a = sum(size * np.cos(2 * np.pi * one * t) for one, size in tones.items())
    v = sum(size * np.sin(2 * np.pi * one * t) / (2 * np.pi * one) for one, size in tones.items())
    assert frequency_of(v, a, 2e-3) == pytest.approx(hertz, abs=0.08)  # one that lasts 20 s blurs by .075 Hz
    assert frequency_of(0 * t, 0 * t, 2e-3) == 0.0


# An investigation on a drive: only where that is allowed, in the drive's own limits, with every black box kept.

RANGE = {"position": "-0.35:0.35"}


def drive(**limits: float) -> Machine:
    wide = {"speed": 2.0, "following_error": 0.05, "jump": 1e-3, "torque": 60.0} | limits
    return altered(limits=wide)


def test_a_drive_is_asked_until_one_answer_is_left(tmp_path: Path) -> None:
    given, out = on_a_drive(tmp_path, CABLE), tmp_path / "out"
    done = investigate(*given, out, machine=drive(), fast=True, budget=40, seconds=10, limits=RANGE)
    assert done.missing == ("cable_wrap",)
    recordings = sorted((out / "recordings").glob("*.parquet"))
    assert [one.with_suffix(".box").exists() for one in recordings] == [True] * len(recordings)
    assert max(np.abs(Recording.read(one)["q"]).max() for one in recordings) < 0.35


def test_a_session_that_ends_in_a_fault_ends_the_investigation_and_is_kept(tmp_path: Path) -> None:
    given, out = on_a_drive(tmp_path, CABLE), tmp_path / "out"
    with pytest.raises(HardwareError, match="ended in following_error on a sine"):
        investigate(*given, out, machine=drive(following_error=1e-4), fast=True, seconds=10, limits=RANGE)
    assert len([*(out / "recordings").glob("*.box")]) == 1


def test_limits_are_no_wider_than_the_drive(tmp_path: Path) -> None:
    given, out = on_a_drive(tmp_path, CABLE), tmp_path / "out"
    slow = drive(speed=0.1)
    done = investigate(*given, out, machine=slow, fast=True, budget=20, seconds=10, limits=RANGE)
    assert done.story.limits["speed"] == 0.1


def test_nothing_moves_on_a_drive_without_leave(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = on_a_drive(tmp_path, CABLE)
    words = ["investigate", given[0], "--card", given[1], "--drive", "udp://127.0.0.1:4020"]
    assert call(*words, "--out", tmp_path / "out") == 2
    assert "give --move to allow it" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_torque_of_a_thinned_recording_belongs_to_its_time() -> None:
    """A straight line has its own value as its mean, whatever the interval, if that lies around the row."""
    t = 1e-3 * np.arange(4000)
    columns = {"t": t, "tau": 3 * t, "q": t, "q_d": t, "machine.notes": np.where(t > 0.5, float(ENTERED), 0.0)}
    found = thinned(Recording("run", columns), 100.0)
    assert found.sample_time == pytest.approx(0.01)
    assert found["tau"] == pytest.approx(3 * found["q"], abs=1e-12)
    assert found.t[0] == pytest.approx(0.01)


# Motions of an investigation.

SIZES = st.floats(1e-3, 10.0)
ROOMY = Limits(-1.0, 1.0, 0.5, 2.0, 50.0, 5.0)


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
    limits = replace(ROOMY, speed=2.0, acceleration=float(acceleration))
    for motion in motions(room_of(limits, 0.9, 8.0, 1, False)):
        assert motion.seconds == pytest.approx(8.0)
        assert all(part.lasts >= 2.0 for part in motion.parts if isinstance(part, Tones)), motion.family


@settings(deadline=None)
@given(low=st.floats(0.05, 20.0), wide=st.floats(1.01, 10.0), frequency=st.floats(0.3, 30.0), turned=st.booleans())
def test_no_tone_lies_in_the_forbidden_band(low: float, wide: float, frequency: float, turned: bool) -> None:
    limits = replace(ROOMY, frequency=frequency).with_given({"forbidden": f"{low}:{low * wide}"})
    for motion in motions(room_of(limits, 0.0, 10.0, 1, turned)):
        tones = [part for part in motion.parts if isinstance(part, Tones)]
        assert all(not low <= hertz <= low * wide for one in tones for hertz in one.hertz), motion.family
        assert limits.left_by(*motion.sampled(np.arange(0.0, motion.seconds, 4e-3))) == "", motion.family


@pytest.mark.parametrize("number", range(len(FAMILIES)))
def test_a_motion_lasts_as_long_as_asked_begins_and_ends_at_rest_and_is_smooth(number: int) -> None:
    for home, turned in product((0.0, 0.8), (False, True)):
        room = room_of(ROOMY, home, 12.0, 3, turned)
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
        q, _, _ = family(room_of(ROOMY, home, seconds, 3, False)).sampled(np.arange(0.0, seconds, 1e-2))
        assert q.min() < 0 < q.max()
        reach.append(np.ptp(q))
    assert reach[1] == pytest.approx(1.8, rel=1e-3)
    assert reach[0] < 1.2


@pytest.mark.parametrize("seconds", [4.0, 8.0, 30.0])
@pytest.mark.parametrize("home", [0.0, 0.8])
def test_a_slow_sweep_is_so_slow_that_it_rests_no_longer_than_it_must(seconds: float, home: float) -> None:
    """An end is nearer than the other one, and a ramp shorter than its share: a few hundredths of a second are left."""
    last = slow_sweep(room_of(ROOMY, home, seconds, 3, False)).parts[-1]
    assert isinstance(last, Rest)
    assert last.lasts == pytest.approx(FADE, abs=0.06)


def test_a_stop_and_go_rests_for_different_times_whatever_the_time() -> None:
    for seconds, least in ((8.0, 2.0), (20.0, 2.9)):
        t = np.arange(0.0, seconds, 1e-3)
        moving = np.abs(stop_and_go(room_of(ROOMY, 0.0, seconds, 3, False)).sampled(t)[1]) > 1e-6
        starts, stops = (np.flatnonzero(np.diff(moving.astype(int)) == way) for way in (1, -1))
        rests = t[starts[1:4]] - t[stops[:3]]
        assert len(starts) >= (4 if seconds < 10 else 6)
        assert rests[2] > least  # long enough for a contact to settle
        assert rests[2] / rests[0] == pytest.approx(10.0, rel=0.02)  # 3 s after 0.3 s, or a share of both


def test_a_recording_that_overshoots_is_named() -> None:
    t = np.arange(0.0, 10.0, 1e-2)
    recording = Recording.of({"t": t, "tau": np.sin(t), "q": 1.2 * np.sin(t)})
    assert ROOMY.left_in(recording).startswith("position 1.2 beyond 1")
    below = Recording.of({"t": t, "tau": np.sin(t), "q": -0.15 - 0.6 * np.cos(0.5 * t)})
    assert replace(ROOMY, low=-0.7).left_in(below) == "position -0.75 beyond -0.7"
    assert ROOMY.that_allow(recording) == "speed=1.4 position=-1.4:1.4"
    assert ROOMY.with_given({"speed": "1.4", "position": "-1.4:1.4"}).left_in(recording) == ""
    still = Recording.of({"t": t, "tau": 60 * np.sin(t), "q": 0.4 * np.sin(t)})
    assert ROOMY.left_in(still).startswith("torque")
    late = np.delete(np.arange(0.0, 10.0, 2e-3), np.arange(2000, 2040))  # a gap of late cycles is no speed
    assert ROOMY.left_in(Recording.of({"t": late, "tau": np.sin(late), "q": 0.45 * np.sin(late)})) == ""
    fast = Recording.of({"t": late, "tau": np.sin(late), "q": 0.2 * np.sin(3 * late)})
    assert ROOMY.left_in(fast).startswith("speed 0.6")


def test_the_other_end_comes_first_in_a_turned_motion_and_a_tone_has_the_frequency_that_is_wanted() -> None:
    straight, turned = (FAMILIES[0](room_of(ROOMY, 0.0, 12.0, 3, way)) for way in (False, True))
    t = np.arange(0.0, 12.0, 1e-2)
    assert np.allclose(straight.sampled(t)[0], -turned.sampled(t)[0])
    room = Room(0.0, 1.0, 2.0, 3.0, 4.0, 30.0, 1)
    assert [room.outside(hertz) for hertz in (0.01, 0.9, 40.0)] == [0.01, 0.9, 40.0]
