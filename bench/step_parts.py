"""Where the time of a step goes: the parts of a run beside a plain C loop, in processor time.

python bench/step_parts.py --out results/master

The two FMUs of master_step.py at 0.1 ms. Each number is the least of some rounds: processor time of the thread
that steps, in ns a step, which does not grow with what else the computer does; the last rows are of all threads.
"""

import argparse
import os
import platform
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time, thread_time
from typing import Any
from unittest.mock import patch

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

import master_runners  # noqa: E402
from master_step import pair  # noqa: E402

import cosim  # noqa: E402
from cosim.master.execution import Execution  # noqa: E402
from cosim.master.given import Given  # noqa: E402
from cosim.master.loop import CompiledLoop  # noqa: E402

COMMAND = "python bench/step_parts.py --out results/master"
VERSIONS = (2, 3)
C = "plain C loop"
LOOP, CHUNKS, ALL = "the loop in C, with six columns", "all chunks", "one run in all threads, start-up left out"
PARTS = {LOOP: (CompiledLoop, "run"), "rows handed to the writer": (Execution, "_write"), "signals": (Given, "at")}
PARTS |= {CHUNKS: (Execution, "_run_chunks")}
Found = dict[str, float]


def watched(call: Callable[..., Any], name: str, into: Found) -> Callable[..., Any]:
    """A method that notes how long it took."""

    def called(*arguments: Any) -> Any:
        begun = thread_time()
        try:
            return call(*arguments)
        finally:
            into[name] = into.get(name, 0.0) + thread_time() - begun

    return called


def ours(folder: Path, fmi: int, steps: int) -> Found:
    """Seconds of each part of a run of cosim; with them those of the same run with one step."""
    found: Found = {}
    patches = [
        patch.object(home, name, watched(getattr(home, name), title, found)) for title, (home, name) in PARTS.items()
    ]
    with patches[0], patches[1], patches[2], patches[3], patch.object(master_runners, "perf_counter", process_time):
        found[ALL] = master_runners.cosim(folder, fmi, steps)
    found["the look at the process between chunks, and the rest"] = 2 * found[CHUNKS] - sum(found[one] for one in PARTS)
    return found


def measure(fmi: int, rounds: int, steps: int) -> Found:
    """The least of each part, ns a step."""
    with tempfile.TemporaryDirectory() as folder, patch.object(master_runners, "perf_counter", thread_time):
        fmus = pair(Path(folder), fmi)
        runs = [{C: master_runners.c(fmus, fmi, steps)} | ours(fmus, fmi, steps) for _ in range(rounds)]
    return {name: 1e9 * min(run[name] for run in runs) / steps for name in runs[0]}


def page(found: dict[int, Found], rounds: int, steps: int) -> str:
    """The table: FMI 2 and 3 beside each other."""
    first, *_ = found.values()
    cells = {name: [f"{one[name]:.0f} | {one[name] / one[C]:.2f}" for one in found.values()] for name in first}
    heads = [f"FMI {fmi}: ns a step | of the C loop" for fmi in found]
    where = f"Python {platform.python_version()}, {os.cpu_count()} cores, {platform.machine()}, shared"
    return "\n".join(
        [
            f"# Where the time of a step goes\n\n    {COMMAND}\n",
            f"mount-cosim {cosim.__version__}, {where}: load {os.getloadavg()[0]:.1f}. {steps:,} steps.",
            f"Processor time, the least of {rounds} rounds.\n",
            f"| part | {' | '.join(heads)} |\n|{' --- |' * (1 + 2 * len(found))}",
            *(f"| {name} | {' | '.join(row)} |" for name, row in cells.items()),
            "\nBehind each chunk the process is looked at; [causes](step_causes.md): what was tried.\n",
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--steps", type=int, default=600_000)
    given = parser.parse_args()
    found = {fmi: measure(fmi, given.rounds, given.steps) for fmi in VERSIONS}
    text = page(found, given.rounds, given.steps)
    if given.out:
        (given.out / "step_parts.md").write_text(text, "utf-8")
    print(text)


if __name__ == "__main__":
    main()
