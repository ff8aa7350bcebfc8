"""What a diagnosis costs: `cosim diagnose` as a process, over longer and faster recordings.

python bench/diagnosis_cost.py --out results/master      (10 to 20 minutes, 1 GB of disk)

Each case is two training recordings and one held out, each of the named length, with a cogging and a delay concealed.
`noise 0.01` is the worst case: with hardly any encoder noise the analysis takes its widest band.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import cosim
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.simulated_axis import RECORDINGS

COMMAND = "python bench/diagnosis_cost.py --out results/master"
EFFECTS = ("cogging", "delay")


class Case(NamedTuple):
    """One recording's length [s], rows a second, share of the usual noise, and whether `--quick` is given."""

    seconds: float
    rate_hz: int
    noise: float
    quick: bool = False


CASES = (
    *(Case(seconds, 1000, 1.0) for seconds in (30, 60, 120, 240)),
    Case(60, 1000, 1.0, quick=True),
    *(Case(seconds, 10_000, 1.0) for seconds in (60, 300)),
    *(Case(seconds, 10_000, 0.01) for seconds in (60, 300)),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=5001)
    parser.add_argument("--most", type=float, default=300.0, help="longest recording [s]")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows = []
    for case in (one for one in CASES if one.seconds <= options.most):
        rows.append(measured(case, options.seed))
        print(row(rows[-1]), flush=True)
    text = page(rows, options.seed)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "diagnosis_cost.md").write_text(text, "utf-8")


def measured(case: Case, seed: int) -> dict[str, Any]:
    """Make a case, diagnose it in a process of its own, and return what that took."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with ProcessPoolExecutor(1, get_context("spawn")) as apart:  # a child's peak of memory begins at its parent's
            apart.submit(write, case, seed, folder).result()
        train, held = [str(folder / f"{one}.parquet") for one in RECORDINGS[:2]], str(folder / "heldout.parquet")
        command = [sys.executable, "-m", "cosim", "diagnose", *train, "--heldout", held, "--json"]
        command += ["--card", str(folder / "card.toml"), "--out", str(folder / "out")]
        command += ["--quick"] * case.quick
        begun = time.perf_counter()
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
            assert process.stdout is not None
            said = process.stdout.read()
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        assert process.returncode == 0
        verdict = json.loads(said)["verdict"]
        wall, cpu = time.perf_counter() - begun, used.ru_utime + used.ru_stime
    return {**case._asdict(), "wall": wall, "cpu": cpu, "memory": used.ru_maxrss / 1e3, "verdict": verdict}


def write(case: Case, seed: int, folder: Path) -> None:
    """Make a case and write its recordings and its card into a folder."""
    write_case(make_case(seed, EFFECTS, noise=case.noise, rate_hz=case.rate_hz, duration=case.seconds), folder)


def row(one: dict[str, Any]) -> str:
    """One line of the table."""
    samples = 3 * one["seconds"] * one["rate_hz"] / 1e6
    length = f"{one['seconds']:g}{' --quick' * one['quick']}"
    return (
        f"| {length} | {one['rate_hz']} | {one['noise']:g} | {samples:.3g} | {one['wall']:.0f} | "
        f"{one['cpu']:.0f} | {one['memory']:.0f} | {' + '.join(one['verdict']) or 'none'} |"
    )


def growth(rows: list[dict[str, Any]]) -> str:
    """How processor time grows with the length: the exponent over all lengths at the slow rate; one is linear."""
    alike = [one for one in rows if (one["rate_hz"], one["noise"], one["quick"]) == (1000, 1.0, False)]
    if len(alike) < 2:
        return ""
    lengths, seconds = (np.log([one[name] for one in alike]) for name in ("seconds", "cpu"))
    exponent = np.polyfit(lengths, seconds, 1)[0]
    spans = f"{alike[0]['seconds']:g} to {alike[-1]['seconds']:g} s at 1 kHz"
    return f"\nOver {spans} processor time grows with the length to the power of {exponent:.2f} (1: linear).\n"


def page(rows: list[dict[str, Any]], seed: int) -> str:
    """The page of results/."""
    head = (
        f"# What a diagnosis costs\n\n    {COMMAND}\n\n"
        f"mount-cosim {cosim.__version__}, Python {platform.python_version()}, {os.cpu_count()} cores, "
        f"{platform.machine()}, load {os.getloadavg()[1]:.1f} at the end; seed {seed}. `cosim diagnose` as a process, "
        "from reading the files to the report; two training recordings and one held out, each of this length; a "
        "cogging and a delay are concealed. With hardly any noise the analysis has its widest band, the dearest.\n\n"
        "| seconds | Hz | noise | million samples | wall [s] | processor [s] | memory [MB] | verdict |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
    )
    return head + "\n".join(map(row, rows)) + "\n" + growth(rows)


if __name__ == "__main__":
    main()
