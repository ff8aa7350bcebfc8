"""What a sweep costs: one core, two, and a Dask cluster of two workers on the same machine, side by side.

python bench/sweep.py --out results/master     (--runs and --rounds make it shorter, --json prints numbers)

The scenario `sidereal` (15 s at 0.1 ms), four parameters drawn by Latin hypercube. Each round does `runs` of its own on
each of the three, right after each other, whole: with start-up, rehearsal, journal and table. A ratio is that of two
sweeps of one round; the median of the rounds counts. "One core" is one: all its processes are kept there. What else
runs on a shared machine takes its part of both cores, which a sweep on one core does not feel: so the seconds of
processors are told too, which hardly depend on it.
"""

import argparse
import json
import os
import platform
import resource
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import cosim

COMMAND = "python bench/sweep.py --runs 250 --rounds 4 --out results/master"
SWEEP = """
scenario = "sidereal"
method = "latin_hypercube"
runs = {runs}
seed = {seed}
[vary]
"mount.friction.Fc" = {{ low = 0.5, high = 4.0 }}
"mount.axis.inertia" = {{ mean = 30.0, std = 2.0 }}
"controller.kp" = {{ low = 50.0, high = 400.0, scale = "log" }}
"controller.observer_bandwidth" = {{ low = 60.0, high = 300.0 }}
[statistics]
rms_error = {{ signal = "reference.position", minus = "mount.q", kind = "rms", from = 3.0, unit = "arcsec" }}
peak_torque = {{ signal = "mount.tau", kind = "peak" }}
"""
LENGTHS = (25, 50, 100, 200, 400)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--runs", type=int, default=250)
    parser.add_argument("--rounds", type=int, default=4)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = measure(Path(folder), options.runs, options.rounds)
        if options.out:
            write(found, options.out, Path(folder))
    print(json.dumps(found, indent=2) if options.json else page(found))


def measure(folder: Path, runs: int, rounds: int) -> dict[str, Any]:
    """Return seconds of each sweep by who ran it, the ratios, and seconds a run for growing numbers of runs."""
    swept(folder, 2, 0)  # FMUs are built and files are warm after this
    seconds: dict[str, list[float]] = {"one core": [], "two cores": [], "Dask, two workers": []}
    busy = dict.fromkeys(seconds, 0.0)
    with cluster() as address:
        for number in range(rounds):
            ways = {"one core": (1, ""), "two cores": (2, ""), "Dask, two workers": (None, address)}
            for name, (workers, where) in ways.items():
                before = processor_seconds()
                with one_core() if name == "one core" else nullcontext():
                    seconds[name].append(swept(folder, runs, number, workers, where))
                busy[name] += processor_seconds() - before
    two = seconds["two cores"]
    lengths = [n for n in LENGTHS if n <= 4 * runs]
    return {
        "two_over_one": ratio(seconds["one core"], two),
        "dask_over_local": ratio(seconds["Dask, two workers"], two),
        "runs": runs * rounds,
        "processor_seconds_a_run": {name: round(one / (runs * rounds), 4) for name, one in busy.items()},
        "seconds": {
            name: {"total": round(sum(one), 1), "rounds": [round(x, 2) for x in one]} for name, one in seconds.items()
        },
        "linearity": {str(n): round(swept(folder, n, 99, 2) / n, 4) for n in lengths},
        "memory_mb": round(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024),
        "rounds": rounds,
        "versions": versions(),
        "machine": f"Python {platform.python_version()}, {os.cpu_count()} cores, {platform.machine()}",
    }


def ratio(slow: list[float], fast: list[float]) -> dict[str, Any]:
    each = [one / other for one, other in zip(slow, fast, strict=True)]
    return {"median": round(median(each), 3), "spread": [round(min(each), 3), round(max(each), 3)]}


def swept(folder: Path, runs: int, seed: int, workers: int | None = None, address: str = "") -> float:
    """Return the seconds of a whole sweep into a folder of its own; a run that fails is no measurement."""
    from cosim.models.cache import with_fmus
    from cosim.system.scenario import read_scenario
    from cosim_sweeps.conduct import conduct
    from cosim_sweeps.file import read_sweep

    file = folder / "sweep.toml"
    file.write_text(SWEEP.format(runs=runs, seed=seed))
    sweep = read_sweep(file)
    scenario = with_fmus(read_scenario(sweep.scenario))
    begun = perf_counter()
    done = conduct(sweep, scenario, folder / "out", workers=workers, address=address, force=True, command=COMMAND)
    assert done.failed == 0, "a run failed"
    return perf_counter() - begun


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process and those it begins on one core: a sweep by one worker still has a parent and a writer."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def processor_seconds() -> float:
    """Return the seconds of processors that this process, the workers of its cluster and all ended ones have used."""
    import psutil

    own = psutil.Process()
    return sum(sum(one.cpu_times()[:4]) for one in [own, *own.children(recursive=True)])


@contextmanager
def cluster() -> Iterator[str]:
    from dask.distributed import LocalCluster

    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(**settings) as found:
        yield found.scheduler_address


def versions() -> dict[str, str]:
    from importlib.metadata import version

    return {"mount-cosim": cosim.__version__} | {name: version(name) for name in ("distributed", "fmpy", "numpy")}


def page(found: dict[str, Any]) -> str:
    """Return the README of the result."""
    two, dask = found["two_over_one"], found["dask_over_local"]
    lines = [
        "# A sweep of runs of 15 s",
        "",
        f"    {COMMAND}",
        "",
        ", ".join(f"{name} {text}" for name, text in found["versions"].items()) + f"; {found['machine']}, shared.",
        f"`sidereal`, 15 s at 0.1 ms, four parameters by Latin hypercube, {found['runs']:,} runs each way in "
        f"{found['rounds']} rounds side by side; start-up, rehearsal, journal and table count. "
        "One core: all processes of a sweep are kept on it.",
        "",
        "| who | seconds in all | a run | of processors | ratio, median of the rounds (least to greatest) |",
        "| --- | --- | --- | --- | --- |",
    ]
    told = {
        "one core": "-",
        "two cores": f"{two['median']} times as fast as one core ({two['spread'][0]} to {two['spread'][1]})",
        "Dask, two workers": f"{dask['median']} of the time of two cores ({dask['spread'][0]} to {dask['spread'][1]})",
    }
    for name, text in told.items():
        total = found["seconds"][name]["total"]
        busy = found["processor_seconds_a_run"][name]
        lines.append(f"| {name} | {total} | {total / found['runs']:.3f} | {busy:.3f} | {text} |")
    lines += ["", f"Largest process: {found['memory_mb']} MB.", "", "| runs in one sweep, two cores | seconds a run |"]
    lines += ["| --- | --- |", *(f"| {n} | {value} |" for n, value in found["linearity"].items())]
    lines += [
        "",
        "![seconds of each round](sweep_rounds.svg)",
        "",
        "The picture that `cosim sweep` draws of a round's table:",
    ]
    lines += ["", "![what came out](sweep.svg)"]
    return "\n".join(lines) + "\n"


def write(found: dict[str, Any], out: Path, folder: Path) -> None:
    import matplotlib
    from matplotlib.figure import Figure

    from cosim.plots.style import AFTER, BEFORE, GREY, STYLE
    from cosim_sweeps.picture import draw

    out.mkdir(parents=True, exist_ok=True)
    (out / "sweep.md").write_text(page(found), "utf-8")
    (out / "sweep.json").write_text(json.dumps(found | {"command": COMMAND}, indent=2) + "\n", "utf-8")
    draw(folder / "out" / "table.parquet", out / "sweep.svg")
    with matplotlib.rc_context(rc=STYLE):
        figure = Figure(figsize=(8, 3), layout="constrained")
        left, right = figure.subplots(1, 2)
        for (name, one), colour in zip(found["seconds"].items(), (GREY, AFTER, BEFORE), strict=True):
            left.plot(range(1, found["rounds"] + 1), one["rounds"], "o-", color=colour, label=name)
        left.set(xlabel="round", ylim=(0, None))
        left.set_title(f"seconds of {found['runs'] // found['rounds']} runs", loc="left")
        left.legend(frameon=False, fontsize=9)
        counts = [int(n) for n in found["linearity"]]
        whole = [n * value for n, value in zip(counts, found["linearity"].values(), strict=True)]
        right.plot(counts, whole, "o-", color=AFTER)
        right.set(xlabel="runs, two cores", xlim=(0, None), ylim=(0, None))
        right.set_title("seconds of a sweep", loc="left")
        figure.savefig(out / "sweep_rounds.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
