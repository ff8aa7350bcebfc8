"""Limits of investigations on machines drawn at random: a small sample, and that a motion beyond is seen by both."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.investigate_limits import Asked, machine, page, run
from bench.limits_axes import axis
from cosim_investigation.families import fast_sweeps
from cosim_investigation.limits import Limits
from cosim_investigation.motions import room_of


def test_no_designed_motion_leaves_a_limit_on_the_plant_or_on_the_drive(tmp_path: Path) -> None:
    counts = Counter[str]()
    assert machine(np.random.default_rng(11), tmp_path, counts, 4) == []
    assert counts["run"] == 4


@pytest.mark.parametrize("udp", [False, True])
def test_a_motion_beyond_a_limit_is_seen_on_the_plant_and_by_the_drive(tmp_path: Path, udp: bool) -> None:
    one = axis(np.random.default_rng(12), tmp_path)
    wide = Limits(-0.4, 0.4, 0.4, 2.0, 1e3, one.bandwidth)
    motion = fast_sweeps(room_of(wide, 0.0, 6.0, 1, False))
    given = Asked(replace(wide, speed=0.3), 6.0, 0, False, 1)
    found = run(one, motion, given, tmp_path, udp)
    assert [text.split(":")[0] for text in found] == ["set point", "plant", "plant", "drive"]
    assert "ended in" in found[-1]


def test_the_page_counts_what_was_refused_and_what_left_a_limit() -> None:
    counts = Counter({"run": 50, "machines": 2, "refused: torque": 3, "beyond": 1})
    text = page("command", counts, ["cogging, tone: drive: 1 overspeeds"])
    assert "50 motions on 2 machines" in text
    assert "refused before they moved: 3 (3 for torque). 1 left a limit." in text
    assert text.endswith("- cogging, tone: drive: 1 overspeeds\n")
