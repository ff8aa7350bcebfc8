"""`cosim investigate`: record, diagnose, and run the motions that decide what is open, until one answer is left."""

import re
from math import inf
from pathlib import Path
from typing import Annotated

import typer

from cosim.cli.complete import cards, scenarios
from cosim.cli.drive import KeyOption, machine_of
from cosim.cli.options import Force, Out, command_of, default_out
from cosim.support.errors import InputError
from cosim.support.terminal import put, put_json, say, stage

GROUP = "Diagnose"
EXAMPLES = (
    "cosim investigate sidereal --card paper_mount --machine axis.toml --budget 120s",
    "cosim investigate axis_scenario.toml --card axis.toml --limits speed=0.2 torque=20",
)


def investigate(
    scenario: Annotated[
        str, typer.Argument(help="Plant, controller, set point and columns (.toml).", autocompletion=scenarios)
    ],
    card: Annotated[str, typer.Option("--card", help="The model as believed.", autocompletion=cards)],
    out: Out = None,
    machine: Annotated[
        str,
        typer.Option("--machine", help="A card or plant FMU in the plant's place; of a --drive its file."),
    ] = "",
    drive: Annotated[str, typer.Option("--drive", help="udp://HOST:PORT: move a drive; needs --move.")] = "",
    key: KeyOption = "",
    move: Annotated[bool, typer.Option("--move", help="A drive may be moved.")] = False,
    budget: Annotated[str, typer.Option("--budget", help="Motion that may be spent: 300s, 5min.")] = "300s",
    seconds: Annotated[float, typer.Option("--seconds", help="Length of one motion [s].", min=8.0)] = 15.0,
    limits: Annotated[
        list[str] | None,
        typer.Option("--limits", help="SI, where not the scenario's: position=-0.5:0.5 speed=0.2 torque=20 ..."),
    ] = None,
    train: Annotated[list[Path] | None, typer.Option("--train", help="Recordings to go on from.")] = None,
    heldout: Annotated[list[Path] | None, typer.Option("--heldout", help="Recordings for validation.")] = None,
    seed: Annotated[int, typer.Option("--seed", help="Of the phases of many tones.", min=0)] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print story.json instead of its lines.")] = False,
    force: Force = False,
) -> None:
    """Ask the machine: record, diagnose, and run the motion that tells most, until one answer is left."""
    out = out or default_out(Path(scenario).stem)
    from cosim.reading import pairs_of
    from cosim_investigation.investigate import investigate as ask
    from cosim_investigation.log import PAGE
    from cosim_investigation.story import line_of

    words = {"--card": card, "--out": out, "--machine": machine, "--drive": drive, "--key": key, "--move": move}
    words |= {"--budget": budget, "--seconds": seconds, "--limits": limits, "--train": train, "--heldout": heldout}
    command = command_of("investigate", [scenario], words | {"--seed": seed})
    if drive and not move:
        raise InputError(f"--drive {drive} would move an axis; give --move to allow it.", culprit="--drive")
    moved = machine_of(machine or "virtual", drive, key) if drive else machine
    with stage("asking the machine") as progress:
        done = ask(
            *(scenario, card, out),
            machine=moved,
            budget=seconds_of(budget),
            seconds=seconds,
            limits=pairs_of("--limits", limits),
            train=tuple(train or ()),
            heldout=tuple(heldout or ()),
            seed=seed,
            force=force,
            on_progress=progress.tell,
            on_step=lambda step: progress.log(line_of(step)),
            command=command,
        )
    put_json(done.as_json()) if as_json else put(str(done))
    say(f"read {out / PAGE}")


def seconds_of(text: str) -> float:
    """Read a time: "300", "300s" or "5min" [s].

    Raises:
        InputError: it is none, or not above 0.
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(s|min|h)?", text.strip())
    value = float(found[1]) * {"s": 1, "min": 60, "h": 3600}[found[2] or "s"] if found else 0.0
    if not 0 < value < inf:
        raise InputError(f"--budget {text}: it is a time above 0, as 300s or 5min.", culprit="--budget", value=text)
    return value
