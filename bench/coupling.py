"""The two-mass mount split into motor side and load side: which algorithm stays correct, and up to which step.

python bench/coupling.py --out results/master

Torque of the spring one way, speed of the motor side the other way; the reference is the same mount as one FMU with the
effect `compliance`, stepped at the same ticks. Sliding under a constant torque, so that only the coupling makes errors.
No chance plays a part.
"""

import argparse
import csv
import platform
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/tools"))
from simulating import simulate
from two_mass import SPRING, START, export

import cosim
from cosim.master.result import RunResult
from cosim.support.errors import StepError
from cosim.system.algorithm import Algorithm, Energy, GaussSeidel, Iterated, Jacobi

COMMAND = "python bench/coupling.py --out results/master"
TORQUE, SECONDS = 10.0, 0.3
STEPS = (5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2)
BONDS = (("far.torque", "near.v"),)
ALGORITHMS: dict[str, Algorithm] = {
    "jacobi": Jacobi(),
    "gauss-seidel": GaussSeidel(kind="gauss-seidel", order=("near", "far")),
    "iterated, theta 0.5": Iterated(kind="iterated"),
    "iterated, theta 1": Iterated(kind="iterated", theta=1.0),
    "energy, one piece": Energy(kind="energy", bonds=BONDS, max_pieces=1),
    "energy, tolerance 1e-4": Energy(kind="energy", bonds=BONDS, tolerance=1e-4),
    "energy, tolerance 1e-6": Energy(kind="energy", bonds=BONDS, tolerance=1e-6, max_pieces=256),
}
WIRES = [("far.torque", "near.disturbance"), ("near.v", "far.v"), ("tau", "near.tau")]
SHOWN_STEP = 2e-3
LARGEST = 0.02
"""Beyond this step the far mass swings by half a turn or more while its input is held; stability says little there."""


@dataclass(frozen=True)
class Row:
    """One algorithm at one step: greatest error of the motor side's speed [rad/s], and what it took."""

    algorithm: str
    step: float
    error: float
    order: float
    passes: float
    microseconds: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    with tempfile.TemporaryDirectory() as folder:
        fmus = export(Path(folder))
        rows = [row for name in ALGORITHMS for row in study(fmus, name)]
        limits = {name: largest_stable_step(fmus, algorithm) for name, algorithm in ALGORITHMS.items()}
        traces = {name: together(fmus, ALGORITHMS[name], SHOWN_STEP) for name in ALGORITHMS}
        reference = alone(fmus, SHOWN_STEP)
    out.mkdir(parents=True, exist_ok=True)
    with (out / "coupling.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, Row.__dataclass_fields__)
        writer.writeheader()
        writer.writerows(vars(row) for row in rows)
    (out / "coupling.md").write_text(page(rows, limits), "utf-8")
    draw(rows, traces, reference, out / "coupling.svg")
    print(page(rows, limits))


def together(fmus: Mapping[str, Path], algorithm: Algorithm, step: float, seconds: float = SECONDS) -> RunResult:
    return simulate(
        {"near": fmus["near"], "far": fmus["far"]},
        WIRES,
        record={"v": "near.v", "w": "far.w"},
        step=step,
        ticks=round(seconds / step),
        signals={"tau": TORQUE},
        parameters={"near": {"speed": START}, "far": {"speed": START, "v": START}},
        algorithm=algorithm,
    )


def alone(fmus: Mapping[str, Path], step: float) -> RunResult:
    return simulate(
        {"whole": fmus["whole"]},
        [("tau", "whole.tau")],
        record={"v": "whole.v"},
        step=step,
        ticks=round(SECONDS / step),
        signals={"tau": TORQUE},
        parameters={"whole": {"speed": START}},
    )


def study(fmus: Mapping[str, Path], name: str) -> list[Row]:
    rows: list[Row] = []
    for step in STEPS:
        run = together(fmus, ALGORITHMS[name], step)
        error = float(np.abs(run.recording["v"] - alone(fmus, step).recording["v"]).max())
        before = rows[-1] if rows else None
        order = np.log(error / before.error) / np.log(step / before.step) if before else np.nan
        effort = run.statistics["coupling"]
        passes = effort[0]["rounds"] / run.statistics["steps"] if effort else 1.0
        rows.append(Row(name, step, error, float(order), passes, run.statistics["microseconds_per_step"]))
    return rows


def largest_stable_step(fmus: Mapping[str, Path], algorithm: Algorithm) -> float:
    """Make the step 4 % larger until the first one that is not stable, and return the one before; LARGEST at most."""
    ticks = 10_000
    while stable(fmus, algorithm, ticks):
        if ticks <= 1 / LARGEST:
            return LARGEST
        ticks = int(ticks / 1.04)
    return 1 / (1.04 * ticks)


def stable(fmus: Mapping[str, Path], algorithm: Algorithm, ticks: int) -> bool:
    try:
        recording = together(fmus, algorithm, 1 / ticks, seconds=1.0).recording
    except StepError:
        return False
    swing = recording["v"] - recording["w"]
    quarter = max(3, len(swing) // 4)
    return bool(np.ptp(swing[-quarter:]) < np.ptp(swing[:quarter]) and np.abs(swing).max() < 10 * START)


def page(rows: list[Row], limits: Mapping[str, float]) -> str:
    """Return the README of the result."""
    lines = [
        "# The two-mass mount, split",
        "",
        f"    {COMMAND}",
        "",
        f"mount-cosim {cosim.__version__}, Python {platform.python_version()}, {platform.machine()}. The paper's mount "
        f"with a spring ({SPRING.antiresonance_hz:g} Hz antiresonance, {SPRING.resonance_hz:g} Hz resonance, damping "
        f"{SPRING.damping_ratio:g}), LuGre friction on the motor side. Greatest error of the motor side's speed over "
        f"{SECONDS} s against the mount as one FMU, in rad/s; bold: above {10 * START:g}, useless. A pass is one "
        "step of both sides. Stable: the swing of the spring falls over a second, at this and all smaller steps tried.",
        "",
        "| step [ms] | " + " | ".join(ALGORITHMS) + " |",
        "| --- |" + " --- |" * len(ALGORITHMS),
    ]
    for step in STEPS:
        errors = [row.error for row in rows if row.step == step]
        lines.append(f"| {1e3 * step:g} | " + " | ".join(_number(error) for error in errors) + " |")
    orders = {
        name: np.median([r.order for r in rows if r.algorithm == name and r.step <= 5e-4][1:]) for name in ALGORITHMS
    }
    passes = {name: [r.passes for r in rows if r.algorithm == name] for name in ALGORITHMS}
    lines += [
        "| observed order, up to 0.5 ms | " + " | ".join(f"{orders[name]:.1f}" for name in ALGORITHMS) + " |",
        "| largest stable step [ms] | " + " | ".join(_limit(limits[name]) for name in ALGORITHMS) + " |",
        "| passes a step, least to most | "
        + " | ".join(f"{min(one):.1f} to {max(one):.1f}" for one in passes.values())
        + " |",
        "",
        "![coupling](coupling.svg)",
        "",
        "Jacobi feeds energy in: torque and speed act a step late both ways, which uses up the spring's own damping. "
        "Gauss-Seidel delays one of the two wires only. The iterated trapezoid is of second order. `energy` cuts a "
        "step into as many pieces as the energy lost on the bond asks for, so its error hardly depends on the step.",
    ]
    return "\n".join(lines) + "\n"


def _number(error: float) -> str:
    return f"{error:.1e}" if error < 10 * START else f"**{error:.0e}**"


def _limit(step: float) -> str:
    return f"{1e3 * step:.2g}" if step < LARGEST else f"{1e3 * LARGEST:g} or more"


def draw(rows: list[Row], traces: Mapping[str, RunResult], reference: RunResult, path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    plt.rcParams["svg.hashsalt"] = "coupling"
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for name in ALGORITHMS:
        own = [row for row in rows if row.algorithm == name]
        left.loglog([1e3 * row.step for row in own], [row.error for row in own], ".-", label=name)
    grid = np.array([5e-5, 1e-3])
    for order, level in ((1, 5e-6), (2, 1.2e-7)):
        left.loglog(1e3 * grid, level * (grid / grid[0]) ** order, "k:", lw=0.8)
        left.annotate(f"order {order}", (1e3 * grid[1], level * (grid[1] / grid[0]) ** order), fontsize=8)
    left.set(xlabel="step [ms]", ylabel="greatest error of the speed [rad/s]", ylim=(3e-8, 1e2))
    left.legend(frameon=False, fontsize=8, loc="upper left")
    t = reference.recording.t
    right.plot(t, reference.recording["v"], "k", lw=3, alpha=0.3, label="one FMU")
    shown: dict[str, Any] = {name: traces[name].recording["v"] for name in list(ALGORITHMS)[:3]}
    for name, speed in shown.items():
        right.plot(t, speed, lw=1, label=name)
    right.set(xlabel="time [s]", ylabel="speed of the motor side [rad/s]", title=f"step {1e3 * SHOWN_STEP:g} ms")
    right.legend(frameon=False, fontsize=8)
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    main()
