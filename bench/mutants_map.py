"""Which tests run which lines: a map for the choice of tests that are asked of a planted error.

    python bench/mutants_map.py --map FILE [--seconds 40] [--first hardware fmi master ...]

In a copy of the tree every block of the product (`mutants_blocks.py`) leaves a mark when it runs, in whatever process.
Files of tests run there one by one, the short ones first; for each test, and each fixture that several tests share, the
map says which blocks ran and how long it took. A file that takes longer than so many seconds of a processor is known
for the tests up to there. What is done is not done again: a run goes on where the last one ended.

The map lies outside of the project. It grows old with the code, and little harm is done: blocks are known by the
function that they are in, and are numbered anew when the next run goes on.
"""

import argparse
import base64
import json
import mmap
import os
import sys
import tempfile
import zlib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from shutil import copytree, ignore_patterns, rmtree
from typing import Any

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "cosim/master/loop")]

import mutants_blocks as marks  # noqa: E402
from build_hook import LIBRARIES, SUFFIX, compile_library  # noqa: E402
from mutants_choice import HOME, NOT_ASKED, PRODUCT, SLOW  # noqa: E402
from mutants_forks import forked, preloaded  # noqa: E402

from cosim.support.files import replacing  # noqa: E402

QUIET = ("-n0", "-q", "-p", "no:cacheprovider", "--no-header", "--tb=no", "--timeout=100")


class Marks:
    """The marks of one run, and whose they are: pytest calls the methods around each fixture and test."""

    def __init__(self, shared: Path, size: int, out: Path, file: str) -> None:
        with shared.open("r+b") as there:
            self._seen = mmap.mmap(there.fileno(), size)
        self._size, self._out, self._file = size, out, file
        self._fixtures: dict[str, int] = {}

    def taken(self) -> int:
        """Blocks that ran since the last call, as the bits of a number."""
        found = bytes(self._seen[: self._size])
        self._seen[: self._size] = bytes(self._size)
        return int(found.replace(b"\0", b"0").replace(b"\1", b"1").decode(), 2)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        """What a fixture for several tests runs belongs to each test that uses it."""
        before = self.taken()
        done = yield
        mine = self.taken()
        if fixturedef.scope != "function":
            self._fixtures[fixturedef.argname] = self._fixtures.get(fixturedef.argname, 0) | mine
            mine = 0
        self._pending = getattr(self, "_pending", 0) | before | mine
        return done

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        """A line of the map for each test."""
        self.taken()
        self._pending, begun = 0, spent()
        done = yield
        bits = self._pending | self.taken()
        for one in item.fixturenames:
            bits |= self._fixtures.get(one, 0)
        name = item.nodeid.removeprefix(f"tests/{self._file}::")
        line = {"file": self._file, "test": name, "seconds": round(spent() - begun, 3), "blocks": packed(bits)}
        with self._out.open("a", encoding="utf-8") as there:
            there.write(json.dumps(line) + "\n")
        return done


def spent() -> float:
    """Seconds of a processor of this process and those that it has started and ended."""
    return sum(os.times()[:4])


def packed(bits: int) -> str:
    """A set of numbers of blocks as a text."""
    return base64.b85encode(zlib.compress(bits.to_bytes((bits.bit_length() + 7) // 8 or 1, "big"), 9)).decode()


def unpacked(text: str) -> int:
    """What `packed` made a text of."""
    return int.from_bytes(zlib.decompress(base64.b85decode(text)), "big")


def copied(folder: Path) -> tuple[Path, list[str]]:
    """A copy of the tree whose blocks leave marks, and the names of the blocks by their numbers."""
    ignored = ignore_patterns(".git", ".venv", "__pycache__", "build", ".*_cache")
    place, names = Path(copytree(HOME, folder / "tree", ignore=ignored)), list[str]()
    for path in sorted(one for room in PRODUCT for one in (place / room).rglob("*.py")):
        source, module = path.read_text("utf-8"), str(path.relative_to(place))
        if path.name != "build_hook.py":
            path.write_text(marks.marked(source, len(names)), "utf-8")
            names += [one.named(module) for one in marks.blocks(source)]
    (place / f"{marks.SEEN_MODULE}.py").write_text(marks.MARKS, "utf-8")
    return place, names + _libraries(place, len(names))


def _libraries(place: Path, first: int) -> list[str]:
    """Let the C files of the libraries leave marks too, numbered from `first`; build them; names of their blocks."""
    texts = {one: (place / one).read_text("utf-8") for one in sorted({*chain(*LIBRARIES.values())})}
    found = {module: marks.blocks_in_c(text) for module, text in texts.items()}
    size, number = first + sum(map(len, found.values())), first
    for module, text in texts.items():
        (place / module).write_text(marks.marked_in_c(text, number, size), "utf-8")
        number += len(found[module])
    for target, sources in LIBRARIES.items():
        compile_library([place / one for one in sources], place / (target + SUFFIX))
    for module, text in texts.items():  # what is copied into an FMU is as it was
        (place / module).write_text(text, "utf-8")
    return [one.named(module) for module, blocks in found.items() for one in blocks]


def files_of_tests(first: list[str]) -> list[str]:
    """Files of tests that may be asked, those of some rooms first, of each the short ones first."""
    found = []
    for test in (HOME / "tests").rglob("test_*.py"):
        place = test.relative_to(HOME / "tests")
        if place.parts[0] not in NOT_ASKED and not test.stem.startswith(SLOW):
            rank = first.index(place.parts[0]) if place.parts[0] in first else len(first)
            found.append((rank, test.stat().st_size, str(place)))
    return [one for *_, one in sorted(found)]


def recorded(place: Path, names: list[str], file: str, seconds: float, out: Path) -> str:
    """Run a file of tests in the copy and write what ran; what is to be said of it."""
    shared, size = place / "marks", len(names)
    shared.write_bytes(bytes(size))
    os.environ[marks.SEEN_MODULE.upper()] = str(shared)

    def run() -> int:
        return int(pytest.main([*QUIET, f"tests/{file}"], plugins=[Marks(shared, size, out, file)]))

    code, seconds = forked(run, place, place / "said", seconds)
    return f"{file}: {seconds:.1f} s, {'not to its end' if code < 0 else f'ended with {code}'}"


def carried_over(path: Path, names: list[str]) -> set[str]:
    """Let a map that is there know the blocks of today by their numbers; the files of tests that it has."""
    head, *lines = path.read_text("utf-8").splitlines() if path.exists() else ['{"names": []}']
    before, now = json.loads(head)["names"], {name: number for number, name in enumerate(names)}
    old = [json.loads(one) for one in lines]
    if before != names:
        bit = {len(before) - 1 - k: len(names) - 1 - now[one] for k, one in enumerate(before) if one in now}
        for one in old:
            bits = bin(unpacked(one["blocks"]))[:1:-1]
            one["blocks"] = packed(sum(1 << bit[k] for k, is_set in enumerate(bits) if is_set == "1" and k in bit))
        with replacing(path, force=True) as partial:
            partial.write_text("".join(json.dumps(one) + "\n" for one in ({"names": names}, *old)), "utf-8")
    return {one["file"] for one in old}


def main() -> None:
    """Record what is not recorded yet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--map", type=Path, required=True, help="file of the map: a run goes on from there")
    parser.add_argument("--seconds", type=float, default=40, help="of a processor that a file may take")
    parser.add_argument("--first", nargs="+", default=[], help="folders of tests that come first")
    parser.add_argument("--most", type=int, default=10_000, help="files of tests")
    given = parser.parse_args()
    preloaded()
    folder = Path(tempfile.mkdtemp(prefix="mutants-map-"))
    try:
        place, names = copied(folder)
        done = carried_over(given.map, names)
        for file in [one for one in files_of_tests(given.first) if one not in done][: given.most]:
            print(recorded(place, names, file, given.seconds, given.map), flush=True)
    finally:
        rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
