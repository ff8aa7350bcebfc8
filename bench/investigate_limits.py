"""Is any limit ever left? Motions of all families, in limits drawn at random, on machines that no model is right about.

    python bench/investigate_limits.py --runs 1000 --seed S --out results/investigate

Machines are drawn (inertia, friction, loop, something concealed, a card up to 15 % off), for each of them RUNS sets of
limits, evenly in their logarithm: position, speed, acceleration, torque, frequency, in every other one a forbidden
band, and the seconds. A motion that no share of speed makes fit is refused, as in an investigation. Every other one is
run on the co-simulated plant, and on the drive of `virtual-drive` (in this process; `--udp`: at the other end of UDP)
with torque and speed as limits of its own and a loop that has none. Counted as beyond a limit: set points, torques, the
plant's own position and speed, a speed that the drive itself finds, a torque that it has to hold, a session that ends
in a fault.
"""

import argparse
import itertools
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cosim.data.recording import Recording
from cosim.support.errors import HardwareError
from cosim.support.version import __version__
from cosim_investigation.design import allowed
from cosim_investigation.families import FAMILIES
from cosim_investigation.limits import Limits
from cosim_investigation.motions import Motion, Tones, room_of
from cosim_investigation.questions import problem_of

sys.path.append(str(Path(__file__).parent))
from limits_axes import Axis, axis, on_a_drive, over_udp

RUNS = 50
"""Motions a machine."""
ROUNDING = 1e-6
"""Relative excess that is the encoder's step, or rounding."""


@dataclass(frozen=True)
class Asked:
    """Limits, seconds and the number of the family, as they were drawn."""

    limits: Limits
    seconds: float
    family: int
    turned: bool
    seed: int


def asked(rng: np.random.Generator, level: float, one: Axis) -> Asked:
    """Draw what a motion must keep to, for an axis that stands at 0."""
    between = [(0.05, 1.5), (0.1, 2.0), (0.5, 6.0), (0.5, 4.0), (0.3, 1.0), (0.3, 10.0), (1.1, 1.6), (6.0, 16.0)]
    reach, speed, acceleration, torque, share, low, wide, seconds = (
        float(np.exp(rng.uniform(*np.log(ends)))) for ends in between
    )
    shift, band = float(rng.uniform(-0.7, 0.7)) * reach, (low, low * wide) if rng.integers(2) else (0.0, 0.0)
    needs = torque * (2 * level + one.card.mount.inertia * acceleration)
    limits = Limits(shift - reach, shift + reach, speed, acceleration, needs, share * one.bandwidth, *band)
    return Asked(limits, seconds, int(rng.integers(len(FAMILIES))), bool(rng.integers(2)), int(rng.integers(1000)))


def planned_beyond(motion: Motion, one: Asked) -> Iterator[str]:
    """What the set point itself leaves."""
    q, v, a = motion.sampled(np.arange(0.0, motion.seconds, 1e-3))
    if left := one.limits.left_by(q, v, a):
        yield f"set point: {left}"
    if motion.seconds > one.seconds * (1 + ROUNDING):
        yield f"set point: {motion.seconds:.4g} s beyond {one.seconds:.4g} s"
    tones = [hertz for part in motion.parts if isinstance(part, Tones) for hertz in part.hertz]
    low, high = one.limits.forbidden_from, one.limits.forbidden_to
    yield from (f"set point: a tone of {hertz:.4g} Hz" for hertz in tones if low < hertz < high)


def moved_beyond(found: Recording, limits: Limits, where: str) -> Iterator[str]:
    """What a recording and the plant's own motion leave."""
    if left := limits.left_in(found):
        yield f"{where}: {left}"
    q, v = found["true_q"], found["true_v"]
    tops = (("position", q.max(), limits.high), ("position", -q.min(), -limits.low))
    for name, most, limit in (*tops, ("speed", np.abs(v).max(), limits.speed)):
        if most > limit + ROUNDING * abs(limit):
            yield f"{where}: {name} of the plant {most:.5g} beyond {limit:.5g}"


def run(one: Axis, motion: Motion, given: Asked, folder: Path, udp: bool) -> list[str]:
    """Move on the plant and on the drive; every limit that was left."""
    for path in folder.glob("run.*"):
        path.unlink()
    found = one.simulated.record(motion, given.seed, folder / "run.plant.parquet")
    beyond = [*planned_beyond(motion, given), *moved_beyond(found, given.limits, "plant")]
    try:
        done, counted = (over_udp if udp else on_a_drive)(one, motion, given.limits, folder / "run.drive.parquet")
    except HardwareError as error:
        return [*beyond, f"drive: {error}"]
    beyond += [f"drive: {many} {name}" for name, many in counted.items() if many]
    if done["q"].max() > given.limits.high or done["q"].min() < given.limits.low:
        beyond.append(f"drive: position {done['q'].min():.5g} to {done['q'].max():.5g}")
    return beyond


def machine(rng: np.random.Generator, folder: Path, counts: Counter[str], runs: int, udp: bool = False) -> list[str]:
    """Draw a machine, believe its first recording, run motions; sentences on limits that were left."""
    one, beyond = axis(rng, folder), list[str]()
    first = one.simulated.record(one.simulated.own(), 0, folder / "first.parquet")
    problem = problem_of([first], one.card)
    ours, level = problem.fit(problem.mount, 5), float(np.abs(first["tau"]).mean())
    wanted = counts["run"] + runs
    while counts["run"] < wanted:
        given = asked(rng, level, one)
        room = room_of(given.limits, one.simulated.home, given.seconds, given.seed, given.turned)
        motion, _, refused = allowed(
            FAMILIES[given.family], room, ours, problem.prepared, given.limits, one.simulated.home
        )
        counts[f"refused: {refused.split()[0]}" if refused else "run"] += 1
        if not refused:
            found = run(one, motion, given, folder, udp)
            counts["beyond"] += bool(found)
            beyond += [f"{one.concealed}, {motion.family}: {text}" for text in found]
    return beyond


def page(command: str, counts: Counter[str], beyond: list[str]) -> str:
    """The page."""
    refused = {name: many for name, many in counts.items() if name.startswith("refused")}
    said = ", ".join(f"{many} for {name.split(': ')[1]}" for name, many in sorted(refused.items())) or "none"
    lines = ["# Limits of investigations", "", f"`{command}`, mount-cosim {__version__}", ""]
    lines += [(__doc__ or "").split("\n\n")[2].strip(), ""]
    lines += [
        f"{counts['run']} motions on {counts['machines']} machines, each on plant and drive; "
        f"refused before they moved: {sum(refused.values())} ({said}). {counts['beyond']} left a limit.",
        "",
    ]
    return "\n".join([*lines, *(f"- {one}" for one in beyond)]).rstrip() + "\n"


def main() -> None:
    """Run, count, write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=5100)
    parser.add_argument("--until", type=float, default=1e9, help="seconds after which no machine is begun")
    parser.add_argument("--udp", action="store_true", help="the drive at the other end of UDP")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    counts, beyond, begun = Counter[str](), list[str](), time.monotonic()
    for number in itertools.count():
        left = min(RUNS, given.runs - counts["run"])
        if left <= 0 or time.monotonic() - begun > given.until:
            break
        with TemporaryDirectory() as name:
            beyond += machine(np.random.default_rng([given.seed, number]), Path(name), counts, left, given.udp)
        counts["machines"] += 1
        print(dict(counts), *beyond[-1:], flush=True)
    command = f"python bench/investigate_limits.py --runs {given.runs} --seed {given.seed}"
    command += f"{' --udp' * given.udp} --out {given.out}"
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "limits.md").write_text(page(command, counts, beyond), "utf-8")


if __name__ == "__main__":
    main()
