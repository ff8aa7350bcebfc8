"""The firmware of each controller on an emulated Cortex-A9: bits, instructions, stack, memory.

python bench/firmware.py --out results/hardware     (--json prints the numbers)

Needs qemu-arm. The samples are a noisy sine of 0.13 rad/s. 100 000 outputs are compared: of the FMU, of the firmware
on this machine, of the firmware for the Cortex-A9. Instructions are counted one by one under qemu-arm over 1000 cycles
of a faster sine of the same speed, which reverses 40 times.
"""

import argparse
import hashlib
import json
import re
import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np

import cosim
from pyfmi_models.card import Card, parse_card

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/tools"))

import firmware_tools as tools

COMMAND = "python bench/firmware.py --out results/hardware"
CASES = ("C1", "C2a", "C2b", "C3a", "C3b", "C2a+C3a")
MORE = {
    "C2a, on-line identification": ("C2a", "[controller.adaptation]\n"),
    "C1, learning": ("C1", "[controller.learning]\nperiod = 1.0\n"),
}
OUTPUTS, STEPS, COUNTED, SEED = 5, 20_000, 1000, 1
CLOCK, PERIOD = 1e9, 1e-4


def card_of(case: str, section: str) -> Card:
    text = (files("pyfmi_models") / "cards" / "paper_mount.toml").read_text("utf-8")
    return parse_card(re.sub(r'compensation = ".*"', f'compensation = "{case}"', text) + section, "paper_mount")


def digest(answers: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(answers).tobytes()).hexdigest()


def measure(name: str, card: Card) -> dict[str, Any]:
    rows = tools.samples(card, STEPS + 2, seed=SEED)
    hashes = {"fmu": digest(tools.fmu_answers(card, rows))}
    for target in ("host", "cortex-a9"):
        project = tools.project_of(card, target)
        program = tools.program_of(project, target)
        hashes[target] = digest(tools.answers(program, target, rows, OUTPUTS)[2:, 2:])
    fast = tools.samples(card, COUNTED + 2, frequency=200.0, seed=SEED)
    cycles, steps, deepest = tools.effort(project, program, fast)
    size = project.size
    return {
        "case": name,
        "numbers": OUTPUTS * STEPS,
        "hashes": hashes,
        "equal": len(set(hashes.values())) == 1,
        "step": [round(mean(steps)), max(steps)],
        "cycle": [round(mean(cycles)), max(cycles)],
        "stack": size.stack,
        "stack_seen": deepest,
        "code": size.code,
        "constants": size.constants,
        "variables": size.variables,
        "library": [one for one in size.outside if not one.startswith("hal_")],
    }


def page(found: dict[str, Any]) -> str:
    lines = [
        "# The firmware of each controller on a Cortex-A9",
        "",
        f"    {found['command']}",
        "",
        f"{found['version']}, seed {SEED}, {found['emulator']} with `-cpu cortex-a9`. Card paper_mount with the",
        f"`compensation` of each case. Equal: SHA-256 of {OUTPUTS * STEPS:,} outputs ({STEPS:,} cycles) of the FMU on",
        "this machine, the firmware on this machine and the firmware for the Cortex-A9. Instructions of the",
        "controller's step, and of the loop's whole cycle with it: mean (largest) of",
        f"{COUNTED} cycles, counted one by one, library functions included, HAL not. Stack and memory are worked out",
        "from the compiled code, in bytes; in brackets the deepest stack that the emulated cycles used.",
        "",
        "| case | equal | step | cycle | share of 100 µs at 1 GHz | stack | code | constants | variables |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in found["rows"]:
        step, cycle = (f"{mean:,} ({most:,})" for mean, most in (row["step"], row["cycle"]))
        share = f"{100 * row['cycle'][1] / (CLOCK * PERIOD):.1f} %"
        stack = f"{row['stack']} ({row['stack_seen']})"
        cells = row["case"], "yes" if row["equal"] else "NO", step, cycle, share, stack
        numbers = (f"{row[name]:,}" for name in ("code", "constants", "variables"))
        lines.append(f"| {' | '.join((*cells, *numbers))} |")
    lines += [
        "",
        "The share takes one instruction a clock for the largest cycle; a Cortex-A9 needs more for divisions, square",
        "roots and what its caches do not hold: an estimate, not a measurement. Nothing here has run on a board.",
    ]
    return "\n".join(lines) + "\n"


def emulator_version() -> str:
    """The emulator and its version, in the words of its own first line."""
    said = subprocess.run([tools.EMULATOR, "--version"], capture_output=True, text=True, check=True).stdout
    return " ".join(said.split()[:3])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if tools.missing_emulator():
        raise SystemExit(tools.missing_emulator())
    cases = {name: (name, "") for name in CASES} | MORE
    found = {
        "rows": [measure(name, card_of(*case)) for name, case in cases.items()],
        "command": COMMAND,
        "version": f"mount-cosim {cosim.__version__}",
        "emulator": emulator_version(),
    }
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "firmware.json").write_text(json.dumps(found, indent=2) + "\n", "utf-8")
        (options.out / "firmware.md").write_text(page(found), "utf-8")
    print(json.dumps(found, indent=2) if options.json else page(found))


if __name__ == "__main__":
    main()
