"""The benchmarks of the master still run, and all runners do the same work."""

from math import isfinite
from pathlib import Path

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
