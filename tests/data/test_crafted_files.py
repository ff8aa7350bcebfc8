"""A file that was made to cost memory or time is read or refused within 20 s of a processor and 1 GB.

Each is read in a fork of an interpreter of its own, whose memory and time are counted.
"""

import json
import subprocess
import sys

import attack_files
import pytest

KINDS = sorted({name.partition(":")[0] for name in attack_files.FILES})
EACH = 1
"""File of each kind, none that takes long; `python bench/attack_files.py` shows all."""


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
@pytest.mark.parametrize("kind", KINDS)
def test_a_crafted_file_is_read_or_refused_at_a_bounded_cost(kind: str) -> None:
    command = [sys.executable, str(attack_files.__file__), "--read", "--json", "--only", f"{kind}:"]
    done = subprocess.run([*command, "--sample", str(EACH)], capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    costs = [
        attack_files.Cost(**one) for one in json.loads(done.stdout[done.stdout.index("[") :])
    ]  # a library may print before
    assert costs
    assert [one for one in costs if not one.is_fine] == []
    assert [one for one in costs if one.name in attack_files.FOREIGN and one.code == 0] == []
