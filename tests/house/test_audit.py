"""The script that looks for known holes of dependencies: one that hears nothing does not call them clean."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / ".ci" / "audit"
UVX = """#!/bin/sh
for file; do :; done
grep -q -E "$HOLES" "$file" || { echo "No known vulnerabilities found"; exit 0; }
echo "Found 1 known vulnerability in 1 package"; exit 1
"""
UV = """#!/bin/sh
while [ "$1" != --output-file ]; do case $1 in lowest-direct) of=3.1.6;; highest) of=3.2.0;; esac; shift; done
echo "jinja2==$of" > "$2"
"""


def audited(folder: Path, holes: str) -> tuple[int, str]:
    """Run the script with a stand-in for pip-audit that knows holes of some versions."""
    for name, text in {"uvx": UVX, "uv": UV}.items():
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    environment = os.environ | {"PATH": f"{folder}:{os.environ['PATH']}", "HOLES": holes}
    done = subprocess.run([SCRIPT], env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


@pytest.mark.skipif(sys.platform != "linux", reason="a script of bash")
@pytest.mark.parametrize(
    ("holes", "code", "said"),
    [
        ("nothing", 77, "skipped: "),
        ("==2.10$", 0, "== highest\nNo known"),
        ("==2.10$|==3.1.6$", 1, "== lowest-direct\nFound 1"),
        ("==2.10$|==3.2.0$", 1, "== highest\nFound 1"),
    ],
)
def test_dependencies_are_clean_only_where_a_known_hole_is_found(
    tmp_path: Path, holes: str, code: int, said: str
) -> None:
    found, text = audited(tmp_path, holes)
    assert (found, said in text) == (code, True), text
