"""Which test calls which function of the product, and what a test costs: what mutants.py asks before it runs tests.

    python bench/reach.py --out FILE [--files test_master.py ...]

Each file of tests runs in a fork that notes every call of a function of the product. One line of JSON a test: its name,
its seconds, and of each module the qualified names of the functions that it called: lines move, names seldom do.
"""

import argparse
import json
import os
import resource
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import casadi  # noqa: F401  what is loaded here need not be loaded in each fork
import fmpy  # noqa: F401
import pandas  # noqa: F401
import pyarrow.parquet  # noqa: F401
import pytest
import scipy.signal  # noqa: F401

import cosim

HOME = Path(__file__).parents[1]
PRODUCT = Path(cosim.__file__).parents[1]
"""Where the product is that the tests call: this checkout, or where it was installed."""
TRACED = tuple(f"{PRODUCT / name}{os.sep}" for name in ("cosim", "pyfmi_models"))
SECONDS = 240
"""Of a processor that a file of tests may take here; those of its tests that come later are not known."""


@dataclass(frozen=True)
class Reached:
    """A test: its name, its seconds, and of each module the qualified names of what it called."""

    test: str
    seconds: float
    calls: dict[str, list[str]]


class Noting:
    """A plugin of pytest: notes the calls of each test that passes."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self._calls: set[tuple[str, str]] = set()
        self._passed = False

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        self._calls, self._passed = set(), False
        begun = time.monotonic()
        sys.setprofile(self._note)
        yield
        sys.setprofile(None)
        if self._passed:
            line = {"test": item.nodeid, "seconds": round(time.monotonic() - begun, 3), "calls": self._by_module()}
            with self._out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")

    def pytest_runtest_logreport(self, report: Any) -> None:
        self._passed |= report.when == "call" and report.passed

    def _note(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(TRACED):
            self._calls.add((frame.f_code.co_filename, frame.f_code.co_qualname))

    def _by_module(self) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        for path, name in sorted(self._calls):
            found.setdefault(str(Path(path).relative_to(PRODUCT)), []).append(name)
        return found


def read(path: Path) -> list[Reached]:
    """The tests of a file that was written here, the cheapest first."""
    lines = path.read_text("utf-8").splitlines()
    return sorted((Reached(**json.loads(one)) for one in lines), key=lambda one: one.seconds)


def gather(names: Iterable[str], out: Path) -> None:
    """Run files of tests, each in a fork, and write down what they call."""
    for name in names:
        begun = time.monotonic()
        pid = os.fork()
        if not pid:
            os._exit(_run(name, out))
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        print(f"{name}: exit {code}, {time.monotonic() - begun:.0f} s", flush=True)


def _run(name: str, out: Path) -> int:
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    os.chdir(HOME)
    with open(os.devnull, "w") as quiet:
        os.dup2(quiet.fileno(), 1)
    return int(pytest.main(["-n0", "-q", "-p", "no:cacheprovider", f"tests/{name}"], plugins=[Noting(out)]))


def main(arguments: Sequence[str] | None = None) -> None:
    """Gather, and go on where an earlier run ended."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", nargs="*", help="files of tests; all where none is named")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    gather(
        given.files or sorted(str(one.relative_to(HOME / "tests")) for one in (HOME / "tests").rglob("test_*.py")),
        given.out.absolute(),
    )


if __name__ == "__main__":
    main()
