"""Small errors planted in the code, one at a time: do the tests notice?

    python bench/mutants.py --seed 1 --count 150 --map MAP --journal FILE --out results/robustness [--groups fmi ...]
    python bench/mutants.py --seed 1 --count 150 --journal FILE --out results/robustness --so-far [--remarks FILE.toml]
    python bench/mutants.py --map MAP --journal FILE --out results/robustness --again
    python bench/mutants.py --journal FILE --out results/robustness --seconds 60 --ask MODULE:LINE=FILE_OF_TESTS ...

Each room of the product is a group (`GROUPS`), and of each as many errors are drawn: the kinds of `mutations.KINDS` in
turn, the place by chance, so that numbers, of which there are most, do not outweigh the rest. An error is written into
a copy of the tree (of C the libraries are built anew there), and tests run for so many seconds of a processor: those
that are known to run the line (`--map`: mutants_map.py, mutants_chosen.py), the most focused first; without a map files
of tests that name what was changed or are near (mutants_choice.py).

Noticed: a test failed that passes without the error, or no longer ended. Survived: none did. What does not compile is
no error to plant; another one is drawn in its place.
"""

import argparse
import json
import re
import signal
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from random import Random
from shutil import copy2, copytree, ignore_patterns, rmtree
from time import monotonic

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "cosim/master/loop")]

import mutations  # noqa: E402
import mutations_c  # noqa: E402
from build_hook import LIBRARIES, SUFFIX, compile_library  # noqa: E402
from mutants_choice import HOME  # noqa: E402
from mutants_chosen import Map, chosen, read_map  # noqa: E402
from mutants_forks import forked, preloaded  # noqa: E402
from mutants_page import Sample, Tried, journalled, written  # noqa: E402

GROUPS = {
    "models": ("pyfmi_models/*.py", "pyfmi_models/[adf]*/*.py", "pyfmi_models/effects/*.py", "cosim/models/*.py"),
    "export": ("pyfmi_models/export/*.py", "pyfmi_models/export/c/*.c"),
    "fmi": ("cosim/fmi/*.py",),
    "system": ("cosim/system/**/*.py",),
    "master": ("cosim/master/*.py",),
    "loop": ("cosim/master/loop/[!b]*.py", "cosim/master/loop/*.c"),
    "data": ("cosim/data/**/*.py", "cosim_readers/*.py", "cosim/support/*.py"),
    "estimation": ("cosim/estimation/**/*.py", "cosim/estimation/**/*.c"),
    "decide": tuple(f"cosim/diagnosis/{one}/*.py" for one in ("decide", "evidence", "search", "measure")),
    "effects": (
        "cosim/diagnosis/*.py",
        *(f"cosim/diagnosis/{one}/*.py" for one in ("effects", "terms", "trust", "answer")),
    ),
    "report": ("cosim/report/*.py", "cosim/plots/*.py"),
    "delivery": ("cosim/delivery/*.py", "cosim_simulators/*.py", "cosim_nesting/*.py", "cosim_nesting/c/*.c"),
    "hardware": ("cosim/hardware/*.py", "cosim/hardware/*.c", "cosim_ethercat/*.py"),
    "interface": ("cosim/cli/*.py", "cosim/api/*.py"),
    "exchange": ("cosim_calibration/*.py", "cosim/experiments/*.py", "cosim_sweeps/*.py", "cosim_investigation/*.py"),
}
"""Rooms of the product; of each as many errors are drawn."""
QUIET = ("-n0", "-q", "-x", "-p", "no:cacheprovider", "--no-header", "--tb=no", "-rfE", "--timeout=60")
LOST = r"^(?:FAILED|ERROR) tests/(\S+?\.py(?:::.*?)?)(?: - .*)?$"
GONE = r"^ERROR: not found: \S*?/tests/(.*)$"
"""What pytest says of a test that failed, and of one that is there no more."""
LOADING = 4.0
"""Seconds of a processor in which a file of tests is loaded at most."""
NOT_COLLECTED = "(not collected)"


def read(path: Path) -> tuple[str, list[mutations.Site]]:
    """The text of a module or a C file, and the places in it where errors can be planted."""
    source = path.read_text("utf-8")
    return source, (mutations_c if path.suffix == ".c" else mutations).sites(source)


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

    def __init__(self, folder: Path, seconds: float, known: Map | None = None) -> None:
        ignored = ignore_patterns(".git", ".venv", "__pycache__", "build", ".*_cache")
        self.place, self.seconds = Path(copytree(HOME, folder / "tree", ignore=ignored)), seconds
        self._known = known or Map()
        self._broken: set[str] = set()  # tests that fail here without an error too, or are there no more
        self._sound: dict[str, float] = {}  # tests, and whole files, that passed once, and their seconds

    def attempt(self, group: str, path: Path, number: int, more: Sequence[str] = ()) -> Tried | None:
        """Plant an error, ask tests (or those files that are named), take it back; None where it does not compile."""
        module = str(path.relative_to(HOME))
        source = (self.place / module).read_text("utf-8")  # the work tree may have moved on
        site, text = (mutations_c if path.suffix == ".c" else mutations).mutated(source, number)
        begun, left, witness = monotonic(), self.seconds, ""
        batches = iter([[one] for one in more]) if more else chosen(self._known, path, source, site.line)
        try:
            if not self._written(module, text):
                return None
            tests = next(batches, [])
            while tests and left > 1:
                witness, spent = self._failed(tests, left)
                left -= spent
                if not witness:
                    tests = next(batches, [])
                    continue
                self._written(module, source)
                if self._is_sound(witness, tests):
                    break
                self._written(module, text)
                witness, tests = "", [one for one in tests if one not in self._broken]
        finally:
            self._written(module, source)
        seconds = round(monotonic() - begun, 1)
        return Tried(group, module, number, site.line, site.kind, site.change, witness, seconds)

    def _written(self, module: str, text: str) -> bool:
        """Write a file and build the libraries that have it in them; whether they compile."""
        if (self.place / module).read_text("utf-8") == text:
            return True
        (self.place / module).write_text(text, "utf-8")
        built = [target for target, sources in LIBRARIES.items() if module in sources]
        if text == (HOME / module).read_text("utf-8") and all((HOME / (one + SUFFIX)).exists() for one in built):
            for one in built:  # as they were
                copy2(HOME / (one + SUFFIX), self.place / (one + SUFFIX))
            return True
        try:
            for one in built:
                compile_library([self.place / source for source in LIBRARIES[one]], self.place / (one + SUFFIX))
        except RuntimeError:
            return False
        return True

    def _failed(self, tests: Sequence[str], left: float) -> tuple[str, float]:
        """Run tests for so many seconds of a processor; what failed there, and seconds; "(time)": what used to end."""
        said = self.place / "said"
        left_out = [f"--deselect=tests/{one}" for one in self._broken]
        command = [*QUIET, *left_out, *(f"tests/{one}" for one in tests if one not in self._broken)]
        code, spent = forked(lambda: int(pytest.main(command)), self.place, said, left)
        if code == -signal.SIGXCPU:
            known = self._sound.get(" ".join(tests)) or self._known.seconds(tests)
            return (f"{tests[0]} (time)" if known and known + LOADING < left / 2 else ""), spent
        if code in (0, 5):  # 5: no tests here
            self._sound |= dict.fromkeys((*tests, " ".join(tests)), spent)
            return "", spent
        lost = re.findall(LOST, said.read_text("utf-8", "replace"), re.M)
        return (lost[0] if lost else f"{tests[0]} {NOT_COLLECTED}"), spent

    def _is_sound(self, witness: str, tests: Sequence[str]) -> bool:
        """Whether a test passes without the error; one that does not is asked no more."""
        if witness.endswith(" (time)") or self._sound.keys() & {witness, witness.split("[")[0], witness.split("::")[0]}:
            return True
        again, _ = self._failed(tests if witness.endswith(NOT_COLLECTED) else [witness], 60)
        if again:
            gone = re.findall(GONE, (self.place / "said").read_text("utf-8", "replace"), re.M)
            self._broken |= {*gone} or {witness.removesuffix(f" {NOT_COLLECTED}")}
        return not again


def todo(seed: int, count: int, groups: Sequence[str], tried: list[Tried]) -> Iterator[tuple[str, Path, int]]:
    """The errors of a sample until so many are in `tried`, of each group as many; what does not compile is passed."""
    lists = {group: iter(_of_group(seed, group)) for group in groups}
    passed = {(one.module, one.site) for one in tried}
    while len(tried) < count:
        group = min(groups, key=lambda one: sum(found.group == one for found in tried))
        _, path, number = next(one for one in lists[group] if (str(one[1].relative_to(HOME)), one[2]) not in passed)
        yield group, path, number


def todo_again(ask: Sequence[str], tried: Sequence[Tried]) -> Iterator[tuple[str, Path, int, tuple[str, ...]]]:
    """The survivors, each with the file of tests that is named for it; without names all, by the map as it is now."""
    named = dict(one.split("=") for one in ask)
    for one in tried:
        file = named.get(f"{one.module}:{one.line}", "")
        if not one.noticed and (file or not named):
            yield one.group, HOME / one.module, one.site, (file,) if file else ()


def main() -> None:
    """Plant, count, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--seconds", type=float, default=25, help="of a processor that the tests of an error may take")
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=list(GROUPS))
    parser.add_argument("--map", type=Path, help="file of mutants_map.py: which tests run which lines")
    parser.add_argument("--journal", type=Path, required=True, help="file of what is done: a run goes on from there")
    parser.add_argument("--ask", nargs="+", default=[], help="MODULE:LINE=FILE: tests that a survivor is asked too")
    parser.add_argument("--again", action="store_true", help="ask the survivors once more, by a map that has grown")
    parser.add_argument("--remarks", type=Path, help="what is known of survivors (.toml): why, by MODULE:LINE")
    parser.add_argument("--page", default="mutants.md", help="name of the page")
    parser.add_argument("--so-far", action="store_true", help="only write the page of what the journal has")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    if not given.so_far:
        folder = Path(tempfile.mkdtemp(prefix="mutants-"))
        try:
            preloaded()
            run(Tree(folder, given.seconds, read_map(given.map)), given)
        finally:
            rmtree(folder, ignore_errors=True)
    remarks = tomllib.loads(given.remarks.read_text("utf-8")) if given.remarks else {}
    sample = Sample(given.seed, given.count, given.seconds)
    written(journalled(given.journal), sample, given.out / given.page, remarks)


def run(tree: Tree, given: argparse.Namespace) -> None:
    """Try what is left of a sample; each goes into the journal at once."""
    tried_before = journalled(given.journal)
    new = ((*one, ()) for one in todo(given.seed, given.count, given.groups, tried_before))
    again = todo_again(given.ask, list(tried_before))
    for group, path, number, more in again if given.ask or given.again else new:
        tried = tree.attempt(group, path, number, more)
        if tried is None:
            print(f"{path.relative_to(HOME)}: {number} does not compile", flush=True)
            continue
        print(f"{tried.module}:{tried.line} {tried.kind} {tried.change}: {tried.noticed or 'SURVIVED'}", flush=True)
        tried_before.append(tried)
        with given.journal.open("a", encoding="utf-8") as file:
            file.write(json.dumps(vars(tried)) + "\n")


if __name__ == "__main__":
    main()
