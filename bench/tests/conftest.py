"""Benches are found by their bare names and as `bench`; one thread for linear algebra, as in `tests`."""

import sys
from pathlib import Path

from cosim.cli import set_libraries

set_libraries()
ROOT = Path(__file__).parents[2]
sys.path += [str(ROOT / "bench"), str(ROOT), str(ROOT / "tests" / "tools")]

from tiny_fmu import tiny  # noqa: E402

__all__ = ["tiny"]
