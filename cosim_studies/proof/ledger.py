"""The list of all benchmarks that were ever run with known truth, one line each: what was tuned on is not scored.

A benchmark is fresh if its generator and seed stand in no earlier line of another code.
"""

import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

from cosim.support.errors import ProofError
from cosim.support.files import replacing

PURPOSES = ("tuning", "scoring")
HEAD = """# Every deck that was played with known truth

A deck for *tuning* may have shaped the code; one for *scoring* was drawn after the code was frozen and is not looked at
before. `cosim prove --decks` and `bench/abroad.py --decks` append to this list by themselves; *fresh* says
that the generator's seed stands in no earlier line of another code.

"""


@dataclass(frozen=True)
class Played:
    """A line: generator, seed, cases, purpose, the code that played it, its commit, whether it was fresh."""

    generator: str
    seed: int
    cases: int
    purpose: str
    code: str
    commit: str
    fresh: str = "yes"


def listed(path: Path) -> list[Played]:
    """The lines of a list; none where there is no file yet."""
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")][2:]
    return [Played(row[0], int(row[1]), int(row[2]), *row[3:]) for row in rows]


def enlist(path: Path, generator: str, seed: int, cases: int, purpose: str, code: str) -> None:
    """Append a benchmark, or lengthen its line where the same code has played its beginning.

    Raises:
        ProofError: no such purpose.
    """
    if purpose not in PURPOSES:
        text = f"--purpose {purpose}: it must be one of {', '.join(PURPOSES)}."
        raise ProofError(text, culprit="--purpose", value=purpose, choices=PURPOSES)
    before = listed(path)
    alike = [one for one in before if (one.generator, one.seed, one.code) == (generator, seed, code[:16])]
    others = [one for one in before if one not in alike]
    seen = any((one.generator, one.seed) == (generator, seed) for one in others)
    most = max([cases, *(one.cases for one in alike)])
    line = Played(generator, seed, most, purpose, code[:16], commit(), "no" if seen else "yes")
    with replacing(path, force=True) as partial:
        partial.write_text(HEAD + "\n".join(_table([*others, line])) + "\n", "utf-8")


def _table(lines: list[Played]) -> Iterator[str]:
    names = [one.name for one in fields(Played)]
    yield "| " + " | ".join(names) + " |"
    yield "|" + "---|" * len(names)
    for line in lines:
        yield "| " + " | ".join(str(getattr(line, name)) for name in names) + " |"


def commit(root: Path | None = None) -> str:
    """The commit of the work tree that holds this file, with a plus where something was changed; "-" outside of one."""
    here = root or Path(__file__).parent

    def git(*arguments: str) -> str:
        done = subprocess.run(["git", *arguments], cwd=here, capture_output=True, text=True, check=False)
        return done.stdout.strip()

    try:
        found = git("rev-parse", "--short", "HEAD")
        return f"{found}{'+' * bool(git('status', '--porcelain', '--untracked-files=no'))}" if found else "-"
    except OSError:
        return "-"
