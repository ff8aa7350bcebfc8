"""Benchmarks of the master and of the hardware loop still run, and all runners do the same work."""

import sys
from math import isfinite
from pathlib import Path

import hardware_faults
import hardware_page
import master_runners
import master_step
import pytest


@pytest.mark.parametrize("fmi", [2, 3])
def test_runners_of_the_step_benchmark_take_their_steps(tmp_path: Path, fmi: int) -> None:
    folder = master_step.pair(tmp_path, fmi)
    for name in ("c", "cosim", "gauss_seidel", "isolated", "interpreted", "fmpy"):
        assert isfinite(master_runners.RUNNERS[name](folder, fmi, 30)), name


def test_a_peer_that_does_not_run_is_named_with_its_reason(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="nobody"):
        master_step.step_time("nobody", tmp_path, 3, 1)
    summary = master_step._summary([2e-6, 4e-6], [1e-6, 2e-6], None)
    assert summary == {"microseconds": 3.0, "ratio": 2.0, "spread": [2.0, 2.0]}
    assert master_step._cells(master_step._summary([], [1e-6], "is missing")) == "- | is missing"


@pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")
def test_a_fault_that_the_benchmark_injects_becomes_a_row_of_its_page() -> None:
    trials = [
        hardware_faults.injected("lost", {}, "frame_lost", 0.1),
        hardware_faults.injected("lost", {}, "estop", 0.1),
    ]
    seen, missed = (hardware_faults.row("lost", "frame_lost", [one]) for one in trials)
    assert (seen["detected"], seen["cycles"], seen["states"], seen["torque_after"]) == (1.0, [3, 3], ["fault"], 0.0)
    assert missed["detected"] == 0.0
    page = "\n".join(hardware_page.fault_lines({"rows": [seen], "detected": 1.0}))
    assert "| lost | `frame_lost` | 100% of 1 | 3 | fault | 0 |" in page
