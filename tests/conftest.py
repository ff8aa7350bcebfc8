"""What all tests share: where tools and benches are found, small FMUs, one thread for linear algebra, and Ctrl-C.

Tests call functions where a user types a command: libraries are told here what `cosim` tells them, before they are
loaded. Two workers on two cores whose small matrices have two threads each took three times the processor.

Ctrl-C means the same however the tests were started: a shell's background jobs, and so their children, ignore it.
"""

import signal
import sys
from pathlib import Path

from cosim.cli import set_libraries

set_libraries()
ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "tools"))
sys.path += [str(ROOT / "bench"), str(ROOT)]  # behind the installed package, which is the one that is tested

from browsing import browser  # noqa: E402
from commands import refused, scenario  # noqa: E402
from mirror_fmu import mirror  # noqa: E402
from oscillators import plain  # noqa: E402
from ssp_files import read  # noqa: E402
from start_fmus import make  # noqa: E402
from tiny_fmu import tiny  # noqa: E402

__all__ = ["browser", "make", "mirror", "plain", "read", "refused", "scenario", "tiny"]

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
