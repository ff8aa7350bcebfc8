"""A file that was made to cost memory or time is read or refused within 20 s of a processor and 1 GB.

Each is read in a fork of an interpreter of its own, whose memory and time are counted.
"""

import json
import subprocess
import sys

import attack_files
import pytest

KINDS = sorted({name.partition(":")[0] for name in attack_files.FILES.keys() - attack_files.LONG})


@pytest.fixture(scope="module")
def costs() -> dict[str, attack_files.Cost]:
    """What a file of each kind costs, none that takes long; `python bench/attack_files.py` shows all."""
    if sys.platform != "linux":
        pytest.skip("forks")
    command = [sys.executable, str(attack_files.__file__), "--read", "--json", "--sample", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout[done.stdout.index("[") :])  # a library may print before
    return {one["name"].partition(":")[0]: attack_files.Cost(**one) for one in told}


@pytest.mark.parametrize("kind", KINDS)
def test_a_crafted_file_is_read_or_refused_at_a_bounded_cost(kind: str, costs: dict[str, attack_files.Cost]) -> None:
    assert costs[kind].is_fine, costs[kind]
    assert costs[kind].name not in attack_files.FOREIGN or costs[kind].code != 0
