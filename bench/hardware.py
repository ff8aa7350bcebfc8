"""The controller on a virtual drive: time, faults, and what is left when a process is killed.

python bench/hardware.py --out results/hardware     (--only and the lengths make it shorter)

The scenario `sidereal` at 10 kHz against `cosim hardware virtual-drive` over UDP on this machine.

- timing: a session in real time with a supervisor that drains and plots, replayed; then rounds of a bare clock, a
  session without UDP, one with a quiet supervisor and one that drains and plots, one after the other, so that all meet
  the same other work.
- faults: each fault at seeded times, in lockstep: cycles to detection, state, torque.
- clean: a run without faults, in lockstep, faster than real time: nothing may trip.
- kills: `kill -9` of loop, Python and drive, in real time: is the torque gone, and is the black box whole?
"""

import argparse
import json
import os
import platform
import sys
import tempfile
from pathlib import Path
from typing import Any

from hardware_faults import SEED, clean, faults
from hardware_kills import kills
from hardware_page import page
from hardware_timing import timing

import cosim


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", nargs="*", default=["timing", "faults", "clean", "kills"])
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="of the session in real time, and of the rounds in all"
    )
    parser.add_argument("--minutes", type=float, default=10.0, help="of the clean run")
    parser.add_argument("--trials", type=int, default=100, help="kills of each process")
    parser.add_argument("--times", type=int, default=10, help="seeded times of each fault")
    options = parser.parse_args()
    measures = {
        "timing": lambda: timing(options.seconds),
        "faults": lambda: faults(options.times),
        "clean": lambda: clean(options.minutes),
        "kills": lambda: kills(options.trials),
    }
    found: dict[str, Any] = {"version": f"mount-cosim {cosim.__version__}", "seed": SEED, "machine": machine()}
    with tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = folder  # processes that are killed leave theirs behind
        for name in options.only:
            found[name] = measures[name]()
            print(f"{name}: {json.dumps(found[name])}", file=sys.stderr, flush=True)
    tempfile.tempdir = None
    found["load_at_the_end"] = os.getloadavg()
    print(page(found))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "hardware.json").write_text(json.dumps(found, indent=2) + "\n", "utf-8")
        (options.out / "README.md").write_text(page(found), "utf-8")


def machine() -> str:
    """Say what this ran on."""
    return (
        f"Python {platform.python_version()}, Linux {platform.release()}, {os.cpu_count()} cores, {platform.machine()}"
    )


if __name__ == "__main__":
    main()
