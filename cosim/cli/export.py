"""`cosim export`: a card to FMUs."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from cosim.cli.complete import cards
from cosim.cli.options import Force, Out, default_out
from cosim.support.terminal import put, put_json, stage


class Fmi(StrEnum):
    """FMI versions to export."""

    two = "2"
    three = "3"
    both = "both"


VERSIONS: dict[Fmi, Literal[2, 3, "both"]] = {Fmi.two: 2, Fmi.three: 3, Fmi.both: "both"}


def export(
    card: Annotated[
        str,
        typer.Argument(help="A model card (.toml), or the name of a shipped one: paper_mount.", autocompletion=cards),
    ],
    out: Out = None,
    fmi: Annotated[Fmi, typer.Option("--fmi", help="FMI version.")] = Fmi.both,
    platform: Annotated[str, typer.Option("--platform", help="host, all, or names with commas between.")] = "host",
    ssp: Annotated[bool, typer.Option("--ssp", help="Also wire plant, controller and a set point: NAME.ssp.")] = False,
    modelica: Annotated[bool, typer.Option("--modelica", help="Also write the plant as Modelica text.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the paths as JSON.")] = False,
    force: Force = False,
) -> None:
    """Write the plant of a card and, where it has one, its controller as FMUs."""
    out = out or default_out(Path(card).stem)
    from cosim.api.export import planned

    plan = planned(card, out, VERSIONS[fmi], platform, ssp, modelica, force)
    with stage(f"{Path(card).stem}: {len(plan.archives)} FMUs") as progress:
        done = plan.write(progress)
    others = {"ssp": done.ssp, "modelica": done.modelica}
    if as_json:
        put_json({"fmus": list(map(str, done.fmus))} | {kind: str(path) for kind, path in others.items() if path})
    else:
        put(str(done))
