"""Spoilt files, numbers and requests of every kind: what is it that a user sees, and what is left?

    python bench/attack.py --seed 1 --out results/robustness [--count 5200] [--journal FILE --seconds 250]

Each mutation runs in a forked process with limits of time and memory (attack_worker.py) and ends in one of these ways:

    refused      exit code 2, one sentence, no traceback
    answered     exit code 0 with a result that is whole (or 1, where yes or no was asked)
    long         still at work after 15 s of a processor; Ctrl-C ended it well
    traceback, crash (a signal), hung (Ctrl-C did not end it), silent (success without a result), left (files of no
    use, or a process), unclear (anything else): defects. There must be none.
"""

import argparse
import collections
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from shutil import rmtree

for name in ("OMP", "OPENBLAS", "ARROW"):
    os.environ.setdefault(f"{name}_NUM_THREADS", "1")
sys.path[:0] = [
    str(Path(__file__).parent),
    *(str(Path(__file__).parents[1] / one) for one in ("tests/tools", "tests/data")),
]

from attack_kinds import kinds, untouched  # noqa: E402
from attack_targets import Target, Yard, line  # noqa: E402
from attack_worker import Ended, attempt  # noqa: E402

from cosim.support.files import replacing  # noqa: E402
from cosim.support.version import __version__  # noqa: E402

FINE = ("refused", "answered", "long")
DEFECTS = ("traceback", "crash", "hung", "silent", "left", "unclear")
LOUD = 3
"""Lines of a refusal, beyond which it is no sentence any more."""


@dataclass(frozen=True)
class Found:
    """One mutation: its kind, number, what was done, how it ended, what was said, what it took [s of the clock, MB]."""

    kind: str
    number: int
    how: str
    end: str
    said: str
    seconds: float
    megabytes: float = 0.0


def judged(target: Target, ended: Ended, folder: Path, file: Path, good: bytes) -> str:
    """The way it ended."""
    if "Traceback (most recent call last)" in ended.err + ended.out:
        return "traceback"
    if ended.hung:
        return "hung"
    if ended.code < 0:
        return "crash"
    if ended.left or (ended.running and not ended.asked):
        return "left"
    if ended.asked:
        return "long" if ended.code in (0, 130) else "unclear"
    if ended.code == 0:
        return "answered" if target.proof(folder, ended, file, good) else "silent"
    if ended.code == 130 or (ended.code == 1 and ended.out.strip()):
        return "answered"
    return "refused" if ended.code == 2 and is_sentence(ended.err) else "unclear"


def is_sentence(said: str) -> bool:
    """Whether a refusal is one: `cosim: ...` at the end, or what the command line says of a wrong option."""
    lines = said.strip().splitlines()
    usage = any(one.startswith("Usage: ") for one in lines)
    return usage or (bool(lines) and sum(one.startswith("cosim: ") for one in lines) == 1)


def drawn(targets: list[Target], seed: int, count: int) -> list[tuple[int, Target]]:
    """The numbers and kinds of so many attacks, by their shares, in any order: a part of them is a fair sample."""
    whole = sum(one.share for one in targets)
    found = [one for one in targets for _ in range(max(1, round(count * one.share / whole)))]
    return Random(seed).sample(list(enumerate(found)), len(found))


def journalled(journal: Path) -> list[Found]:
    """What a journal has; nothing where there is none."""
    return [Found(**json.loads(one)) for one in journal.read_text("utf-8").splitlines()] if journal.exists() else []


def attacks(
    targets: list[Target],
    seed: int,
    count: int,
    journal: Path,
    seconds: float = math.inf,
    part: tuple[int, int] = (0, 1),
) -> Iterator[Found]:
    """Attack for so long, and write down each; those of a journal that was begun are not played again.

    Of the attacks a part is played, (0, 2) is the first of two halves: several processes may write one journal.
    """
    done = {one.number: one for one in journalled(journal)}
    end = time.monotonic() + seconds
    for place, target in drawn(targets, seed, count)[part[0] :: part[1]]:
        if time.monotonic() > end:
            return
        if place not in done:
            done[place] = attack(target, seed, place)
            with journal.open("a", encoding="utf-8") as file:
                file.write(json.dumps(vars(done[place])) + "\n")
        yield done[place]


def controls(targets: list[Target]) -> Iterator[Found]:
    """Every good file to its command: an attack means nothing where these are not answered."""
    for target in targets:
        for place, seed in enumerate(target.seeds if all(content for _, content in target.seeds) else ()):
            yield attack(replace(target, seeds=[seed], spoil=untouched), 0, place)


def attack(target: Target, seed: int, place: int, keep: bool = False) -> Found:
    dice = Random(f"{seed}.{target.kind}.{place}")
    name, good = dice.choice(target.seeds)
    how, bad = target.spoil(dice, good)
    folder = Path(tempfile.mkdtemp(prefix="attack-"))
    try:
        (folder / name).write_bytes(bad)
        command = target.command(folder, folder / name, dice)
        call: Callable[[], object] = line(command) if isinstance(command, list) else command
        ended = attempt(call, folder)
        end = judged(target, ended, folder, folder / name, good)
        said = (ended.err.strip() or ended.out.strip()).replace(str(folder), "DIR")
        if keep:
            print(f"{folder}\n{ended.out}\n{ended.err}\n{ended.left} {ended.running} {ended.code}")
        note = f" LEFT {ended.left} {ended.running}" if end == "left" else ""
        return Found(target.kind, place, how, end, said[-600:] + note, ended.seconds, ended.megabytes)
    finally:
        if not keep:
            rmtree(folder, ignore_errors=True)


def page(found: list[Found], seed: int, asked: int) -> str:
    """The table for people."""
    names = list(dict.fromkeys(one.kind for one in sorted(found, key=lambda one: one.number)))
    groups = [(name, [one for one in found if one.kind == name]) for name in names] + [("**all**", found)]
    rows = []
    for name, some in groups:
        ends = collections.Counter(one.end for one in some)
        took = max(one.seconds for one in some), max(one.megabytes for one in some)
        counts = [f"{ends[end]:,}" for end in (*FINE, *DEFECTS)]
        rows.append([name, f"{len(some):,}", *counts, f"{took[0]:.2g}", f"{took[1]:.0f}" if took[1] else "-"])
    head = ("attacked", "tried", *FINE, *DEFECTS, "longest [s]", "most memory [MB]")
    defects = sum(one.end in DEFECTS for one in found)
    lines = [
        "# Spoilt files, numbers and requests against the command line, the page and the servers",
        "",
        f"    python bench/attack.py --seed {seed} --count {asked} --out results/robustness",
        "",
        f"mount-cosim {__version__} at {commit()}; {len(found):,} mutations of {asked:,} asked for, {defects} defects. "
        "The top of `bench/attack.py` says what the columns mean; `attack.json` has what was said in each. "
        "Seconds are those of the clock, on a computer with other work. Memory is that of all processes of an attack "
        "for themselves together, looked at ten times a second; - where it was not looked at.",
        "",
        "| " + " | ".join(head) + " |",
        "|---|" + "--:|" * (len(head) - 1),
        *(f"| {' | '.join(row)} |" for row in rows),
        "",
        f"Seconds of a mutation: median {sorted(one.seconds for one in found)[len(found) // 2]:.2g}.",
    ]
    return "\n".join(lines) + "\n"


def commit() -> str:
    """The commit of this tree."""
    told = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True
    )
    return told.stdout.strip() or "?"


def main() -> None:
    """Attack and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=5200)
    parser.add_argument("--only", type=int, help="number of one attack, to play it again and look")
    parser.add_argument("--journal", type=Path, help="file of what is done: a run that ended early goes on from there")
    parser.add_argument("--seconds", type=float, default=math.inf, help="stop after so long; a journal keeps the rest")
    parser.add_argument("--workers", type=int, default=1, help="processes that attack at once")
    parser.add_argument("--so-far", action="store_true", help="only write the table of what the journal has")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    if given.so_far:
        written(journalled(given.journal), given.seed, given.count, given.out)
        return
    folder = tempfile.mkdtemp(prefix="attack-")  # no TemporaryDirectory: each fork would remove it at its end
    try:
        targets = kinds(Yard(Path(folder)))
        if given.only is not None:
            attack(dict(drawn(targets, given.seed, given.count))[given.only], given.seed, given.only, keep=True)
            return
        journal = given.journal or Path(folder) / "journal"
        for one in () if journal.exists() else controls(targets):
            if one.end != "answered":
                raise SystemExit(f"the good file of {one.kind} (number {one.number}) is {one.end}: {one.said}")
        journal.touch()
        workers = [_worker(targets, given, journal, number) for number in range(given.workers)]
        for worker in workers:
            os.waitpid(worker, 0)
        written(journalled(journal), given.seed, given.count, given.out)
    finally:
        rmtree(folder, ignore_errors=True)


def _worker(targets: list[Target], given: argparse.Namespace, journal: Path, number: int) -> int:
    """Play one share of the attacks in a process of its own, and tell the defects; returns its number."""
    process = os.fork()
    if process == 0:
        try:
            for one in attacks(targets, given.seed, given.count, journal, given.seconds, (number, given.workers)):
                if one.end in DEFECTS:
                    print(f"{one.end} {one.kind} {one.number} ({one.how}): ...{one.said[-300:]}", flush=True)
        finally:
            os._exit(0)
    return process


def written(found: list[Found], seed: int, asked: int, out: Path) -> None:
    """Write attack.md and attack.json."""
    out.mkdir(parents=True, exist_ok=True)
    defects = [vars(one) for one in found if one.end in DEFECTS]
    for name, text in (
        ("attack.md", page(found, seed, asked)),
        ("attack.json", json.dumps(defects, indent=1) + "\n"),
    ):
        with replacing(out / name, force=True) as partial:
            partial.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
