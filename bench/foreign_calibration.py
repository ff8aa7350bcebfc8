"""How often `cosim identify --fmu` holds the truth of foreign FMUs, names what is not determined, and what it costs.

python bench/foreign_calibration.py --fmus DIR --out results/identify

DIR holds built Reference-FMUs (modelica/Reference-FMUs: VanDerPol, Dahlquist, BouncingBall), called NAME2.fmu or
NAME3.fmu for FMI 2.0 and 3.0; of the ball the height is recorded (its speed jumps: least squares have no derivative
there). The motor is built here. True values are drawn around the start values, white noise of 1 to 3 % of each output's
spread is added. Beside it: FMPy's `simulate_fmu` with SciPy's `least_squares` from one start, as by hand.
"""

import argparse
import math
import resource
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

import cosim
from cosim.master.simulate import simulate
from cosim.system.system import System
from cosim.system.wire import Record, Wire

sys.path[:0] = [str(Path(__file__).parents[1] / one) for one in ("tests/tools", "tests/exchange")]
from foreign_machine import kept_section  # noqa: E402
from motor_fmu import motor  # noqa: E402

FACTOR = 1.6
"""True values lie within this factor of the start values."""
LONG = 20_000
"""Rows of the recording on which time is compared: 200 s at 100 Hz."""


@dataclass(frozen=True)
class Plant:
    """An FMU with numbers to find: their start values, its outputs, its input, step and rows of a recording."""

    file: str
    starts: dict[str, float]
    outputs: tuple[str, ...]
    step: float
    rows: int
    runs: int
    input: str = ""
    idle: tuple[tuple[str, ...], ...] = ()
    """Sets of numbers that must be named when they are free too."""


PLANTS = (
    Plant("VanDerPol3", {"mu": 1.0}, ("x0", "x1"), 0.01, 1501, 40),
    Plant("Dahlquist2", {"k": 1.0}, ("x",), 0.1, 101, 40),
    Plant("BouncingBall3", {"g": -9.81, "e": 0.7}, ("h",), 0.01, 140, 20),
    Plant("motor2", {"J": 0.02, "d": 0.05, "Fc": 0.1}, ("w", "phi"), 0.01, 400, 14, "i", (("idle",), ("kt", "gear"))),
    Plant("motor3", {"J": 0.02, "d": 0.05, "Fc": 0.1}, ("w", "phi"), 0.01, 400, 14, "i", (("idle",), ("kt", "gear"))),
)


def recorded(plant: Plant, fmu: Path, truth: dict[str, float], seed: int) -> dict[str, np.ndarray]:
    """Columns of a noisy recording."""
    random = np.random.default_rng(seed)
    t = plant.step * np.arange(plant.rows)
    u = 3 * np.sin(2 * np.pi * (0.3 + 0.4 * t) * t + random.uniform(0, 6))
    system = System(
        components={"m": fmu},
        records={name: Record(f"m.{name}") for name in plant.outputs},
        wires=[Wire("u.value", f"m.{plant.input}")] if plant.input else [],
        signals={"u": u} if plant.input else {},
        parameters={"m": truth},
        step=plant.step,
        ticks=plant.rows - 1,
        last=True,
    )
    table = simulate(system).recording.table
    noise = random.uniform(0.01, 0.03)
    noisy = {k: table[k] + noise * np.std(table[k]) * random.standard_normal(plant.rows) for k in plant.outputs}
    return {"t": t, **({plant.input: u} if plant.input else {}), **noisy}


def one(plant: Plant, fmu: Path, seed: int) -> Iterator[dict]:
    """A row for each number of a recording."""
    random = np.random.default_rng(1000 + seed)
    truth = {name: value * FACTOR ** random.uniform(-1, 1) for name, value in plant.starts.items()}
    if "e" in truth:
        truth["e"] = float(np.clip(truth["e"], 0.55, 0.95))
    table = recorded(plant, fmu, truth, seed)
    begun = perf_counter()
    done = cosim.identify(table, fmu=fmu, free=list(truth), starts=2, seed=seed, workers=1)
    seconds = perf_counter() - begun
    for name, value in truth.items():
        off = (done.numbers[name] - value) / done.standard_errors[name]
        yield {
            "fmu": plant.file,
            "seed": seed,
            "name": name,
            "off": off,
            "relative": done.standard_errors[name] / abs(value),
            "seconds": seconds,
        }


def undetermined(plant: Plant, fmu: Path, seed: int) -> list[bool]:
    """Whether each set of numbers that recordings cannot determine is named."""
    table = recorded(plant, fmu, {}, seed)
    free = [next(iter(plant.starts)), *(name for names in plant.idle for name in names)]
    done = cosim.identify(table, fmu=fmu, free=free, starts=1, workers=1)
    return [any(all(name in said.split() for name in names) for said in done.not_determined) for names in plant.idle]


@dataclass(frozen=True)
class Cost:
    """What a way to the numbers cost: seconds of the clock and of processors, and simulations."""

    wall: float
    cpu: float
    simulations: int


def processors() -> float:
    """Seconds that this process and its ended children have used."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def by_hand(plant: Plant, fmu: Path, seed: int) -> tuple[Cost, Cost]:
    """The cost of `cosim identify` from one start, and of FMPy with SciPy on the same recording."""
    from fmpy import extract, read_model_description, simulate_fmu
    from fmpy.simulation import instantiate_fmu
    from scipy.optimize import least_squares

    truth = {name: 1.3 * value for name, value in plant.starts.items()}
    plant = replace(plant, rows=LONG)
    table = recorded(plant, fmu, truth, seed)
    begun, before = perf_counter(), processors()
    done = cosim.identify(table, fmu=fmu, free=list(truth), starts=1)
    ours = Cost(perf_counter() - begun, processors() - before, done.calibrated.evaluations)
    begun, before = perf_counter(), processors()
    count = 0
    description, folder = read_model_description(str(fmu)), extract(str(fmu))
    instance = instantiate_fmu(folder, description, "CoSimulation")
    signals = np.array(
        list(zip(table["t"], table[plant.input], strict=True)), dtype=[("time", float), (plant.input, float)]
    )
    spread = {name: np.std(table[name]) for name in plant.outputs}

    def residual(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        values = {name: x[k] * start for k, (name, start) in enumerate(plant.starts.items())}
        instance.reset()
        found = simulate_fmu(
            folder,
            start_values=values,
            input=signals,
            output=list(plant.outputs),
            stop_time=table["t"][-1],
            step_size=plant.step,
            output_interval=plant.step,
            model_description=description,
            fmu_instance=instance,
            fmi_type="CoSimulation",
        )
        return np.concatenate([(found[name][: plant.rows] - table[name]) / spread[name] for name in plant.outputs])

    least_squares(residual, np.ones(len(plant.starts)), x_scale="jac", bounds=(0, np.inf))
    return ours, Cost(perf_counter() - begun, processors() - before, count)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fmus", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--share", type=float, default=1.0, help="of the runs")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows, named, times = [], [], []
        for number, plant in enumerate(PLANTS):
            own = plant.file.startswith("motor")
            fmu = motor(Path(folder), int(plant.file[-1])) if own else given.fmus / f"{plant.file}.fmu"
            for seed in range(math.ceil(plant.runs * given.share)):
                rows += list(one(plant, fmu, 100 * number + seed))
                print(plant.file, seed, [round(row["off"], 2) for row in rows[-len(plant.starts) :]], flush=True)
            if own:
                for seed in range(math.ceil(5 * given.share)):
                    named += undetermined(plant, fmu, seed)
                times += [by_hand(plant, fmu, seed) for seed in range(math.ceil(2 * given.share))]
    write(given.out, rows, named, times)


def write(out: Path, rows: list[dict], named: list[bool], times: list[tuple[Cost, Cost]]) -> None:
    out.mkdir(parents=True, exist_ok=True)
    lines = [
        "# Numbers of foreign FMUs",
        "",
        "    python bench/foreign_calibration.py --fmus DIR --out results/identify",
        "",
        f"mount-cosim {cosim.__version__}; noise 1 to 3 % of each output's spread, true values within a factor",
        f"{FACTOR} of the start. Share of true values within 2 standard errors (95 % where all is as assumed):",
        "",
        "| FMU | numbers | within 2 s.e. | median standard error | median s |",
        "|---|---|---|---|---|",
    ]
    for file in [*dict.fromkeys(row["fmu"] for row in rows), "all"]:
        mine = [row for row in rows if file in (row["fmu"], "all")]
        inside = sum(abs(row["off"]) <= 2 for row in mine)
        error, seconds = (np.median([row[key] for row in mine]) for key in ("relative", "seconds"))
        share = f"{inside} ({100 * inside / len(mine):.0f} %)"
        lines.append(f"| {file} | {len(mine)} | {share} | {100 * error:.2g} % | {seconds:.2f} |")
    ours, hand = ([pair[k] for pair in times] for k in (0, 1))
    lines += [
        "",
        f"Not determined (an idle number; two that act as a product): {sum(named)} of {len(named)} named.",
        "",
    ]
    lines += [
        "The ball bounces on its own steps of 1 ms: its height is a staircase over g and e, which no standard error",
        "knows of.",
        "",
        f"The motor, {LONG:,} rows, from one start, {len(times)} runs:",
        "",
        "| | s | s of processors | simulations |",
        "|---|---|---|---|",
        *(_cost(name, costs) for name, costs in (("cosim identify", ours), ("FMPy and SciPy by hand", hand))),
        "",
        f"Ratio {total(ours, 'wall') / total(hand, 'wall'):.2f}, of processors "
        f"{total(ours, 'cpu') / total(hand, 'cpu'):.2f};",
        "by hand means no weights, no check of the derivatives and no standard errors.",
    ]
    machine = kept_section(out / "foreign_calibration.md")
    (out / "foreign_calibration.md").write_text("\n".join(lines) + "\n" + (f"\n{machine}" if machine else ""), "utf-8")
    print("\n".join(lines))


def total(costs: list[Cost], what: str) -> float:
    """Sum over runs."""
    return float(sum(getattr(one, what) for one in costs))


def _cost(name: str, costs: list[Cost]) -> str:
    wall, cpu, simulations = (total(costs, what) for what in ("wall", "cpu", "simulations"))
    return f"| {name} | {wall:.1f} | {cpu:.1f} | {simulations:.0f} |"


if __name__ == "__main__":
    main()
