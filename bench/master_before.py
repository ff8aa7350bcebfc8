"""What a step of the master costs now, beside an earlier commit: is it as fast as it was?

    git worktree add --detach OLD COMMIT && python OLD/cosim/loop/build_hook.py
    python bench/master_before.py --before OLD --pairs 11 --out results/master

Both checkouts step the same two FMUs of the paper's mount by their own `master_runners.py`, in processes of their
own, one right after the other, and which comes first takes turns. Processor time is counted, all threads together;
start-up is not. Python's garbage collection is off in both: that of start-up would fall into either run as chance has
it. The plain C loop, which is the same in both, shows what the measurement itself leaves open.
"""

import argparse
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parent))

from master_step import pair

from cosim.support.files import replacing
from cosim.support.version import __version__

HOME = Path(__file__).parents[1]
RUNNERS = {"cosim": "cosim, 6 signals to Parquet", "c": "plain C loop"}
TIMED = """
import gc, sys
from pathlib import Path
from time import process_time
sys.path[:0] = ["bench", "tests/benchmarks"]  # the latter in a checkout from before 0.2.0
import master_runners
master_runners.perf_counter = process_time
gc.disable()
print(master_runners.RUNNERS[sys.argv[1]](Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])))
"""


def cost(checkout: Path, runner: str, folder: Path, fmi: int, steps: int) -> float:
    """Microseconds of processor that a step takes in a checkout."""
    command = [sys.executable, "-c", TIMED, runner, str(folder), str(fmi), str(steps)]
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout.split()[-1]) * 1e6 / steps


def compared(before: Path, runner: str, folder: Path, fmi: int, steps: int, pairs: int) -> list[tuple[float, float]]:
    """Cost before and now, as often as asked."""
    found = []
    for number in range(pairs):
        both = [before, HOME] if number % 2 else [HOME, before]
        costs = {one: cost(one, runner, folder, fmi, steps) for one in both}
        found.append((costs[before], costs[HOME]))
    return found


def row(runner: str, fmi: int, found: Sequence[tuple[float, float]]) -> str:
    """A line of the table."""
    old, new = (median(one[place] for one in found) for place in (0, 1))
    ratios = sorted(now / then for then, now in found)
    spread = f"{ratios[0]:.2f} to {ratios[-1]:.2f}"
    return f"| {RUNNERS[runner]} | {fmi} | {old:.3f} | {new:.3f} | {median(ratios):.2f} ({spread}) |"


def commit(checkout: Path) -> str:
    """The commit of a checkout, short."""
    command = ["git", "-C", str(checkout), "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def page(rows: Sequence[str], given: argparse.Namespace) -> str:
    """The table for people."""
    old, machine = commit(given.before), f"{os.cpu_count()} cores, {platform.machine()}, shared"
    command = f"master_before.py --before OLD --pairs {given.pairs} --steps {given.steps} --out results/master"
    return "\n".join(
        [
            "# A step of the master, before and now",
            "",
            f"    python bench/{command}",
            "",
            f"mount-cosim {__version__} at {commit(HOME)}, isolation off; before: {old}. Python "
            f"{platform.python_version()}, {machine}.",
            "How it is measured stands at the top of `bench/master_before.py`. Ratio: median of pairs "
            "(least to greatest).",
            "",
            "| who | FMI | before: us of processor a step | now | ratio |",
            "|---|--:|--:|--:|--:|",
            *rows,
        ]
    )


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, required=True, help="a checkout of the earlier commit")
    parser.add_argument("--pairs", type=int, default=11)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.before = given.before.absolute()
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for fmi in (2, 3):
            here = pair(Path(folder), fmi)
            for runner in RUNNERS:
                rows.append(row(runner, fmi, compared(given.before, runner, here, fmi, given.steps, given.pairs)))
                print(rows[-1], flush=True)
    given.out.mkdir(parents=True, exist_ok=True)
    with replacing(given.out / "before.md", force=True) as partial:
        partial.write_text(page(rows, given) + "\n", "utf-8")


if __name__ == "__main__":
    main()
