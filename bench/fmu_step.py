"""What a 0.1 ms co-simulation step of the paper's plant costs, beside a step of RODAS4 written by hand in C.

python bench/fmu_step.py --out results/master     (--json prints the numbers)

The opponent is rodas4_lugre.c: fixed size, structure known, numbers of the parameters worked out beforehand, the same
exp and pow, the same compiler and flags. A block of steps by hand and one through the FMU follow each other; a ratio is
that of such a pair, and the median of the pairs counts.
"""

import argparse
import ctypes
import json
import os
import platform
import sys
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

import cosim
from pyfmi_models.card import read_card
from pyfmi_models.export.build import FLAGS, compile_shared, library_of
from pyfmi_models.export.codegen import SHIM, TOLERANCE, generate
from pyfmi_models.export.platforms import PLATFORMS, host

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests/tools"))

from export_models import Driver  # noqa: E402

COMMAND = "python bench/fmu_step.py --out results/master"
STEP, BLOCK = 1e-4, 2000
# Torque [N m] over time [s]: at rest within the bristles, to and fro through break-away, sliding at some deg/s.
MOTIONS = {
    "at rest": lambda t: 1.0 + 0 * t,
    "reversals": lambda t: 3.4 * np.sin(2 * np.pi * 0.5 * t),
    "slew": lambda t: 5.0 + 0 * t,
}
CALLS = {"step": ("DoStep",), "set, step, get q": ("SetFloat64", "GetFloat64", "DoStep")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--rounds", type=int, default=100)
    options = parser.parse_args()
    found = measure(options.rounds)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "fmu_step.json").write_text(json.dumps(found, indent=2) + "\n", "utf-8")
        (options.out / "fmu_step.md").write_text(page(found), "utf-8")
    print(json.dumps(found, indent=2) if options.json else page(found))


def measure(rounds: int) -> dict[str, Any]:
    """Return the worst median ratio and, by motion and calls, its quartiles, nanoseconds and how far the two differ."""
    rows = [versus(motion, calls, rounds) for motion in MOTIONS for calls in CALLS]
    machine = f"{platform.machine()}, {os.cpu_count()} cores"
    return {
        "ratio": max(row["ratio"] for row in rows),
        "rows": rows,
        "command": COMMAND,
        "version": f"mount-cosim {cosim.__version__}",
        "machine": machine,
    }


def versus(motion: str, calls: str, rounds: int) -> dict[str, Any]:
    by_hand, by_fmu = ByHand(), ByFmu(CALLS[calls])
    pairs = []
    for k in range(rounds + 1):
        torques = MOTIONS[motion](STEP * (BLOCK * k + np.arange(BLOCK)))
        if "SetFloat64" not in CALLS[calls]:
            torques[:] = torques[0]
        pairs.append((seconds(by_hand, torques), seconds(by_fmu, torques)))
    ratios = sorted(b / a for a, b in pairs[1:])
    hand, fmu = (1e9 * median(one) / BLOCK for one in zip(*pairs[1:], strict=True))
    x, y = by_hand.state(), by_fmu.state()
    return {
        "motion": motion,
        "calls": calls,
        "ratio": round(median(ratios), 3),
        "quartiles": [round(ratios[len(ratios) * q // 4], 3) for q in (1, 3)],
        "by_hand_ns": round(hand),
        "fmu_ns": round(fmu),
        "largest_error_by_hand": by_hand.error,
        "difference": abs(float(x[2] / y[2] - 1)),
    }


def seconds(run: Any, torques: np.ndarray) -> float:
    start = perf_counter()
    run(torques)
    return perf_counter() - start


def pointer(values: np.ndarray) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


class ByHand:
    """The hand-written step, from rest; `error` is the largest so far in units of the tolerance (mean square)."""

    def __init__(self) -> None:
        model = read_card("paper_mount").plant().model()
        p = {variable.name.partition(".")[2]: variable.start for variable in model.parameters}
        plain = ("sigma0", "sigma1", "sigma2", "Fc")
        numbers = [1 / p["inertia"], p["torque_limit"], *(p[name] for name in plain), p["Fs"] - p["Fc"], 1 / p["Vs"]]
        self.axis = np.array([*numbers, p["delta"]])
        self.nominals, self.x = np.array([state.nominal for state in model.states]), np.zeros(3)
        self.library, self.error = opponent(), 0.0

    def __call__(self, torques: np.ndarray) -> None:
        function = self.library.by_hand
        function.restype = ctypes.c_double
        step, tolerance = ctypes.c_double(STEP), ctypes.c_double(TOLERANCE)
        arguments = pointer(torques), len(torques), step, tolerance, pointer(self.nominals), pointer(self.x)
        self.error = max(self.error, function(pointer(self.axis), *arguments))

    def state(self) -> np.ndarray:
        return self.x


class ByFmu:
    """The FMU behind its C interface of FMI 3, called from compiled code; some calls may be left out."""

    def __init__(self, calls: tuple[str, ...]) -> None:
        model = read_card("paper_mount").plant().model()
        self.driver, self.done = Driver(model, library_of(generate(model), host()), 3).start(), 0
        found = {name: getattr(self.driver.library, f"fmi3{name}") for name in calls}
        self.functions = [found.get(name) for name in ("SetFloat64", "GetFloat64", "DoStep")]
        self.library = opponent()

    def __call__(self, torques: np.ndarray) -> None:
        if self.functions[0] is None:
            self.driver.set("tau", float(torques[0]))
        references, instance = self.driver.references, ctypes.c_void_p(self.driver.instance)
        tail = references["tau"], references["q"], ctypes.byref(ctypes.c_double())
        step = ctypes.c_double(STEP)
        count = self.library.by_fmu(instance, *self.functions, pointer(torques), self.done, len(torques), step, *tail)
        if count != len(torques):
            raise SystemExit(f"the FMU stopped: {self.driver.messages[-1:]}")
        self.done += count

    def state(self) -> np.ndarray:
        return self.driver.get("position", "speed", "friction.bristle")


def opponent() -> ctypes.CDLL:
    """Compile the hand-written step with the compiler, the flags and the exp of the FMU."""
    sources = {path.name: path.read_bytes() for path in (*SHIM.glob("detmath*"), HERE / "rodas4_lugre.c")}
    machine = PLATFORMS[host()]
    flags = tuple(flag for flag in (*FLAGS, *machine.flags) if flag != "-fvisibility=hidden")
    return ctypes.CDLL(str(compile_shared(sources, f"opponent{machine.suffix}", machine.target, flags)))


def page(found: dict[str, Any]) -> str:
    lines = [
        "# A co-simulation step of 0.1 ms beside a hand-written one",
        "",
        f"    {found['command']}",
        "",
        f"{found['version']}, {found['machine']}, a shared machine. Plant of the paper, tolerance {TOLERANCE:g}.",
        "By hand: [rodas4_lugre.c](../../bench/rodas4_lugre.c), the same compiler, flags, exp and pow.",
        f"A ratio is that of two blocks of {BLOCK} steps, one after the other; the median counts. Asked: at most 1.2.",
        "",
        "| motion | calls | ratio | quartiles | by hand [ns] | FMU [ns] | relative difference of z |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in found["rows"]:
        quartiles = " to ".join(f"{one:.2f}" for one in row["quartiles"])
        cells = row["motion"], row["calls"], f"{row['ratio']:.2f}", quartiles, row["by_hand_ns"], row["fmu_ns"]
        lines.append(f"| {' | '.join(map(str, cells))} | {row['difference']:.0e} |")
    lines += [
        "",
        "Where the tolerance asks for it the FMU takes more than one step of the solver; by hand it is always one.",
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
