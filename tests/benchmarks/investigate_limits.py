"""Is any limit ever left? Motions of all families, in limits drawn at random, on a plant that the model is wrong about.

    python tests/benchmarks/investigate_limits.py --runs 1000 --seed 5100 --out results/investigate

Limits of position, speed and acceleration are drawn (evenly in their logarithm), as is where in its range the axis
stands; a motion that the believed card's torque forbids is refused, as in an investigation. Every other one is run on
a plant with a concealed cable, in its loop. Counted: recordings beyond a limit, and by how much of it.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cosim.investigation.design import allowed
from cosim.investigation.families import FAMILIES
from cosim.investigation.limits import Limits
from cosim.investigation.machine import CoSimulated
from cosim.investigation.motions import room_of
from cosim.investigation.questions import problem_of
from cosim.support.version import __version__
from cosim.system.scenario import read_scenario
from pyfmi_models.card import read_card

sys.path.append(str(Path(__file__).parents[1]))
from investigations import CABLE, written

SECONDS, CUTOFF = 8.0, 30.0
"""Length of each motion [s]; band of the predicted torque [Hz]."""


def drawn(rng: np.random.Generator, torque: float, frequency: float) -> Limits:
    """Limits about 0: reach 0.05 to 1.5 rad, speed 0.1 to 2 rad/s, acceleration 0.5 to 6 rad/s2."""
    reach, speed, acceleration = (
        float(np.exp(rng.uniform(*np.log(ends)))) for ends in ((0.05, 1.5), (0.1, 2), (0.5, 6))
    )
    shift = float(rng.uniform(-0.7, 0.7)) * reach
    return Limits(shift - reach, shift + reach, speed, acceleration, torque, frequency)


def main() -> None:
    """Run, count, write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=5100)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    rng, counts, beyond = np.random.default_rng(given.seed), Counter[str](), list[str]()
    with TemporaryDirectory() as name:
        scenario, card, machine = written(Path(name), CABLE)
        loop, believed = CoSimulated(read_scenario(scenario), machine), read_card(card)
        first = loop.record(loop.own(), 0, Path(name) / "first.parquet")
        problem = problem_of([first], believed)
        ours = problem.fit(problem.mount, 5)
        while counts["run"] < given.runs:
            torque = float(rng.choice([60.0, 15.0]))
            limits, turned = drawn(rng, torque, 2.4), bool(rng.integers(2))
            room = room_of(limits, loop.home, SECONDS, int(rng.integers(1000)), turned)
            family = FAMILIES[int(rng.integers(len(FAMILIES)))]
            motion, _, refused = allowed(family, room, ours, CUTOFF, limits, loop.home)
            if refused:
                counts["refused"] += 1
                continue
            path = Path(name) / "run.parquet"
            path.unlink(missing_ok=True)
            left = limits.left_in(loop.record(motion, counts["run"], path))
            counts["run"] += 1
            if left:
                beyond.append(f"{motion.family}: {left}")
    command = f"python tests/benchmarks/investigate_limits.py --runs {given.runs} --seed {given.seed} --out {given.out}"
    lines = ["# Limits of investigations", "", f"`{command}`, mount-cosim {__version__}", ""]
    lines += [(__doc__ or "").split("\n\n")[2].strip(), ""]
    lines += [f"{counts['run']} runs, {counts['refused']} refused before, {len(beyond)} recordings beyond a limit.", ""]
    lines += [f"- {one}" for one in beyond]
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "limits.md").write_text("\n".join(lines).rstrip() + "\n", "utf-8")
    print(lines[-2 - len(beyond)] if beyond else lines[-2])


if __name__ == "__main__":
    main()
