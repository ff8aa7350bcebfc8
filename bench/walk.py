"""How many files a command walks through: python bench/walk.py run sidereal --out OUT

Runs a command line in this process and notes each call from one file of the packages to another, in the order in which
they first occur. Printed are files, hops (pairs of files, each counted once), returns (hops into a file that an earlier
hop had entered) and classes of the packages whose instances were handed on at a hop.
"""

import os
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

PACKAGES = ("cosim", "pyfmi_models")


class Walk:
    """Notes hops; to be called by `sys.setprofile`."""

    def __init__(self, root: Path) -> None:
        self.root, self.hops, self.types = root, dict[tuple[str, str], bool](), set[str]()
        self.entered: set[str] = set()

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        before = frame.f_back
        if event != "call" or before is None or frame.f_code.co_name == "<module>":
            return
        hop = (self._file(before), self._file(frame))
        if not all(hop) or hop[0] == hop[1]:
            return
        self.types |= set(self._handed(frame))
        if hop not in self.hops:
            self.hops[hop] = hop[1] in self.entered
            self.entered.add(hop[1])

    def _file(self, frame: FrameType) -> str:
        path = frame.f_code.co_filename
        inside = os.path.relpath(path, self.root) if path.startswith(str(self.root)) else ""
        return inside if inside.startswith(PACKAGES) else ""

    def _handed(self, frame: FrameType) -> Iterator[str]:
        code = frame.f_code
        for name in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]:
            kind = type(frame.f_locals.get(name))
            if kind.__module__.startswith(PACKAGES) and not kind.__name__.startswith("_"):
                yield f"{kind.__module__}.{kind.__name__}"


def main() -> None:
    walk = Walk(Path.cwd())
    sys.argv = ["cosim", *sys.argv[1:]]
    sys.path.insert(0, str(walk.root))
    sys.setprofile(walk)
    try:
        runpy.run_module("cosim", run_name="__main__")
    except SystemExit:
        pass
    finally:
        sys.setprofile(None)
    files = {one for hop in walk.hops for one in hop}
    returns = sum(walk.hops.values())
    print(f"types {len(walk.types)}, files {len(files)}, hops {len(walk.hops)}, returns {returns}", file=sys.stderr)


if __name__ == "__main__":
    main()
