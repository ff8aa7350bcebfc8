"""Which tests are asked of an error in a line: those that are known to run it (mutants_map.py), the most focused first.

A line in a function is run by the tests that ran its block; one that declares something (a constant, a field) is looked
for in the blocks that name it; one of C that no library of ours has, in those that name the functions that reach it.
First come tests whose own text names what was changed, then those that run the fewest blocks of the product at all, of
a parametrised test one case before the next. They are asked in batches, so that a file is loaded once for many tests.
Files that no map knows are asked behind them, as mutants_choice.py ranks them.
"""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from mutants_blocks import HEAD, blocks, blocks_in_c, innermost
from mutants_choice import DECLARING, HOME, LOADED, PRODUCT, asked, functions, naming, told

BATCHES = ((4.0, 5), (6.0, 7), (8.0, 9))
"""Seconds and files of tests that are asked together: small at first; the last one is repeated."""


@dataclass(frozen=True)
class Ran:
    """A test, its seconds, and the blocks that it ran, as the bits of a number."""

    name: str
    seconds: float
    blocks: int
    size: int


@dataclass
class Map:
    """What mutants_map.py wrote: tests by the blocks that they run; empty where there is none."""

    numbers: dict[str, int] = field(default_factory=dict)
    tests: list[Ran] = field(default_factory=list)
    files: set[str] = field(default_factory=set)

    def running(self, names: set[str]) -> list[Ran]:
        """The tests that ran any of some blocks."""
        mask = sum(1 << (len(self.numbers) - 1 - self.numbers[one]) for one in names & self.numbers.keys())
        return [one for one in self.tests if one.blocks & mask]

    def seconds(self, tests: Sequence[str]) -> float | None:
        """How long tests take, where each is known."""
        known = {one.name: one.seconds for one in self.tests}
        return sum(known[one] for one in tests) if known.keys() >= set(tests) else None


def read_map(path: Path | None) -> Map:
    """Read a map of which tests run which blocks."""
    from mutants_map import unpacked

    found = Map()
    if path:
        head, *lines = path.read_text("utf-8").splitlines()
        found.numbers = {name: number for number, name in enumerate(json.loads(head)["names"])}
        for line in map(json.loads, lines):
            bits = unpacked(line["blocks"])
            found.tests.append(Ran(f"{line['file']}::{line['test']}", line["seconds"], bits, bits.bit_count()))
            found.files.add(line["file"])
    return found


@cache
def _texts() -> dict[str, str]:
    """The product's modules and C files by their place."""
    paths = [path for room in PRODUCT for end in ("py", "c") for path in (HOME / room).rglob(f"*.{end}")]
    return {str(path.relative_to(HOME)): path.read_text("utf-8") for path in sorted(paths)}


@cache
def naming_blocks(name: str, modules: tuple[str, ...] = ()) -> frozenset[str]:
    """Blocks of Python that name something, of all modules or of some."""
    word, found = re.compile(rf"\b_?{re.escape(name)}\b"), set()
    for module, text in _texts().items():
        if not module.endswith(".py") or (modules and module not in modules) or not word.search(text):
            continue
        for number, line in enumerate(text.splitlines(), 1):
            if word.search(line) and (block := innermost(text, number)):
                found.add(block.named(module))
    return frozenset(found)


def candidates(module: Path, source: str, line: int) -> Iterator[set[str]]:
    """Sets of blocks whose tests may notice an error in a line, the nearest first."""
    place, is_c = str(module.relative_to(HOME)), module.suffix == ".c"
    block = innermost(source, line, is_c)
    if block:
        yield {block.named(place)}
        there = blocks_in_c(source) if is_c else blocks(source)
        yield {one.named(place) for one in there if one.function == block.function}
    if is_c:
        names = reaching(module, told(source, line, True))
        yield {block for name in names for block in naming_blocks(name)}
        yield {one.named(path) for path in LOADED[str(Path(place).parent)] for one in blocks(_texts()[path])}
        return
    if not block and (name := told(source, line, False)):
        yield set(naming_blocks(name, (place,)))
        yield set(naming_blocks(name))
    if not block:
        yield {one.named(place) for one in blocks(source)}


def reaching(module: Path, name: str) -> set[str]:
    """C functions of a folder that call one, or call what does, and itself; all of the file where it has no name."""
    bodies: dict[str, str] = {}
    for path in sorted(module.parent.glob("*.c")):
        text = path.read_text("utf-8")
        heads = list(HEAD.finditer(text))
        ends = [*(one.start() for one in heads), len(text)][1:]  # some files have no function
        bodies |= {head[1]: text[head.end() : end] for head, end in zip(heads, ends, strict=True)}
    found = {name} if name else {one[1] for one in HEAD.finditer(module.read_text("utf-8"))}
    while more := {
        caller
        for caller, body in bodies.items()
        if caller not in found and any(re.search(rf"\b{re.escape(one)}\b", body) for one in found)
    }:
        found |= more
    return found


def chosen(known: Map, module: Path, source: str, line: int) -> Iterator[list[str]]:
    """Batches of tests that are asked of an error in a line, without an end that matters: time ends it."""
    name = told(source, line, module.suffix == ".c")
    named, files = asked(module, source, line)
    declares = module.suffix == ".py" and not functions(source, line)
    unknown = [one for one in files if one not in known.files]
    before = [one for one in named if one.split("::")[0] in unknown] if known.files else named
    if declares:  # what tests of ranges read is run by no block of its own
        yield from ([one] for one in files[:1] if one in DECLARING.values() and one in known.files)
    if before and (declares or not known.files):
        yield before
    done: set[str] = set()
    for names in candidates(module, source, line):
        tests = [one for one in known.running(names) if one.name not in done]
        done |= {one.name for one in tests}
        yield from batches(ordered(tests, name))
    if before and not (declares or not known.files):
        yield before
    yield from ([one] for one in unknown)


def ordered(tests: list[Ran], name: str) -> list[Ran]:
    """Tests that name what was changed, then those that run least; of a parametrised one a case at a time."""
    cases: dict[str, int] = {}
    ranked = []
    naming_tests = {one for file in {test.name.split("::")[0] for test in tests} for one in _naming(file, name)}
    for one in sorted(tests, key=lambda test: (test.size, test.seconds)):
        function = one.name.split("[")[0]
        case = cases[function] = cases.get(function, -1) + 1
        ranked.append((function not in naming_tests and case + 1, one.seconds > 3, case, len(ranked), one))
    return [one for *_, one in sorted(ranked, key=lambda found: found[:-1])]


@cache
def _naming(file: str, name: str) -> tuple[str, ...]:
    path = HOME / "tests" / file
    return tuple(naming(file, name)) if name and path.is_file() else ()


def batches(tests: list[Ran]) -> Iterator[list[str]]:
    """Tests that are asked together, those of a file behind each other."""
    sizes = iter(BATCHES)
    most, files_most = next(sizes)
    batch: dict[str, list[str]] = {}
    spent = 0.0
    for test in tests:
        file = test.name.split("::")[0]
        if batch and (spent + test.seconds > most or (file not in batch and len(batch) >= files_most)):
            yield [one for names in batch.values() for one in names]
            batch, spent = {}, 0.0
            most, files_most = next(sizes, BATCHES[-1])
        batch.setdefault(file, []).append(test.name)
        spent += test.seconds
    if batch:
        yield [one for names in batch.values() for one in names]
