"""Do two threads step independent FMUs sooner than one? By the cost of a step, on this machine.

    python bench/parallel_step.py --out results/master [--rounds 200] [--json]

Two controllers of the paper's mount that do not depend on each other, as FMI 3, each with a constant position to work
against. A step of 0.1 ms is one of the FMU's ticks; a longer step is so many of them, so the same binary is a cheap FMU
and an expensive one. Both threads
meet before and after each step, as a master's must, because wires are carried between: they spin there, or sleep. The
three ways take turns in runs of about a millisecond, and of each the shortest counts: what else the computer does makes
a run longer, never shorter. All must end in the same numbers.
"""

import argparse
import ctypes
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parent))

from cosim.fmi.fmu import FmuComponent
from cosim.support.files import replacing
from cosim.support.version import __version__
from pyfmi_models.card import read_card
from pyfmi_models.export import export_fmu
from pyfmi_models.export.build import FLAGS, compile_shared
from pyfmi_models.export.platforms import PLATFORMS, host

STEPS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 3e-1)
"""Communication steps [s]; the FMU's own tick is the first of them."""
RUN = 1e-3
"""Seconds that a run takes by one thread, about; but at least `FEWEST` steps."""
FEWEST = 20
WAYS = ALONE, SPIN, SLEEP = range(3)
POSITIONS = (1e-5, 2e-5)
"""What the two controllers are told [rad]."""


class Side(ctypes.Structure):
    """One FMU as parallel_step.c wants it."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("instance", "set", "get", "step")),
        *((name, ctypes.c_uint32) for name in ("input", "output")),
        *((name, ctypes.c_double) for name in ("value", "found")),
    )


class Row(NamedTuple):
    """A step [s], and what it costs by one thread and by two that spin or sleep [us]: the least, and the median."""

    step: float
    alone: float
    spin: float
    sleep: float
    usual: tuple[float, float, float]


def library() -> ctypes.CDLL:
    source = Path(__file__).with_suffix(".c").read_bytes()
    platform = PLATFORMS[host()]
    flags = (*FLAGS, "-lpthread")
    found = compile_shared({"parallel.c": source}, f"parallel{platform.suffix}", platform.target, flags)
    library = ctypes.CDLL(str(found))
    numbers = [*[ctypes.c_int64] * 3, ctypes.c_double, ctypes.c_int64]
    library.parallel.argtypes = [ctypes.POINTER(Side), *numbers, ctypes.POINTER(ctypes.c_int64)]
    return library


@contextmanager
def sides(path: Path) -> Iterator[ctypes.Array[Side]]:
    """Two fresh instances of a controller."""
    with ExitStack() as stack:
        made = []
        for position in POSITIONS:
            component = stack.enter_context(FmuComponent(path))
            component.start({})
            functions, ports = component.functions, component.ports
            references = ports["q"].reference, ports["tau"].reference
            made.append(Side(functions.instance, functions.set, functions.get, functions.step, *references, position))
        yield (Side * len(made))(*made)


def measured(path: Path, step: float, rounds: int) -> Row:
    """The shortest of each way's runs, a step."""
    run, nanoseconds = library().parallel, ctypes.c_int64()
    with ExitStack() as stack:
        both = [stack.enter_context(sides(path)) for _ in WAYS]

        def seconds(how: int, first: int, count: int) -> float:
            if run(both[how], len(POSITIONS), first, count, step, how, nanoseconds) > 1:
                raise SystemExit(f"a step of {step} s failed")
            return nanoseconds.value * 1e-9

        for how in WAYS:
            seconds(how, 0, FEWEST)
        count = max(FEWEST, round(RUN / (seconds(ALONE, FEWEST, FEWEST) / FEWEST)))
        for how in (SPIN, SLEEP):
            seconds(how, FEWEST, FEWEST)
        first = 2 * FEWEST
        took = [[seconds(how, first + k * count, count) / count for how in WAYS] for k in range(rounds)]
        ends = [[one.found for one in each] for each in both]
    if ends != [ends[0]] * len(ends):
        raise SystemExit(f"at a step of {step} s two threads end elsewhere: {ends}")
    alone, spin, sleep = ([1e6 * one for one in each] for each in zip(*took, strict=True))
    return Row(step, min(alone), min(spin), min(sleep), (median(alone), median(spin), median(sleep)))


def page(rows: list[Row], rounds: int, loads: tuple[float, float]) -> str:
    """The table for people."""
    table = [
        f"| {1e3 * row.step:g} | {row.alone / len(POSITIONS):.2f} | {row.alone:.2f} | {row.spin:.2f} "
        f"({row.spin / row.alone:.2f}) | {row.sleep:.2f} ({row.sleep / row.alone:.2f}) "
        f"| {row.usual[1] / row.usual[0]:.2g}, {row.usual[2] / row.usual[0]:.2g} |"
        for row in rows
    ]
    lines = [
        "# Two threads for two independent FMUs",
        "",
        f"    python bench/parallel_step.py --rounds {rounds} --out results/master",
        "",
        f"mount-cosim {__version__}, {os.cpu_count()} cores, load {loads[0]:.1f} before and {loads[1]:.1f} after.",
        "What is measured stands at the top of `bench/parallel_step.py`.",
        "In brackets: relative to one thread; below 1 two threads are sooner. Last column: the same of the "
        "medians, that",
        "is beside whatever else this computer did: two threads need two free cores at the same time.",
        "",
        "| step [ms] | one FMU [us] | both, one thread [us] | two threads that spin [us] | two that sleep [us] "
        "| medians: spin, sleep |",
        "|--:|--:|--:|--:|--:|--:|",
        *table,
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--json", action="store_true", help="print the numbers")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "controller.fmu"
        export_fmu(read_card("paper_mount").controller_model(), path, fmi=3)
        rows = [measured(path, step, given.rounds) for step in STEPS]
    text = page(rows, given.rounds, (before, os.getloadavg()[0]))
    print(json.dumps([row._asdict() for row in rows], indent=1) if given.json else text)
    given.out.mkdir(parents=True, exist_ok=True)
    with replacing(given.out / "parallel.md", force=True) as partial:
        partial.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
