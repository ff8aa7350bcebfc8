"""docs/promises.md names tests that there are."""

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
PAGE = TESTS.parent / "docs" / "promises.md"


def test_every_promise_names_tests_that_there_are() -> None:
    rows = [one for one in PAGE.read_text("utf-8").splitlines() if one.startswith("| ") and "| tests |" not in one]
    assert rows
    for row in rows:
        promise, tests = row.strip("| ").split(" | ")
        named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", tests)
        assert named or "`.ci/" in tests, promise
        for file, name in named:
            assert f"\ndef {name}(" in next(TESTS.rglob(file)).read_text("utf-8"), (file, name)
