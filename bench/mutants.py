"""Small errors planted in the code, one at a time: do the tests notice?

    python bench/reach.py --out FILE
    python bench/mutants.py --seed 1 --count 160 --reach FILE --out results/robustness [--journal FILE]
    python bench/mutants.py --journal FILE --ask MODULE=FILE_OF_TESTS ... --out results/robustness

A mutant is a module with one operator, number or truth value changed, or one call left out (`mutations.py`). It is
written into a copy of the tree, and tests run there until one fails, for `BUDGET` seconds (`mutants_choice.py`): those
that call the function which was changed, the cheapest of each kind first; of what is declared outside of functions
`DECLARING`, then those that name or use it, the nearest first; without `--reach`, or where none is known, the files of
tests nearest to the module, by imports and names. Killed: a test failed that passes without the error, or no longer
ended. Survived: none did. Which test calls what is not always seen (a test that finds made what one before it made
calls less), so a survivor may be asked whole files more, by `--ask`.
"""

import argparse
import json
import os
import re
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from random import Random
from shutil import copytree, ignore_patterns, rmtree

import casadi  # noqa: F401  what is loaded here need not be loaded in each fork
import fmpy  # noqa: F401
import pandas  # noqa: F401
import pyarrow.parquet  # noqa: F401
import pytest
import scipy.signal  # noqa: F401

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "tests/tools")]

from mutants_choice import around, belonging, calling  # noqa: E402
from mutants_fork import HOME, QUIET, TOO_LONG, Server, function_of, limited, prepared  # noqa: E402
from mutants_page import Sample, Tried, journalled, written  # noqa: E402
from mutations import mutated, sites  # noqa: E402
from reach import Reached, read  # noqa: E402

GROUPS = {
    "models": (
        "pyfmi_models/*.py",
        "pyfmi_models/adrc/*.py",
        "pyfmi_models/friction/*.py",
        "pyfmi_models/effects/*.py",
    ),
    "master": ("cosim/master/*.py", "cosim/master/loop/[!b]*.py"),
    "hardware": ("cosim/hardware/*.py",),
    "decision": (
        "cosim/diagnosis/decide/decision.py",
        "cosim/diagnosis/evidence/marginal.py",
        "cosim/diagnosis/evidence/adequacy.py",
        "cosim/diagnosis/search/rivals.py",
        "cosim/diagnosis/search/admissibility.py",
        "cosim/diagnosis/search/proof.py",
    ),
}
"""Modules whose tests are tested; from each group as many mutants."""
NO_SUCH_TEST = "ERROR: not found: "
"""What pytest says of a name that no test has: no error was noticed there."""
LOST = ("FAILED", "ERROR")
"""What pytest says of a test that noticed."""
DECLARING = ("test_parameter_ranges.py", "test_machine_ranges.py")
"""Tests of what a module only declares, which calls none of its functions: asked of lines outside of functions."""


def drawn(seed: int, count: int) -> Iterator[tuple[str, Path, int]]:
    """Group, module and number of the site of each mutant, the groups in turn: a part of them is a fair sample."""
    dice, lists = Random(seed), []
    for group, patterns in GROUPS.items():
        modules = sorted(path for pattern in patterns for path in HOME.glob(pattern))
        every = [(group, path, site) for path in modules for site in range(len(sites(path.read_text("utf-8"))))]
        lists.append(dice.sample(every, min(len(every), -(-count // len(GROUPS)))))
    for turn in range(max(map(len, lists))):
        yield from (one[turn] for one in lists if turn < len(one))


def copied(folder: Path) -> Path:
    """Copy the tree, with its compiled libraries."""
    ignored = ignore_patterns(".git", ".venv", "__pycache__", "build", "results", ".*_cache")
    return Path(copytree(HOME, folder / "tree", ignore=ignored))


def noticed(tree: Path, tests: Sequence[str], without: Iterable[str] = ()) -> str:
    """Run files of tests in a tree, one after the other, until one fails; what `failed` says of it."""
    return next(filter(None, (failed(tree, [name], without) for name in tests)), "")


def failed(tree: Path, tests: Sequence[str], without: Iterable[str] = ()) -> str:
    """Run tests, some left out, until one fails; its name "(time)" where they did not end, or nothing."""
    said = tree / "said"
    pid = os.fork()
    if not pid:
        os._exit(_tested(tree, tests, said, without))
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    if code in TOO_LONG:
        return f"{tests[0]} (time)"
    if code in (0, 5):  # 5: no tests here
        return ""
    text = said.read_text("utf-8", "replace")
    if NO_SUCH_TEST in text:
        raise SystemExit(f"{tree}: of the tests that are asked some are not there: {text[-300:]}")
    lost = [one.split(" - ")[0] for one in text.splitlines() if one.startswith(LOST)]
    named = re.search(r"tests/((?:\w+/)*test_\w+\.py::.*)", lost[-1]) if lost else None
    return named[1] if named else tests[0]


def _tested(tree: Path, tests: Sequence[str], said: Path, without: Iterable[str]) -> int:
    """Run tests here, in a fork that has all but the tree loaded already; what pytest ends with."""
    limited()
    prepared(tree, said)
    left_out = [f"--deselect=tests/{one}" for one in without]
    return int(pytest.main([*QUIET, "-x", *left_out, *(f"tests/{name}" for name in tests)]))


class Asking:
    """Who asks tests: those that call a function, in the server, else in a fork that loads all anew.

    Args:
        tree: a copy, in which errors are planted.
        reached: which test calls what; without it the nearest files are asked.
    """

    def __init__(self, tree: Path, reached: Sequence[Reached] = ()) -> None:
        self.tree = tree
        self._broken: set[str] = set()  # tests that fail in the copy without an error too
        files = sorted({one.test.split("::")[0].removeprefix("tests/") for one in reached})
        self._server = Server(tree, files) if files else None
        there = self._server.tests if self._server else frozenset()
        self._reached = [one for one in reached if one.test.removeprefix("tests/") in there]

    def attempt(self, group: str, path: Path, site: int, files: Sequence[str] = ()) -> Tried:
        """Plant one error, run the tests (or whole files of them), take it back."""
        source, place, module = path.read_text("utf-8"), self.tree / path.relative_to(HOME), str(path.relative_to(HOME))
        line, change, text = mutated(source, site)
        while True:
            known = calling(module, source, line, () if files else self._reached)
            known = tuple(one for one in known if one not in self._broken)
            try:
                place.write_text(text, "utf-8")
                declares = not files and not around(source, line)
                witness = noticed(self.tree, DECLARING, self._broken) if declares else ""
                if not witness and known:
                    witness = self._failed(known, module, source, line)
                elif not witness:
                    witness = noticed(self.tree, files or belonging(path), self._broken)
            finally:
                place.write_text(source, "utf-8")
            if not witness or witness.endswith("(time)") or not self._failed([witness]):
                return Tried(group, module, site, line, change, witness)
            if witness in self._broken:
                raise SystemExit(f"{witness} fails in the tree as it is")
            self._broken.add(witness)

    def _failed(self, tests: Sequence[str], module: str = "", source: str = "", line: int = 0) -> str:
        function = function_of(source, line) if module else ""
        found = self._server.failed(tests, module, function) if self._server and (function or not module) else None
        return failed(self.tree, tests) if found is None else found

    def close(self) -> None:
        """End the server, if there is one."""
        if self._server:
            self._server.close()


def main() -> None:
    """Plant, count, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=160)
    parser.add_argument("--reach", type=Path, help="file that reach.py wrote")
    parser.add_argument("--journal", type=Path, help="file of what is done: a run that ended early goes on from there")
    parser.add_argument("--ask", nargs="*", default=[], help="MODULE=FILE: tests that survivors there are asked too")
    parser.add_argument("--remarks", type=Path, help="what is known of survivors (.toml): why, by MODULE:LINE")
    parser.add_argument("--page", default="mutants.md", help="name of the page")
    parser.add_argument("--so-far", action="store_true", help="only write the table of what the journal has")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    if given.so_far:
        told(given, journalled(given.journal))
        return
    folder = Path(tempfile.mkdtemp(prefix="mutants-"))
    reached = read(given.reach) if given.reach else []
    journal = given.journal or folder / "journal"
    try:
        asking = Asking(copied(folder), reached)
        again = todo_again(given.ask, journalled(journal))
        for group, path, site, files in again if given.ask else todo(given.seed, given.count, journal):
            tried = asking.attempt(group, path, site, files)
            print(f"{tried.module}:{tried.line} {tried.change}: {tried.noticed or 'SURVIVED'}", flush=True)
            with journal.open("a", encoding="utf-8") as file:
                file.write(json.dumps(vars(tried)) + "\n")
        asking.close()
        tried_all = journalled(journal)
    finally:
        rmtree(folder, ignore_errors=True)
    told(given, tried_all)


def todo(seed: int, count: int, journal: Path) -> Iterator[tuple[str, Path, int, tuple[str, ...]]]:
    """The mutants of a sample that the journal does not have."""
    for group, path, site in drawn(seed, count):
        if (str(path.relative_to(HOME)), site) not in {(one.module, one.site) for one in journalled(journal)}:
            yield group, path, site, ()


def todo_again(asked: Sequence[str], tried: Sequence[Tried]) -> list[tuple[str, Path, int, tuple[str, ...]]]:
    """The survivors in modules for which files of tests are named, with these."""
    named = [one.split("=") for one in asked]
    files = {one.module: tuple(file for module, file in named if module == one.module) for one in tried}
    left = [one for one in tried if not one.noticed and files[one.module]]
    return [(one.group, HOME / one.module, one.site, files[one.module]) for one in left]


def told(given: argparse.Namespace, tried: Sequence[Tried]) -> None:
    """Write the page."""
    remarks = tomllib.loads(given.remarks.read_text("utf-8")) if given.remarks else {}
    written(tried, Sample(given.seed, given.count), given.out / given.page, remarks)


if __name__ == "__main__":
    main()
