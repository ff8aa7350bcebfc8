"""The loop needs absolute sleeps: elsewhere than on Linux what runs it is skipped, and the rest is tested."""

import sys
from pathlib import Path

import pytest

ANYWHERE = {"test_black_box_file.py", "test_hardware_numbers.py", "test_machine_ranges.py", "test_session_steps.py"}
"""Files without a loop that runs."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if sys.platform != "linux":
        for item in items:
            if item.path.parent == Path(__file__).parent and item.path.name not in ANYWHERE:
                item.add_marker(pytest.mark.skip(reason="the loop needs absolute sleeps"))
