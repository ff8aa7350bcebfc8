"""The benchmark of investigations: its machine conceals the same in every motion, and its page counts what it says."""

from pathlib import Path

import numpy as np
import pytest

from bench.investigate import COLUMNS, Case, Concealed, is_true, page
from cosim.investigation.families import fast_sweeps
from cosim.investigation.motions import room_of


def row(seed: int, design: str, first: str, last: str, left_open: str = "") -> dict[str, str]:
    values = dict.fromkeys(COLUMNS, "0") | {"open": "", "left_open": left_open, "effect": "cogging"}
    return values | {"seed": str(seed), "design": design, "first": first, "last": last}


def test_a_concealed_machine_follows_a_motion_inside_its_limits_and_is_the_same_each_time(tmp_path: Path) -> None:
    machine = Concealed(Case(4200, "cable_wrap", 1.0))
    motion = fast_sweeps(room_of(machine.limits, machine.home, 8.0, 1, False))
    found = [machine.record(motion, 3, tmp_path / f"{k}.parquet") for k in range(2)]
    assert np.array_equal(found[0]["tau"], found[1]["tau"])
    assert machine.limits.left_in(found[0]) == ""
    bare = [Concealed(Case(4200, "cable_wrap", size)) for size in (0.5, 1.0)]
    torques = [one.record(motion, 3, tmp_path / f"size {k}.parquet")["tau"] for k, one in enumerate(bare)]
    assert np.abs(torques[0] - torques[1]).max() > 0.01 * np.abs(torques[1]).max()


@pytest.mark.parametrize(
    ("last", "left_open", "is_hit"),
    [
        ("cogging", "", True),
        ("cogging", "not testable", True),
        ("cogging", "set", False),
        ("cogging unknown", "", False),
    ],
)
def test_only_the_one_true_name_counts(last: str, left_open: str, is_hit: bool) -> None:
    assert is_true(row(1, "random", "", last, left_open), "last") is is_hit


def test_the_page_compares_both_designs_on_the_cases_that_were_open() -> None:
    kept = row(2, "log-odds", "cogging", "cogging") | {"further_s": "20"}
    rows = [row(1, "log-odds", "", "cogging"), row(1, "random", "", ""), kept]
    text = page(rows, "command")
    assert "2 cases, 1 whose first answer is not the one true name" in text
    assert "| log-odds | 1 of 1 (21 to 100 %) |" in text
    assert "| random | 0 of 1 (0 to 79 %) |" in text
    assert "Of 1 that went on though the first answer is the true name, 1 of 1" in text
