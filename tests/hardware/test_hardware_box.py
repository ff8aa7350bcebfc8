"""The black box says what happened and replays bit for bit, also where the loop was late."""

import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from on_hardware import SIMULATED, recorded, scenario, session

from cosim.data.recording import Recording
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.master.simulate import run
from cosim.support.errors import HardwareError
from cosim.system.wire import Record

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")


def test_the_recording_is_one_that_a_diagnosis_reads(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        run_session(one)
    path = recorded(tmp_path).write(tmp_path / "r.parquet")
    read = Recording.read(path)
    assert {"tau", "q", "q_d"} <= set(read)
    assert [read.units[one] for one in ("t", "tau", "q", "q_d", "v_d")] == ["s", "N.m", "rad", "rad", "rad/s"]
    what = scenario()
    twin = run(replace(what, records={"tau": Record("mount.tau", "mean")})).recording
    first = int(np.flatnonzero(read["machine.notes"].astype(int) & 1)[0])
    assert np.allclose(read["tau"][first:][1:3999], twin["tau"][1:3999], rtol=1e-15, atol=1e-15)
    assert replay(read).identical


def test_a_black_box_is_let_go_of_when_its_session_ends(tmp_path: Path) -> None:
    def mapped() -> bool:
        return str(tmp_path / "box") in Path("/proc/self/maps").read_text()

    with session(tmp_path) as one:
        one.advance(10)
        assert mapped()
    assert not mapped(), "though the session is still there"
    assert one is not None


def test_a_ring_that_is_full_keeps_the_end_and_says_that_the_beginning_is_gone(tmp_path: Path) -> None:
    short = SIMULATED.model_copy(update={"black_box_seconds": 0.05})
    with session(tmp_path, short) as one:
        one.advance(1234)
    found = recorded(tmp_path)
    assert np.array_equal(found["machine.tick"], np.arange(734, 1234))
    with pytest.raises(HardwareError, match="begins at cycle 734"):
        replay(found)


def test_a_late_loop_is_told_and_the_simulated_machine_waits_for_it(tmp_path: Path) -> None:
    with Session(scenario(), SIMULATED, tmp_path / "box") as one:
        one.enable()
        os.kill(one.loop.process, signal.SIGSTOP)
        time.sleep(0.1)  # a thousand cycles
        os.kill(one.loop.process, signal.SIGCONT)
        ended = one.track(500)
        assert ended.running
        assert ended.faults == ()
        assert one.statistics["late_cycles"] > 500
    found = recorded(tmp_path)
    assert not found["machine.late"].any()
    assert replay(found).identical
