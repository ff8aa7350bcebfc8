"""The loop needs absolute sleeps: elsewhere than on Linux nothing of it is tested."""

import sys

if sys.platform != "linux":
    collect_ignore_glob = ["test_*.py"]
