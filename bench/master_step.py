"""What a step of the master costs, beside a plain C loop and what others give Python users; all in one run.

python bench/master_step.py --out results/master     (--json prints the numbers)

Two FMUs of the paper's mount, plant and controller, at 0.1 ms. A ratio is that of two runs of the same round, right
after each other; the median of the rounds counts. A peer that is missing or does not run is named with the reason.
"""

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import cosim

HERE = Path(__file__).parent
STEPS = {
    "c": 150_000,
    "recording_c": 150_000,
    "cosim": 150_000,
    "gauss_seidel": 150_000,
    "isolated": 150_000,
    "ecospy": 150_000,
    "libcosimpy": 20_000,
    "fmpy": 20_000,
    "interpreted": 5_000,
}
TITLES = {
    "c": "plain C loop",
    "recording_c": "C loop, 6 signals kept in memory",
    "cosim": "cosim, 6 signals to Parquet",
    "gauss_seidel": "cosim, Gauss-Seidel, 6 signals to Parquet",
    "isolated": "cosim --isolate, 6 signals to Parquet",
    "ecospy": "ecospy step(N), nothing recorded",
    "libcosimpy": "libcosimpy step(N), nothing recorded",
    "fmpy": "FMPy: get, set, doStep in Python",
    "interpreted": "cosim --interpreted, 6 signals to Parquet",
}
COMMAND = "python bench/master_step.py --out results/master"
PEERS = (
    "ecospy is linked with libtbb.so.12, which its wheel does not bring: `pip install '.[peers]' tbb` in an "
    "environment of its own, and LD_LIBRARY_PATH=ENVIRONMENT/lib in front of the command."
)
ASKED = 1.2
"""Of the C loop's time, with recording on."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = measure(Path(folder), options.rounds)
    if options.out:
        write(found, options.out)
    print(json.dumps(found, indent=2) if options.json else page(found))


def measure(folder: Path, rounds: int) -> dict[str, Any]:
    """Return {"cosim": ratio, ...}: ours the worse, others' the better of FMI 2 and 3; and everything behind it."""
    load = os.getloadavg()[0]
    per_version = {fmi: versus(pair(folder, fmi), fmi, rounds) for fmi in (2, 3)}
    ratios = {f"fmi{fmi}": {name: one["ratio"] for name, one in per_version[fmi].items()} for fmi in (2, 3)}
    names = [name for name in STEPS if name != "c"]
    both = {name: [one[name] for one in ratios.values() if one[name] is not None] for name in names}
    total = {
        name: (max if name == "cosim" else min)(values) if (values := both[name]) else None
        for name in ("cosim", "fmpy", "ecospy", "libcosimpy", "interpreted")
    }
    return total | {
        "detail": {f"fmi{fmi}": per_version[fmi] for fmi in (2, 3)},
        "process": process(folder),
        "linearity": linearity(folder / "3"),
        "rounds": rounds,
        "load": round(load, 1),
        "versions": versions(),
        "machine": f"Python {platform.python_version()}, {os.cpu_count()} cores, {platform.machine()}",
    }


def pair(folder: Path, fmi: int) -> Path:
    from pyfmi_models.card import read_card
    from pyfmi_models.export import export_fmu

    card = read_card("paper_mount")
    for part, model in (("plant", card.plant().model()), ("controller", card.controller_model())):
        export_fmu(replace(model, name=part), folder / str(fmi) / f"{part}.fmu", fmi=fmi)
    return folder / str(fmi)


def versus(folder: Path, fmi: int, rounds: int) -> dict[str, Any]:
    """Run everybody in turn, round after round; one who fails once is not asked again."""
    runs: dict[str, list[float]] = {name: [] for name in STEPS}
    reasons: dict[str, str] = {}
    for _ in range(rounds):
        for name in STEPS:
            if name not in reasons:
                try:
                    runs[name].append(step_time(name, folder, fmi, STEPS[name]))
                except RuntimeError as error:
                    reasons[name] = str(error)
    found = {name: _summary(runs[name], runs["c"], reasons.get(name)) for name in STEPS}
    return found | {"beside_recording": _summary(runs["cosim"], runs["recording_c"], None)}


def _summary(times: list[float], yardstick: list[float], reason: str | None) -> dict[str, Any]:
    if reason:
        return {"microseconds": None, "ratio": None, "reason": reason}
    ratios = [one / c for one, c in zip(times, yardstick, strict=True)]
    spread = [round(min(ratios), 2), round(max(ratios), 2)]
    return {"microseconds": round(1e6 * median(times), 3), "ratio": round(median(ratios), 2), "spread": spread}


def step_time(name: str, folder: Path, fmi: int, steps: int) -> float:
    """Return seconds a step, measured in a process of its own; raises RuntimeError with the reason."""
    command = [sys.executable, str(HERE / "master_runners.py"), name, str(folder), str(fmi), str(steps)]
    path = os.pathsep.join(filter(None, [str(HERE.parent), os.environ.get("PYTHONPATH", "")]))
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False)
    lines = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("seconds ")]
    if not lines:
        crashed = f"its process ended with signal {-done.returncode}" if done.returncode < 0 else ""
        raise RuntimeError(crashed or (done.stderr.strip().splitlines() or ["no number came out"])[-1])
    return float(lines[0]) / steps


def process(folder: Path) -> dict[str, dict[str, float]]:
    """Seconds of whole processes, wall clock and processor: imports, and the sidereal run with warm caches."""
    sidereal = [sys.executable, "-m", "cosim", "run", "sidereal", "--force", "--out", str(folder / "sidereal")]
    programs = {
        "bare Python": [sys.executable, "-c", "pass"],
        "import cosim": [sys.executable, "-c", "import cosim"],
        "import cosim.master.simulate": [sys.executable, "-c", "import cosim.master.simulate"],
        "cosim run sidereal (15 s at 0.1 ms), warm": sidereal,
    }
    subprocess.run(sidereal, check=True, capture_output=True)
    return {name: _best([_seconds(command) for _ in range(7)]) for name, command in programs.items()}


def _best(times: list[tuple[float, float]]) -> dict[str, float]:
    wall, processor = (round(min(one), 3) for one in zip(*times, strict=True))
    return {"wall": wall, "processor": processor}


def _seconds(command: list[str]) -> tuple[float, float]:
    """Return wall-clock and processor seconds (user and system) of a process."""
    begun, before = perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return perf_counter() - begun, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def linearity(folder: Path) -> dict[str, float]:
    """Microseconds a step for runs of growing length; a flat row is linear cost."""
    lengths = [50_000, 200_000, 800_000, 3_200_000]
    return {f"{n:,}": round(1e6 * min(step_time("cosim", folder, 3, n) for _ in range(3)), 3) for n in lengths}


def versions() -> dict[str, str]:
    found = {"mount-cosim": cosim.__version__}
    for name in ("fmpy", "ecospy", "libcosimpy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def page(found: dict[str, Any]) -> str:
    """Return the README of the result."""
    lines = [
        "# A step of the master",
        "",
        f"    {COMMAND}",
        "",
        ", ".join(f"{name} {text}" for name, text in found["versions"].items())
        + f"; {found['machine']}, load {found['load']} before.",
        PEERS,
        f"Plant and controller of the paper's mount, 0.1 ms; ratio to the C loop in the same round, median of "
        f"{found['rounds']} rounds (least to greatest). Start-up is not counted, closing the file is.",
        "",
        "| who | FMI 2: us a step | ratio | FMI 3: us a step | ratio |",
        "| --- | --- | --- | --- | --- |",
    ]
    cells = {name: [_cells(found["detail"][key][name]) for key in ("fmi2", "fmi3")] for name in STEPS}
    lines += [f"| {TITLES[name]} | {two} | {three} |" for name, (two, three) in cells.items()]
    kept = " and ".join(_cells(found["detail"][key]["beside_recording"]).split("| ")[1] for key in ("fmi2", "fmi3"))
    lines += [
        "",
        f"Beside the C loop that keeps the same signals cosim takes {kept} (FMI 2 and 3; asked: {ASKED} at most). It "
        "reads as much from the FMUs, writes no file, and looks at nothing.",
        "",
        "![ratios](master_step.svg)",
        "",
        "| whole process, best of 7 | s | of processor |",
        "| --- | --- | --- |",
    ]
    lines += [f"| {name} | {one['wall']} | {one['processor']} |" for name, one in found["process"].items()]
    lines += ["", "| steps in one run (FMI 3, recording on) | us a step |", "| --- | --- |"]
    lines += [f"| {name} | {value} |" for name, value in found["linearity"].items()]
    return "\n".join(lines) + "\n"


def _cells(one: dict[str, Any]) -> str:
    if one["ratio"] is None:
        return f"- | {one['reason']}"
    return f"{one['microseconds']} | {one['ratio']} ({one['spread'][0]} to {one['spread'][1]})"


def write(found: dict[str, Any], out: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    plt.rcParams["svg.hashsalt"] = "master_step"
    out.mkdir(parents=True, exist_ok=True)
    (out / "README.md").write_text(page(found), "utf-8")
    (out / "master_step.json").write_text(json.dumps(found | {"command": COMMAND}, indent=2) + "\n", "utf-8")
    figure, axes = plt.subplots(figsize=(8, 3.2), layout="constrained")
    for shift, key in ((-0.2, "fmi2"), (0.2, "fmi3")):
        bars = [(k + shift, found["detail"][key][name]["ratio"] or 0) for k, name in enumerate(STEPS)]
        axes.barh(*zip(*bars, strict=True), height=0.36, label=f"FMI {key[-1]}")
    axes.axvline(ASKED, color="k", lw=0.8, ls=":")
    axes.set(xscale="log", xlabel=f"time of a step, ratio to the plain C loop (dotted: {ASKED})")
    axes.set_yticks(range(len(STEPS)), [TITLES[name] for name in STEPS])
    axes.invert_yaxis()
    axes.legend(frameon=False)
    figure.savefig(out / "master_step.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
