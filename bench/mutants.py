"""Small errors planted in the code, one at a time: do the tests notice?

    python bench/mutants.py --seed 1 --count 150 --journal FILE --out results/robustness [--groups fmi ...]
    python bench/mutants.py --seed 1 --count 150 --journal FILE --out results/robustness --so-far [--remarks FILE.toml]
    python bench/mutants.py --journal FILE --out results/robustness --seconds 60 --ask MODULE:LINE=FILE_OF_TESTS ...

Each room of the product is a group (`GROUPS`), and of each as many errors are drawn: the kinds of `mutations.KINDS` in
turn, the place by chance, so that numbers, of which there are most, do not outweigh the rest. An error is written into
a copy of the tree (of C the libraries are built anew there), and files of tests run, the likeliest first
(`mutants_choice.py`), for so many seconds of a processor.

Noticed: a test failed that passes without the error, or no longer ended. Survived: none did. What does not compile is
no error to plant; another one is drawn in its place.
"""

import argparse
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import zip_longest
from math import ceil
from pathlib import Path
from random import Random
from shutil import copytree, ignore_patterns, rmtree
from time import monotonic

import casadi  # noqa: F401  what is loaded here need not be loaded in each fork
import fmpy  # noqa: F401
import pandas  # noqa: F401
import pyarrow.parquet  # noqa: F401
import pytest
import scipy.signal  # noqa: F401

sys.path[:0] = [str(Path(__file__).parent)]

import mutations  # noqa: E402
import mutations_c  # noqa: E402
from mutants_choice import HOME, asked  # noqa: E402
from mutants_page import Sample, Tried, journalled, written  # noqa: E402

GROUPS = {
    "models": ("pyfmi_models/*.py", "pyfmi_models/[adf]*/*.py", "pyfmi_models/effects/*.py", "cosim/models/*.py"),
    "export": ("pyfmi_models/export/*.py", "pyfmi_models/export/c/*.c"),
    "fmi": ("cosim/fmi/*.py",),
    "system": ("cosim/system/**/*.py",),
    "master": ("cosim/master/*.py",),
    "loop": ("cosim/master/loop/[!b]*.py", "cosim/master/loop/*.c"),
    "data": ("cosim/data/**/*.py", "cosim/support/*.py"),
    "estimation": ("cosim/estimation/**/*.py", "cosim/estimation/**/*.c"),
    "decide": tuple(f"cosim/diagnosis/{one}/*.py" for one in ("decide", "evidence", "search", "measure")),
    "effects": (
        "cosim/diagnosis/*.py",
        *(f"cosim/diagnosis/{one}/*.py" for one in ("effects", "terms", "trust", "answer")),
    ),
    "report": ("cosim/report/*.py", "cosim/plots/*.py"),
    "delivery": ("cosim/delivery/*.py", "cosim/simulators/*.py", "cosim/nesting/*.py", "cosim/nesting/c/*.c"),
    "hardware": ("cosim/hardware/*.py", "cosim/hardware/*.c"),
    "interface": ("cosim/cli/*.py", "cosim/api/*.py"),
    "exchange": ("cosim/calibration/*.py", "cosim/experiments/*.py", "cosim/sweeps/*.py", "cosim/investigation/*.py"),
}
"""Rooms of the product; of each as many errors are drawn."""
QUIET = ("-n0", "-q", "-x", "-p", "no:cacheprovider", "--no-header", "--tb=no", "-rfE", "--timeout=60")
OURS = (
    "cosim",
    "cosim_studies",
    "pyfmi_models",
    "mutants",
    "mutants_page",
    "mutants_choice",
    "mutations",
    "mutations_c",
)
"""What a fork loads anew, from the tree with the error."""
BUILD = "cosim/master/loop/build_hook.py"


def read(path: Path) -> tuple[str, list[mutations.Site]]:
    """The text of a module or a C file, and the places in it where errors can be planted."""
    source = path.read_text("utf-8")
    return source, (mutations_c if path.suffix == ".c" else mutations).sites(source)


def drawn(seed: int, groups: Sequence[str] = tuple(GROUPS)) -> Iterator[tuple[str, Path, int]]:
    """Group, module and number of a place, without an end: the groups in turn, so that a part is a fair sample."""
    lists = [_of_group(seed, group) for group in groups]
    for turn in zip_longest(*lists):
        yield from (one for one in turn if one)


def _of_group(seed: int, group: str) -> list[tuple[str, Path, int]]:
    """All errors of a group, in the order in which they are drawn: kinds in turn, places by chance."""
    dice, kinds = Random(f"{seed} {group}"), dict[str, list[tuple[str, Path, int]]]()
    for path in sorted({path for pattern in GROUPS[group] for path in HOME.glob(pattern)}):
        for number, site in enumerate(read(path)[1]):
            kinds.setdefault(site.kind, []).append((group, path, number))
    found = [dice.sample(kinds[kind], len(kinds[kind])) for kind in dice.sample(sorted(kinds), len(kinds))]
    return [one for turn in zip_longest(*found) for one in turn if one]


class Tree:
    """A copy of the work tree in which one error at a time is planted."""

    def __init__(self, folder: Path, seconds: float) -> None:
        ignored = ignore_patterns(".git", ".venv", "__pycache__", "build", ".*_cache")
        self.place, self.seconds = Path(copytree(HOME, folder / "tree", ignore=ignored)), seconds
        self._broken: set[str] = set()  # tests that fail here without an error too
        self._sound: dict[str, float] = {}  # tests, and whole files, that passed once, and their seconds

    def attempt(self, group: str, path: Path, number: int, more: Sequence[str] = ()) -> Tried | None:
        """Plant an error, ask tests (or those files that are named), take it back; None where it does not compile."""
        module = str(path.relative_to(HOME))
        source = (self.place / module).read_text("utf-8")  # the work tree may have moved on
        site, text = (mutations_c if path.suffix == ".c" else mutations).mutated(source, number)
        begun, (named, files) = monotonic(), ([], list(more)) if more else asked(path, source, site.line)
        while True:
            try:
                if not self._written(module, text):
                    return None
                witness = self._noticed(named, files)
            finally:
                self._written(module, source)
            if not witness or self._is_sound(witness):
                seconds = round(monotonic() - begun, 1)
                return Tried(group, module, number, site.line, site.kind, site.change, witness, seconds)
            if not named:
                files = files[files.index(witness.split("::")[0]) :]
            named = [one for one in named if one not in self._broken]

    def _written(self, module: str, text: str) -> bool:
        """Write a file and build the libraries that have it in them; whether they compile."""
        (self.place / module).write_text(text, "utf-8")
        if not module.endswith(".c") or not module.startswith("cosim"):
            return True
        code = f"import sys; sys.path.insert(0, {str(Path(BUILD).parent)!r}); import build_hook as b\n"
        code += f"for target, sources in b.LIBRARIES.items():\n    if {module!r} in sources:\n"
        code += "        b.compile_library([b.ROOT / one for one in sources], b.ROOT / (target + b.SUFFIX))\n"
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=self.place, env=os.environ | {"PYTHONPATH": ""}, capture_output=True
        )
        return done.returncode == 0

    def _noticed(self, named: Sequence[str], files: Sequence[str]) -> str:
        """The first test that fails: of those named, together, then of files one by one, as long as the time lasts."""
        left = self.seconds
        for tests in [*([named] if named else []), *([file] for file in files)]:
            if left <= 1:
                return ""
            witness, spent = self._failed(tests, left)
            if witness:
                return witness
            left -= spent
        return ""

    def _failed(self, tests: Sequence[str], left: float) -> tuple[str, float]:
        """Run tests for so many seconds of a processor; what failed there, and seconds; "(time)": what used to end."""
        said = self.place / "said"
        pid = os.fork()
        if not pid:  # whatever happens there, nothing of the bench goes on in the fork
            try:
                os._exit(self._tested(tests, said, ceil(left)))
            finally:
                os._exit(4)
        _, status, usage = os.wait4(pid, 0)
        end_all(pid)
        code, spent = os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime
        known = self._sound.get(" ".join(tests))
        if code == -signal.SIGXCPU:
            return (f"{tests[0]} (time)" if known and known < left / 2 else ""), spent
        if code in (0, 5):  # 5: no tests here
            self._sound |= dict.fromkeys((*tests, " ".join(tests)), spent)
            return "", spent
        lost = re.findall(
            r"^(?:FAILED|ERROR) tests/(\S+?\.py(?:::.*?)?)(?: - .*)?$", said.read_text("utf-8", "replace"), re.M
        )
        return (lost[0] if lost else tests[0]), spent

    def _tested(self, tests: Sequence[str], said: Path, most: int) -> int:
        """Run tests here, in a fork that has all but the tree loaded already; what pytest ends with."""
        os.setsid()
        os.chdir(self.place)
        os.environ |= {"PYTHONPATH": str(self.place), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        sys.dont_write_bytecode = True
        resource.setrlimit(resource.RLIMIT_CPU, (most, most + 5))
        sys.path[:] = [str(self.place), *(one for one in sys.path if not _is_of_home(one))]
        for module in [one for one in sys.modules if one.split(".")[0] in OURS]:
            del sys.modules[module]
        with said.open("w") as output:
            os.dup2(output.fileno(), 1)
            os.dup2(output.fileno(), 2)
        left_out = [f"--deselect=tests/{one}" for one in self._broken]
        return int(pytest.main([*QUIET, *left_out, *(f"tests/{one}" for one in tests)]))

    def _is_sound(self, witness: str) -> bool:
        """Whether a test passes without the error; one that does not is asked no more."""
        if witness.endswith(" (time)") or self._sound.keys() & {witness, witness.split("[")[0], witness.split("::")[0]}:
            return True
        again, _ = self._failed([witness], 60)
        if again:
            self._broken.add(witness)
        return not again


def _is_of_home(folder: str) -> bool:
    """Whether modules there are those of which a copy is changed; a virtual environment may lie in their tree."""
    return (folder == str(HOME) or folder.startswith(str(HOME) + os.sep)) and not folder.startswith(sys.prefix + os.sep)


def end_all(group: int) -> None:
    """End what a file of tests left behind: it had a session of its own."""
    with suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def todo(seed: int, count: int, groups: Sequence[str], tried: Iterable[Tried]) -> Iterator[tuple[str, Path, int]]:
    """The errors of a sample that were not tried yet; one more a group for each that did not compile."""
    done = {(one.module, one.site) for one in tried}
    for group, path, number in drawn(seed, groups):
        if len(done) >= count:
            return
        if (key := (str(path.relative_to(HOME)), number)) not in done:
            yield group, path, number
            done.add(key)


def todo_again(ask: Sequence[str], tried: Sequence[Tried]) -> Iterator[tuple[str, Path, int, tuple[str, ...]]]:
    """The survivors for which a file of tests is named: the choice of tests does not see all that are near."""
    named = dict(one.split("=") for one in ask)
    for one in tried:
        if not one.noticed and (file := named.get(f"{one.module}:{one.line}")):
            yield one.group, HOME / one.module, one.site, (file,)


def main() -> None:
    """Plant, count, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--seconds", type=float, default=20, help="of a processor that the tests of an error may take")
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=list(GROUPS))
    parser.add_argument("--journal", type=Path, required=True, help="file of what is done: a run goes on from there")
    parser.add_argument("--ask", nargs="+", default=[], help="MODULE:LINE=FILE: tests that a survivor is asked too")
    parser.add_argument("--remarks", type=Path, help="what is known of survivors (.toml): why, by MODULE:LINE")
    parser.add_argument("--page", default="mutants.md", help="name of the page")
    parser.add_argument("--so-far", action="store_true", help="only write the page of what the journal has")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    if not given.so_far:
        folder = Path(tempfile.mkdtemp(prefix="mutants-"))
        try:
            run(Tree(folder, given.seconds), given)
        finally:
            rmtree(folder, ignore_errors=True)
    remarks = tomllib.loads(given.remarks.read_text("utf-8")) if given.remarks else {}
    sample = Sample(given.seed, given.count, given.seconds)
    written(journalled(given.journal), sample, given.out / given.page, remarks)


def run(tree: Tree, given: argparse.Namespace) -> None:
    """Try what is left of a sample; each goes into the journal at once."""
    tried_before = journalled(given.journal)
    new = ((*one, ()) for one in todo(given.seed, given.count, given.groups, tried_before))
    for group, path, number, more in todo_again(given.ask, tried_before) if given.ask else new:
        tried = tree.attempt(group, path, number, more)
        if tried is None:
            print(f"{path.relative_to(HOME)}: {number} does not compile", flush=True)
            continue
        print(f"{tried.module}:{tried.line} {tried.kind} {tried.change}: {tried.noticed or 'SURVIVED'}", flush=True)
        with given.journal.open("a", encoding="utf-8") as file:
            file.write(json.dumps(vars(tried)) + "\n")


if __name__ == "__main__":
    main()
