"""Attacks on what moves or is simulated: limits and motions of an investigation, and FMUs that fail as they run."""

import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from attack_mutations import NUMBERS, of_text
from attack_targets import Yard
from attack_worker import Ended
from investigations import BELIEVED, CABLE

import cosim_investigation.investigate  # noqa: F401  what is loaded here need not be loaded in each fork
from cosim.cli import main
from cosim_investigation.loop import Investigation

Command = list[object]
NAMES = ("position", "speed", "acceleration", "torque", "frequency", "forbidden", "jerk")
ENDS = ("-0.5:0.5", "-1.5:1.5", "0:1", "1:0", "0.2:0.3", "5:5", "-inf:inf", "nan:1", "0:1e-300", ":", "1:2:3")
SIZES = ("1", "0.5", "3", "20", "0.2", "1e-3", "1e-9", "1e11")
FAILS, WELL = (2, 3, 4, 11, 12, 14, 15, 16), (0, 1, 13, 17, 18)
"""What a step may end with: what must end a run with a sentence, and what need not."""

LAST, ROWS = 0.0499, 25
"""Where the last step ends [s], and rows of the whole run."""


class _Reached(SystemExit):
    """The first motion would run now."""


def investigation(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """Limits, budget and seconds as options; the scenario as text, spoilt in one of three."""
    limits = [f"{dice.choice(NAMES)}={dice.choice([*ENDS, *SIZES, *NUMBERS])}" for _ in range(dice.randrange(4))]
    options = [part for one in limits for part in ("--limits", one)]
    if dice.random() < 0.6:
        options += ["--budget", dice.choice(["300s", "5min", "20", "31", "45s", "1e9", "-1", *NUMBERS])]
    if dice.random() < 0.6:
        options += ["--seconds", dice.choice(["15", "8", "10", "1e6", *NUMBERS])]
    text = raw.partition(b"\n")[2]
    how, text = of_text(dice, text) if dice.random() < 0.33 else ("options", text)
    kept = [one.replace("\x00", "") for one in options]
    return f"{how} {' '.join(kept)}"[:80], json.dumps(kept).encode() + b"\n" + text


def investigated(folder: Path, file: Path, dice: Random) -> Callable[[], None]:
    """Begin an investigation; the first motion is judged by the limits that were given, and is not run."""

    def begin() -> None:
        head, _, text = file.read_bytes().partition(b"\n")
        options = json.loads(head)
        for name, content in (("card.toml", BELIEVED), ("machine.toml", BELIEVED + CABLE)):
            (folder / name).write_text(content)
        (folder / "scenario.toml").write_bytes(text.replace(b"CARD", str(folder / "card.toml").encode()))
        given = [("--card", folder / "card.toml"), ("--machine", folder / "machine.toml"), ("--out", folder / "out")]
        Investigation.run = _judged(options)  # type: ignore[method-assign]
        main(["investigate", str(folder / "scenario.toml"), *(str(part) for pair in given for part in pair), *options])

    return begin


def _judged(options: list[str]) -> Callable[..., str]:
    """What is called where the first motion would run: does it keep the limits that stand in the options?"""

    def run(self: Investigation, motion: Any, *_: Any) -> str:
        q, v, a = motion.sampled(np.linspace(0.0, motion.seconds, 4001))
        most = {"speed": np.abs(v).max(), "acceleration": np.abs(a).max()}
        given = dict(one.split("=", 1) for one in options if "=" in one)
        for name, value in most.items():
            if name in given and value > float(given[name]) * (1 + 1e-6):
                raise AssertionError(f"{name} {value} beyond {given[name]}")
        if "position" in given:
            low, high = map(float, given["position"].split(":"))
            place = q + self.machine.home
            if place.min() < low - 1e-9 or place.max() > high + 1e-9:
                raise AssertionError(f"position {place.min()} .. {place.max()} beyond {low} .. {high}")
        print(json.dumps({"motion": motion.title, "seconds": motion.seconds}))
        raise _Reached(0)

    return run


def behaviour(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """How an FMU behaves: of which FMI, from when on and how it fails, in a process of its own or not."""
    version, status = dice.choice((2, 3)), dice.choice([*FAILS, *WELL])
    numbers = {"status": status, "mode": dice.choice((0, 1, 2))}
    numbers[dice.choice(("fail_at", "nan_at"))] = dice.choice((0.0, 1e-3, 0.0201, 0.0499, 0.05, 1.0))
    told = {"version": version, "numbers": numbers, "isolate": status in (*FAILS[3:], 13) or dice.random() < 0.3}
    return json.dumps(told)[:80], json.dumps(told).encode()


def behaving(yard: Yard) -> Callable[[Path, Path, Random], Command]:
    """Run the loop of the yard with an FMU that behaves as the file says."""

    def command(folder: Path, file: Path, dice: Random) -> Command:
        told = json.loads(file.read_bytes())
        inside = ", ".join(f"{name} = {float(value)}" for name, value in told["numbers"].items())
        fmu = f'fmu = "{yard.fmus[3]}"'
        text = yard.scenario.replace(fmu, f'fmu = "{yard.fmus[told["version"]]}"\nparameters = {{ {inside} }}', 1)
        (folder / "scenario.toml").write_text(text)
        apart = "--isolate" if told["isolate"] else "--no-isolate"
        return ["run", folder / "scenario.toml", "--out", folder / "out", "--no-page", "--call-timeout", 1, apart]

    return command


def failed_or_whole(folder: Path, ended: Ended, file: Path, good: bytes) -> bool:
    """A run in which a step failed, or a number is none, is no success; any other has all of its rows."""
    import pyarrow.parquet as pq

    told = json.loads(file.read_bytes())["numbers"]
    fails = told.get("fail_at", 1.0) < LAST and told["status"] in FAILS
    no_number = told.get("nan_at", 1.0) < LAST and told["mode"] < 2  # what is computed when it is read is a number
    table = pq.read_table(folder / "out" / "recording.parquet").to_pandas()
    whole = len(table) >= ROWS or told["status"] in (17, 18)
    return not fails and not no_number and whole and bool(np.isfinite(table.to_numpy(float)).all())
