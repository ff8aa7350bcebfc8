"""Concealed effects that poor recordings leave open: in which share does further motion end in the one true name?

    python bench/investigate.py --seed 4100 --cases 12 --out results/investigate

A case is a mount of the home generator with one effect concealed (families in rotation), recorded on one short sine to
be fitted and another for the proof: what a first run gives, half of them over a part of the way only. Cases whose
first answer is not the one true name (a set, a doubtful name, "nothing", "unknown", another name) go on: by designed
motions, and, the same case from the same first recordings, by many tones at random, each with the same seconds of
further motion. Limits are position, speed and acceleration that the generator's own set points ask for, in every
other dozen half a turn of positions; the truth is never shown to the loop. Writes table.csv and README.md; what is done
already in table.csv is not done again. `--all`: cases whose first answer is the true name go on, too.
"""

import argparse
import csv
import time
from collections.abc import Iterator
from itertools import count, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, NamedTuple

import numpy as np

from cosim.data.profile import envelope
from cosim.data.recording import Recording
from cosim.support.version import __version__
from cosim_investigation.limits import Limits
from cosim_investigation.log import Log
from cosim_investigation.loop import Investigation, Settings
from cosim_investigation.motions import Motion as Asked
from cosim_investigation.story import Answered, Story
from cosim_studies.proof import intervals
from cosim_studies.proof.generator import conceal, perturbed, to_toml
from cosim_studies.proof.motion import Motion
from cosim_studies.proof.recorder import columns_of
from cosim_studies.proof.simulated_axis import SimulatedAxis, draw_axis, draw_drive, stream
from cosim_studies.proof.truth import TICK, simulate, ticks
from pyfmi_models.card import parse_card

Design = Literal["log-odds", "random"]
DESIGNS: tuple[Design, ...] = ("log-odds", "random")
EFFECTS = (
    *("dwell_breakaway", "cogging", "cable_wrap", "gravity_unbalance", "position_friction", "stribeck"),
    *("torque_offset", "friction_asymmetry", "encoder_eccentricity", "backlash", "quadratic_drag", "delay"),
)
FIRST, RATE = 12.0, 500
"""Length of each of the first recordings [s]; rows a second."""
SIZES = (0.5, 1.0)
"""Sizes of effects, of which 1 is about a quarter of the friction."""
STROKES = (0.4, 1.0)
"""Strokes of the first recordings, relative to what the generator's own would have at that pace. Unit: 1."""
ROOMS = ("own", "half a turn")
"""Positions that are allowed: what the generator's own set points ask for, or half a turn about where the axis stands
at least, which is what tells a weight from a cable."""
HALF_TURN = np.pi / 2 / 0.9
"""Of it the larger half [rad], so that nine tenths of it are a quarter of a turn."""
COLUMNS = (
    "seed",
    "effect",
    "size",
    "stroke",
    "room",
    "design",
    "first",
    "open",
    "last",
    "left_open",
    "further_s",
    "rounds",
)
COLUMNS += ("ended", "slowest_round_s", "beyond_a_limit")


class Case(NamedTuple):
    """One machine and what is concealed in it."""

    seed: int
    effect: str
    size: float
    stroke: float = 1.0
    room: str = "own"


class Concealed:
    """A mount of the generator, which follows any motion; what is concealed in it is the same in each recording."""

    def __init__(self, case: Case) -> None:
        self.case = case
        bench = self._bench()
        bench.mount["loop_inertia"] = 0.0
        self.card = parse_card(to_toml(perturbed(bench, stream(case.seed, "card"))), "card.toml")
        self.pace, self.home = bench.pace, bench.pace.home
        own = [np.abs(getattr(bench.training, name) - (self.home if name == "q" else 0)).max() for name in "qva"]
        reach, speed, acceleration = (float(one) / 0.9 for one in own)
        reach = max(reach, HALF_TURN) if case.room != "own" else reach
        loop = float(np.sqrt(bench.mount["kp"]) / (2 * np.pi))
        self.limits = Limits(self.home - reach, self.home + reach, speed, acceleration, 1e6, loop)

    def record(self, motion: Asked, number: int, path: Path) -> Recording:
        """Follow a motion."""
        q, v, a = motion.sampled(ticks(round(motion.seconds / TICK)))
        return self._recorded(f"run {number}", Motion(q + self.home, v, a), path)

    def first(self, folder: Path) -> list[Recording]:
        """Two sines: what a first run gives."""
        ways = (("first", 1.0, 1.0), ("first proof", 0.8, 0.9))
        return [self._recorded(name, self._sine(slow, small), folder / f"{name}.parquet") for name, slow, small in ways]

    def _sine(self, slow: float, small: float) -> Motion:
        hertz = max(self.pace.hertz, 2 / FIRST)
        w, t = 2 * np.pi * hertz * slow, ticks(round(FIRST / TICK))
        size = self.case.stroke * small * self.pace.amplitude * self.pace.hertz / hertz
        q, v, a = envelope((size * np.sin(w * t), size * w * np.cos(w * t), -size * w * w * np.sin(w * t)), t, 2.0)
        return Motion(q + self.home, v, a)

    def _recorded(self, name: str, motion: Motion, path: Path) -> Recording:
        bench = self._bench(name, motion)
        bench.mount["loop_inertia"] = self.card.mount.inertia
        raw = simulate(bench.mount, bench.drives[name], bench.temperature[name])
        table = columns_of(bench, name, raw, RATE, stream(self.case.seed, f"clock {name}"))
        Recording.of({key: table[key].to_numpy() for key in table}, name).write(path)
        return Recording.read(path)

    def _bench(self, name: str = "", motion: Motion | None = None) -> SimulatedAxis:
        """The mount anew, with a recording more, and the effect concealed in all of them."""
        bench = draw_axis(self.case.seed, "lugre", 1.0, RATE, FIRST)
        if motion is not None:
            bench.motions[name] = motion
            bench.drives[name] = draw_drive(stream(self.case.seed, name), motion, bench.noise)
            bench.temperature[name] = float(bench.drives[name].ambient[0] + 1.5)
        conceal(bench, self.case.effect, self.case.seed, self.case.size)
        return bench


def cases(seed: int) -> Iterator[Case]:
    """Families in rotation, rooms, strokes and sizes in turn, a machine of its own each."""
    for number in count():
        turn = number // len(EFFECTS)
        stroke, room = STROKES[turn // 2 % 2], ROOMS[turn % 2]
        yield Case(seed + number, EFFECTS[number % len(EFFECTS)], SIZES[(number + turn // 4) % 2], stroke, room)


def asked(case: Case, design: Design, budget: float) -> tuple[Story, bool]:
    """Go on from the first recordings; the story, and whether any recording has left a limit."""
    machine = Concealed(case)
    with TemporaryDirectory() as name, Log(Path(name) / "log", {"case": str(case)}) as log:
        train, heldout = machine.first(Path(name))
        settings = Settings(budget, 10.0, case.seed, design)
        work = Investigation(machine, machine.card, machine.limits, log, settings)
        work.begin(Asked("", "", ()), [train], [heldout])
        story = work.go_on()
        return story, story.ended == "limit left"


def first_answer(case: Case) -> dict[str, str] | None:
    """The line of a case whose first answer is the one true name, where nothing further is asked; else nothing."""
    row = row_of(case, "log-odds", *asked(case, "log-odds", 0.0))
    return row if is_true(row, "first") else None


def row_of(case: Case, design: Design, story: Story, beyond: bool) -> dict[str, str]:
    """A line of the table."""
    answers = [one for one in story.steps if isinstance(one, Answered)]
    first, last = story.first, story.last
    told = [" ".join(first.verdict), "; ".join(first.kinds), " ".join(last.verdict), "; ".join(last.kinds)]
    rest = [
        f"{story.further:.1f}",
        len(answers) - 1,
        story.ended,
        f"{max(a.seconds for a in answers):.1f}",
        int(beyond),
    ]
    return {name: str(value) for name, value in zip(COLUMNS, [*case, design, *told, *rest], strict=True)}


def is_true(row: dict[str, str], which: str) -> bool:
    """Whether an answer is the one true name, and nothing between two structures is open beside it."""
    kinds = row["open" if which == "first" else "left_open"].split("; ")
    return row[which] == row["effect"] and not {"set", "uncertain"} & set(kinds)


def share(rows: list[dict[str, str]]) -> str:
    """How many end in the one true name, with the 95 % range of the share."""
    hits = [is_true(one, "last") for one in rows]
    found = intervals.share(hits)
    return f"{sum(hits)} of {len(rows)} ({100 * (found.low or 0):.0f} to {100 * (found.high or 0):.0f} %)"


def page(rows: list[dict[str, str]], command: str) -> str:
    """The page."""
    by = {name: [one for one in rows if one["design"] == name] for name in ("log-odds", "random")}
    open_ = {one["seed"] for one in rows if not is_true(one, "first")}
    both = open_ & {one["seed"] for one in by["random"]}
    lines = ["# Motions that decide", "", f"`{command}`, mount-cosim {__version__}", ""]
    lines += [(__doc__ or "").split("\n\n")[2].strip(), ""]
    lines += [f"{len(by['log-odds'])} cases, {len(open_)} whose first answer is not the one true name. Of these:", ""]
    lines += ["| further motion | end in the one true name | mean s of motion | beyond a limit |", "|---|---|---|---|"]
    for name, some in by.items():
        mine = [one for one in some if one["seed"] in both]
        if mine:
            spent = np.mean([float(one["further_s"]) for one in mine])
            beyond = sum(int(one["beyond_a_limit"]) for one in mine)
            lines.append(f"| {name} | {share(mine)} | {spent:.0f} | {beyond} |")
    kept = [one for one in by["log-odds"] if one["seed"] not in open_ and float(one["further_s"])]
    if kept:
        lines += ["", f"Of {len(kept)} that went on though the first answer is the true name, {share(kept)} keep it."]
    shown = ("seed", "effect", "size", "stroke", "room", "design", "first", "open", "last", "left_open", "further_s")
    shown += ("rounds", "ended", "slowest_round_s")
    lines += ["", "| " + " | ".join(one.replace("_", " ") for one in shown) + " |", "|" + "---|" * len(shown)]
    lines += ["| " + " | ".join(one[name] or "-" for name in shown) + " |" for one in rows]
    return "\n".join([*lines, ""])


def main() -> None:
    """Run what is missing in the table, then write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=4100)
    parser.add_argument("--cases", type=int, default=12)
    parser.add_argument("--budget", type=float, default=60.0)
    parser.add_argument("--until", type=float, default=1e9, help="seconds after which no case is begun")
    parser.add_argument("--all", action="store_true", help="cases go on whose first answer is the true name, too")
    parser.add_argument("--out", type=Path, required=True)
    given, begun = parser.parse_args(), time.monotonic()
    given.out.mkdir(parents=True, exist_ok=True)
    table = given.out / "table.csv"
    rows = [*csv.DictReader(table.read_text("utf-8").splitlines())] if table.exists() else []
    for case in islice(cases(given.seed), given.cases):
        own = [one for one in rows if one["seed"] == str(case.seed)]
        mine = {one["design"] for one in own}
        for design in DESIGNS:
            if any(is_true(one, "first") for one in own):
                break
            if design in mine or time.monotonic() - begun > given.until:
                continue
            made = first_answer(case) if design == "log-odds" and not given.all else None
            made = made or row_of(case, design, *asked(case, design, given.budget))
            rows.append(made)
            with table.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, COLUMNS)
                writer.writeheader()
                writer.writerows(rows)
            print(*rows[-1].values(), sep=" | ", flush=True)
            if is_true(made, "first"):
                break
    command = f"python bench/investigate.py --seed {given.seed} --cases {given.cases} --out results/investigate"
    (given.out / "README.md").write_text(page(rows, command), "utf-8")


if __name__ == "__main__":
    main()
