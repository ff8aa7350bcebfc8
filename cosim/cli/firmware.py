"""`cosim hardware firmware`: the controller of a card as a small C project."""

from dataclasses import asdict
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.cli.options import Force, Out, default_out
from cosim.support.terminal import put, put_json, say

if TYPE_CHECKING:
    from pyfmi_models.card import Card

INPUT, OUTPUT = "q", "tau"


def firmware(
    card: Annotated[str, typer.Argument(help="A model card (.toml), or the name of a shipped one: paper_mount.")],
    out: Out = None,
    target: Annotated[str, typer.Option("--target", help="cortex-a9 or host.")] = "cortex-a9",
    as_json: Annotated[bool, typer.Option("--json", help="Print stack and memory as JSON.")] = False,
    force: Force = False,
) -> None:
    """Write the controller of a card as a small C project without a heap; print what stack and memory it takes."""
    out = out or default_out(Path(card).stem)
    from cosim.support.files import check_free, directory
    from pyfmi_models.card import read_card
    from pyfmi_models.export.firmware import firmware as project_of
    from pyfmi_models.export.firmware import target_of

    read, machine = read_card(card), target_of(target)
    model, quantum = read.controller_model(), quantum_of(read)
    origin = f"cosim hardware firmware {card} --target {target} --out {out}"
    project = project_of(model, machine, encoder=INPUT, quantum=quantum, command=OUTPUT, origin=origin)
    for name in project.files:
        check_free(out / name, force)
    project.write(directory(out))
    size = asdict(project.size)
    say(f"Build it with a line of {out / 'README.md'}; fill in {out / 'hal.h'} for a board")
    if as_json:
        put_json(size | {"target": target, "project": str(out)})
    else:
        put("stack {stack}, code {code}, constants {constants}, variables {variables} bytes".format(**size))


def quantum_of(card: "Card") -> float:
    """Return the angle [rad], or the way [m] of a linear axis, that one count of the encoder stands for.

    Raises:
        CardError: the card does not say how many counts there are.
    """
    from pyfmi_models.errors import CardError

    counts = card.encoder.counts_per_rev * card.encoder.ratio
    if not counts:
        raise CardError(f"{card.path}: [encoder] counts_per_rev is missing; a firmware reads counts.")
    return (2 * pi if card.mount.motion == "rotary" else 1.0) / counts
