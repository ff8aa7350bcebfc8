"""Limits and budget of an investigation hold before anything moves, for a scenario's own motion and on a drive."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from commands import call
from investigations import CABLE, on_a_drive, written

from cosim.data.recording import Recording
from cosim.hardware.machine import Machine, changed, read_machine
from cosim.hardware.words import ENTERED
from cosim.support.errors import HardwareError, InputError
from cosim_investigation.drive import thinned
from cosim_investigation.families import FAMILIES
from cosim_investigation.investigate import investigate
from cosim_investigation.limits import KEPT, LARGEST, SMALLEST, Limits, frequency_of
from cosim_investigation.motions import room_of

ABSURD = ("inf", "-inf", "nan", "1e308", "1e-300", "1e999", "-1", "0", "", "1:2:3", "x")


ENDS = ("-inf:inf", "-1:inf", "nan:1", "0:1e-300", "-1e308:1e308", "1", ":")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        *product(("speed", "acceleration", "torque", "frequency"), ABSURD, ["(a limit is|its ends)"]),
        *product(("position", "forbidden"), ENDS, [""]),
        *product(["forbidden"], ("5:5", "9:7", "0:3", "-1:3", "a:b", "1:2:3"), ["forbidden=FROM:TO"]),
        ("position", "1:2", ".*stands at 0"),
        ("position", "2:1", "a limit is position=LOW:HIGH"),
        ("jerk", "3", "a limit is position=LOW:HIGH"),
        ("speed", "-1", ".*above 0"),
        ("frequency", "250", ".*shows less than 250 Hz"),
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


def test_a_tone_that_no_motion_is_long_enough_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"frequency=1e-09: a motion of 15 s has no tone below 0\.0741 Hz"):
        investigate(*written(tmp_path)[:2], tmp_path / "out", limits={"frequency": "1e-9"})


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
    own = read_machine("simulated")
    wide = {"speed": 2.0, "following_error": 0.05, "jump": 1e-3, "torque": 60.0} | limits
    return changed(own, "test", limits=own.limits.model_dump() | wide)


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
