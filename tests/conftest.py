"""What all tests share: where tools and benches are found, and Ctrl-C.

Ctrl-C means the same however the tests were started: a shell's background jobs, and so their children, ignore it.
"""

import signal
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "tools"))
sys.path += [str(ROOT / "bench"), str(ROOT)]  # behind the installed package, which is the one that is tested

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
