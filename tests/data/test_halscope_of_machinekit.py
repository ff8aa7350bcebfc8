"""The log of Machinekit's halscope: another spelling of its unit, and channels that record nothing."""

from pathlib import Path

import numpy as np

from cosim.data.recording import Recording

T = np.arange(200) * 1e-3


def test_names_are_read_and_channels_without_a_pin_are_none(tmp_path: Path) -> None:
    rows = (
        f"joint.0.pos-fb {np.sin(9 * t):+.14f} (null) +0.0 pid.0.output {np.cos(7 * t):+.14f} (null) +0.0 " for t in T
    )
    (tmp_path / "halscope.log").write_text("Sampling period is 1000000 nSec \n\n" + "\n".join(rows) + "\n")
    seen = Recording.read(tmp_path / "halscope.log", {"tau": "pid.0.output", "q": "joint.0.pos-fb"})
    np.testing.assert_allclose(seen["q"], np.sin(9 * T), atol=1e-13)
    np.testing.assert_allclose(seen.t, T)
    assert set(seen) == {"t", "tau", "q"}
