"""The engine of the diagnosis in numbers: sizes, named constants, processor time, memory, each beside what was asked.

python -m bench.engine --before OLD --out results/master      (10 to 30 minutes, 1 GB of disk)

OLD is a checkout of the commit that is compared with (2ad1e55), its libraries built by `python
cosim/master/loop/build_hook.py`; without it nothing is compared. Processor time is user and system time of a process
from its start to its end, linear algebra in one thread, byte code kept as in an installation. `--skip 10k` leaves out
cases whose name holds the word.
"""

import argparse
import ast
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np

import cosim
from bench.diagnosis_cost import Case, write
from bench.net.cases import NetCase, home, machines, special

COMMAND = "python -m bench.engine --before OLD --out results/master"
ROOT = Path(__file__).parents[1]
SHARED = ROOT.parent / "shared"
SEED = 5001
COMPARED = ("demo", "home_one_9_delay", "emps", "home_several_0_cable_wrap_compliance", "home_none_3_none")
"""Cases of the net that are diagnosed by both: the demo, a delay, EMPS, a table with a compliance, a null."""
LENGTHS = (60.0, 120.0, 240.0)
"""Seconds of each of three recordings at 1 kHz, over which processor time shall grow with the rows."""
WALKED = {"types": "<= 40", "files": "<= 90", "returns": "<= 150"}
"""What a recording meets on its way through a diagnosis, as `bench/walk.py` counts, and what was asked."""
FIRST_FIT = """
import runpy, sys, time
from cosim.estimation.problem import Problem
def fit(*given, **named):
    print("first fit", time.process_time(), file=sys.stderr)
    raise SystemExit
Problem.fit = fit
sys.argv = ["cosim", *sys.argv[1:]]
runpy.run_module("cosim", run_name="__main__")
"""


class Row(NamedTuple):
    """One number: what it is, what was asked, what was measured."""

    what: str
    asked: str
    measured: str


class Used(NamedTuple):
    """What a process used: processor time [s], peak of its memory [MB], what it said on its error output."""

    seconds: float
    memory: float
    words: str


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--skip", nargs="*", default=[])
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    rows = []
    for row in chain(sizes(), walked(), costs(given.skip), lengths(given.skip), compared(given.before, given.skip)):
        rows.append(row)
        print(*row, sep=" | ", flush=True)
    if given.out:
        given.out.mkdir(parents=True, exist_ok=True)
        (given.out / "engine.md").write_text(page(rows), "utf-8")


def sizes() -> Iterator[Row]:
    """Lines, files, constants."""
    rooms = [*_sources("cosim/diagnosis"), *_sources("cosim/report"), *_sources("cosim/delivery")]
    yield Row("lines of diagnosis, report and delivery", "<= 11,000", f"{sum(map(_lines, rooms)):,}")
    yield Row("files there", "<= 80", str(len(rooms)))
    estimation = _sources("cosim/estimation")
    yield Row("lines of estimation", "<= 2,700", f"{sum(map(_lines, estimation)):,}")
    kernels = [*(ROOT / "cosim/estimation/kernels").glob("*.[ch]")]
    yield Row("lines of C of its kernels", "<= 1,500", f"{sum(map(_lines, kernels)):,}")
    named = sum(len(list(constants(path))) for path in (*estimation, *_sources("cosim/diagnosis")))
    yield Row("named constants in estimation and diagnosis", "<= 250", str(named))


def _sources(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def _lines(path: Path) -> int:
    return len(path.read_text("utf-8").splitlines())


def constants(path: Path) -> Iterator[str]:
    """Names in capitals that a file gives a number, or a table of numbers that is written out."""
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.Assign):
            pair = node.targets[0], node.value
            several = all(isinstance(one, ast.Tuple) for one in pair)
            for name, value in zip(*(getattr(one, "elts", []) if several else [one] for one in pair), strict=True):
                if isinstance(name, ast.Name) and name.id.strip("_").isupper() and _is_number(value):
                    yield name.id


def _is_number(node: ast.expr) -> bool:
    leaves = [one for one in ast.walk(node) if isinstance(one, ast.Constant | ast.Name | ast.Call)]
    return bool(leaves) and all(isinstance(one, ast.Constant) and isinstance(one.value, int | float) for one in leaves)


def walked() -> Iterator[Row]:
    """What a recording with two effects meets on its way through `diagnose --quick`."""
    case = next(one for one in home() if one.name == "home_several_0_cable_wrap_compliance")
    with tempfile.TemporaryDirectory() as work:
        case.write(Path(work))
        words = ["bench/walk.py", "diagnose", *case.arguments(Path(work)), "--out", f"{work}/out"]
        counted = used(ROOT, words).words.replace(",", "").split()
    for what, asked in WALKED.items():
        yield Row(f"a recording on its way, --quick: {what}", asked, counted[counted.index(what) + 1])


def lengths(skip: list[str]) -> Iterator[Row]:
    """Processor time over the length of the recordings."""
    if any(word in "lengths" for word in skip):
        return
    spent = []
    for seconds in LENGTHS:
        with tempfile.TemporaryDirectory() as work:
            with ProcessPoolExecutor(1, get_context("spawn")) as apart:
                apart.submit(write, Case(seconds, 1000, 1.0, True), SEED, Path(work)).result()
            words = NetCase("lengths", "cost", lambda _: None).arguments(Path(work))
            spent.append(used(ROOT, ["-m", "cosim", "diagnose", *words, "--out", f"{work}/out"]).seconds)
    power = float(np.polyfit(np.log(LENGTHS), np.log(spent), 1)[0])
    said = ", ".join(f"{one:.1f}" for one in spent)
    spans = ", ".join(f"{one:g}" for one in LENGTHS)
    yield Row(
        f"3 x {spans} s at 1 kHz, --quick: seconds, and their power of the length", "<= 1", f"{said}: {power:.2f}"
    )


def costs(skip: list[str]) -> Iterator[Row]:
    """Processor time and memory of fixed cases."""
    yield Row("import of cosim [s]", "unchanged", f"{used(ROOT, ['-c', 'import cosim']).seconds:.2f}")
    asked = {
        "60 s at 1 kHz": (Case(60, 1000, 1.0, True), "<= 8 s"),
        "300 s at 10 kHz": (Case(300, 10_000, 1.0, True), "<= 60 s, <= 1 GB"),
    }
    for name, (case, bar) in asked.items():
        if any(word in name for word in skip):
            continue
        with tempfile.TemporaryDirectory() as work:
            with ProcessPoolExecutor(1, get_context("spawn")) as apart:  # a child's peak begins at its parent's
                apart.submit(write, case, SEED, Path(work)).result()
            net = NetCase(name, "cost", lambda _: None)
            words = ["diagnose", *net.arguments(Path(work)), "--out", str(Path(work) / "out")]
            first = used(ROOT, ["-c", FIRST_FIT, *words]).words.split("first fit")[1].split()[0]
            yield Row(f"3 x {name}: to the first fit [s]", "<= 1.5", f"{float(first):.2f}")
            whole = used(ROOT, ["-m", "cosim", *words])
            yield Row(f"3 x {name}, --quick", bar, f"{whole.seconds:.1f} s, {whole.memory:.0f} MB")


def compared(before: Path | None, skip: list[str]) -> Iterator[Row]:
    """Processor time beside that of another checkout, on the same cases, one after the other."""
    known = {one.name: one for one in (*home(), *special(), *machines(SHARED / "recordings"))}
    ratios = []
    for name in (one for one in COMPARED if before and one in known and not any(word in one for word in skip)):
        with tempfile.TemporaryDirectory() as work:
            known[name].write(Path(work))
            words = ["-m", "cosim", "diagnose", *known[name].arguments(Path(work))]
            old, now = (used(root, [*words, "--out", f"{work}/{k}"]).seconds for k, root in enumerate((before, ROOT)))
        ratios.append(now / old)
        yield Row(f"{name}: processor time, now / before", "<= 1/3", f"{now:.1f} / {old:.1f} s = {now / old:.2f}")
    if ratios:
        yield Row("their geometric mean", "<= 1/5", f"{float(np.exp(np.mean(np.log(ratios)))):.2f}")


def used(root: Path, words: list[str]) -> Used:
    """What Python uses for some words with the packages of a checkout."""
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS")}
    environment = os.environ | threads | {"PYTHONPATH": str(root.resolve())}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryFile("w+") as errors:
        command, quiet = [sys.executable, *words], subprocess.DEVNULL
        process = subprocess.Popen(
            command, stdout=quiet, stderr=errors, env=environment, cwd=root
        )  # `-m` looks there first
        _, _, spent = os.wait4(process.pid, 0)
        errors.seek(0)
        return Used(spent.ru_utime + spent.ru_stime, spent.ru_maxrss / 1e3, errors.read())


def page(rows: list[Row]) -> str:
    """The page of results/."""
    head = (
        f"# The engine of the diagnosis in numbers\n\n    {COMMAND}\n\n"
        f"mount-cosim {cosim.__version__}, Python {platform.python_version()}, {os.cpu_count()} cores, "
        f"{platform.machine()}, shared: load {os.getloadavg()[1]:.1f} at the end (processor time grows with it).\n\n"
        "| what | asked | measured |\n| --- | --- | --- |\n"
    )
    return head + "".join(f"| {' | '.join(row)} |\n" for row in rows)


if __name__ == "__main__":
    main()
