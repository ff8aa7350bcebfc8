"""A computer that is late: the simulated machine waits with it, a real one does not."""

import os
import signal
import time
from pathlib import Path

from on_hardware import SIMULATED, recorded, scenario

from cosim.hardware.replay import replay
from cosim.hardware.session import Session

PAUSE = 0.1
"""s, a thousand cycles."""


def test_a_late_loop_is_told_and_the_simulated_machine_waits_for_it(tmp_path: Path) -> None:
    with Session(scenario(), SIMULATED, tmp_path / "box") as one:
        one.enable()
        os.kill(one.loop.process, signal.SIGSTOP)
        time.sleep(PAUSE)
        os.kill(one.loop.process, signal.SIGCONT)
        ended = one.track(500)
        assert ended.running
        assert ended.faults == ()
        assert one.statistics["late_cycles"] > 0.5 * PAUSE / 1e-4
    found = recorded(tmp_path)
    assert not found["machine.late"].any()
    assert replay(found).identical
