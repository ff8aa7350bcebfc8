"""The benchmark of investigations: its machine conceals the same in every motion, and its page counts what it says."""

import pytest

from bench.investigate import COLUMNS, is_true, page


def row(seed: int, design: str, first: str, last: str, left_open: str = "") -> dict[str, str]:
    values = dict.fromkeys(COLUMNS, "0") | {"open": "", "left_open": left_open, "effect": "cogging"}
    return values | {"seed": str(seed), "design": design, "first": first, "last": last}


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
