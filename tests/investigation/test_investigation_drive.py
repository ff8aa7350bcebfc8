"""An investigation on a drive: only where that is allowed, in the drive's own limits, with every black box kept."""

from pathlib import Path

import numpy as np
import pytest
from investigations import CABLE, on_a_drive

from cosim.api.investigate import investigate
from cosim.cli import main
from cosim.data.recording import Recording
from cosim.hardware.machine import Machine, changed, read_machine
from cosim.hardware.words import ENTERED
from cosim.investigation.drive import thinned
from cosim.support.errors import HardwareError

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
    with pytest.raises(SystemExit) as ended:
        main([*words, "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
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
