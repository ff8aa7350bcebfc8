"""Copies of measured recordings, each with one mistake that happens: does the tool say which, or invent physics?

    python bench/corrupted.py --data FOLDER --out results/measured

Every copy is diagnosed in a process of its own; one that takes longer than `LONGEST` is ended and counts as no answer.
`right` are the findings of `sanity` (or words of the refusal) of which one must be said. Writes corrupted.md.
"""

import argparse
import multiprocessing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from measured import Machine, _read, machines

from cosim.delivery.deliver import as_json
from cosim.diagnosis.diagnose import diagnose
from cosim.support.errors import CosimError
from cosim.support.files import replacing
from cosim.support.version import __version__
from pyfmi_models.card import parse_card

LONGEST = 900.0
"""Seconds for one copy."""
GEAR = 6.0
LATE = 0.02
"""Seconds by which the position trails in one of the copies."""
MACHINES = ("pendulum, quasi-direct drive", "brushless motor, one turn a second")


@dataclass(frozen=True)
class Copy:
    """One mistake: what is done to every recording, and what must be said of it."""

    name: str
    change: Callable[[pd.DataFrame], pd.DataFrame]
    right: tuple[str, ...]


def scaled(**factors: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """Multiply columns."""
    return lambda table: table.assign(**{name: factor * table[name] for name, factor in factors.items()})


def late(table: pd.DataFrame) -> pd.DataFrame:
    """The position of `LATE` seconds ago in every row."""
    return table.assign(q=np.interp(table.t - LATE, table.t, table.q))


def misread(table: pd.DataFrame) -> pd.DataFrame:
    """One false reading of the encoder."""
    q = table.q.to_numpy(copy=True)
    q[424] = -3.14
    return table.assign(q=q)


COPIES = (
    Copy("as recorded", lambda table: table, ()),
    Copy("sign of the torque", scaled(tau=-1.0), ("torque_sign",)),
    Copy("time in ms", scaled(t=1e3), ("time_unit",)),
    Copy("torque in mN m", scaled(tau=1e3), ("torque_scale",)),
    Copy("encoder counts doubled", scaled(q=2.0), ("position_scale", "gear_ratio")),
    Copy("gear of 6 forgotten", scaled(q=GEAR), ("gear_ratio", "position_scale")),
    Copy("position 20 ms late", late, ("clocks",)),
    Copy("one false reading", misread, ("single_readings",)),
)


def copies(machine: Machine, folder: Path) -> Iterator[tuple[Copy, Machine]]:
    """A machine with each mistake in all of its recordings; the pendulum also held out with another weight."""
    for copy in COPIES:
        tables = (
            {name: copy.change(table) for name, table in part.items()} for part in (machine.train, machine.heldout)
        )
        train, held = tables
        yield copy, replace(machine, train=train, heldout=held)
    other = folder / "quasi_direct_pendulum" / "es1kg.parquet"
    if machine.name.startswith("pendulum") and other.exists():
        copy = Copy("held out with another weight", lambda table: table, ("other_machine",))
        yield copy, replace(machine, heldout={"es1kg": pd.read_parquet(other)})


def rows(data: Path, longest: float = LONGEST) -> Iterator[dict[str, str]]:
    """One row a copy: what is said, and whether it is right."""
    for machine in machines(data):
        if machine.name in MACHINES:
            for copy, broken in copies(machine, data):
                yield {"machine": machine.name, "copy": copy.name} | judged(copy, asked(broken, longest))


def judged(copy: Copy, said: Mapping[str, Any]) -> dict[str, str]:
    """What was said, in short, beside what should have been."""
    told = [str(one["finding"]) for one in said.get("sanity", ())]
    refusal = str(said.get("refused", ""))
    hit = any(word in told or word.replace("_", " ") in refusal for word in copy.right)
    answer = refusal or str(said.get("ended", "")) or " + ".join(said["verdict"]) or "none"
    spoken = {True: "yes", False: "**no**"}[hit] if copy.right else ""
    return {"should say": " or ".join(copy.right), "warned": ", ".join(told), "answered": answer, "right": spoken}


def asked(machine: Machine, longest: float) -> dict[str, Any]:
    """Diagnose in a process of its own: {"verdict", "sanity"}, {"refused": why} or {"ended": why}."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_ask, args=(machine, there))
    process.start()
    there.close()
    try:
        if not here.poll(longest):
            return {"ended": f"no answer within {longest:.0f} s"}
        return dict(here.recv())
    except EOFError:
        return {"ended": "the process ended without an answer"}
    finally:
        process.kill()
        process.join()


def _ask(machine: Machine, there: Connection) -> None:
    import tempfile

    card = parse_card(machine.card, "card.toml")
    try:
        with tempfile.TemporaryDirectory() as folder:
            train, held = (_read(machine, tables, Path(folder)) for tables in (machine.train, machine.heldout))
        found = as_json(diagnose(train, held, card).diagnosis)
        there.send({"verdict": found["verdict"], "sanity": found["sanity"]})
    except CosimError as error:
        there.send({"refused": str(error)})
    except Exception as error:  # a traceback is what the table must show
        there.send({"ended": f"traceback: {type(error).__name__}: {error}"})


UNTOLD = (
    "What no balance of torques tells: the pendulum of 1 kg swings nearly free, and a free swing is the same with any "
    "weight; the motor turns one way at constant speeds, where no acceleration, stop or return dates the position or "
    "gives its scale (a gear or another count changes the orders of the cogging alone, which are not known before)."
)
"""Why copies may pass."""


def page(found: list[dict[str, str]], command: str) -> str:
    """The table for people."""
    head = list(found[0])
    right = sum(row["right"] == "yes" for row in found)
    of = sum(bool(row["right"]) for row in found)
    lines = [
        "# Corrupted copies of measured recordings",
        "",
        f"    {command}",
        "",
        f"mount-cosim {__version__}. One mistake in every recording of a copy; "
        f"{right} of {of} are warned about in the right words.",
        "",
        "| " + " | ".join(head) + " |",
        "|" + " --- |" * len(head),
        *("| " + " | ".join(row.values()) + " |" for row in found),
        "",
        UNTOLD,
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Diagnose all copies and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the measured recordings")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    found = []
    for row in rows(given.data):
        print(" | ".join(row.values()), flush=True)
        found.append(row)
    if not found:
        print(f"skipped: {given.data} holds none of the machines")
        return
    given.out.mkdir(parents=True, exist_ok=True)
    text = page(found, "python bench/corrupted.py --data FOLDER --out results/measured")
    with replacing(given.out / "corrupted.md", force=True) as partial:
        partial.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
