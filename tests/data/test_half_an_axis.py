"""A file that holds a torque or a position alone is no axis, and is shown as what it holds."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from cosim.data.preview import preview


@pytest.mark.parametrize(
    ("header", "role", "scale"),
    [("time (ms),position_value (degree)", "q", pi / 180), ("time (ms),torque_nm", "tau", 1.0)],
)
def test_what_is_there_is_served(tmp_path: Path, header: str, role: str, scale: float) -> None:
    values = np.arange(400) * 1.5 % 360
    rows = "\n".join(f"{k},{value:.3f}" for k, value in enumerate(values))
    path = tmp_path / "half.csv"
    path.write_text(f"{header}\n{rows}\n")
    shown = preview(path)
    other = {"q": "no column tau", "tau": "no column q or v"}[role]
    assert other in shown.refused
    counted = np.arange(400) * 1.5 if role == "q" else values  # a position in degrees begins again at 360
    assert shown.recording.table[role] == pytest.approx(counted * scale)
