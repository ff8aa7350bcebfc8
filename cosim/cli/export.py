"""`cosim export`: a card to FMUs."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from cosim.cli.complete import cards
from cosim.cli.options import Force, Out, default_out
from cosim.support.terminal import put, put_json, say, stage


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
    modelica_flange: Annotated[bool, typer.Option("--modelica-flange", help="Also with flanges, acausal.")] = False,
    c: Annotated[bool, typer.Option("--c", help="Also write the plant as plain C99.")] = False,
    mujoco: Annotated[bool, typer.Option("--mujoco", help="Also write the joint for MuJoCo.")] = False,
    urdf: Annotated[bool, typer.Option("--urdf", help="Also write the joint as URDF.")] = False,
    isaac: Annotated[bool, typer.Option("--isaac", help="Also write the joint for Isaac Sim.")] = False,
    as_fmu: Annotated[bool, typer.Option("--as-fmu", help="CARD is a scenario or SSP: make one FMU of it.")] = False,
    recording: Annotated[
        Path | None, typer.Option("--recording", help="Measure along it what a simulator cannot hold.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print paths and tables as JSON.")] = False,
    force: Force = False,
) -> None:
    """Write the plant of a card and, where it has one, its controller as FMUs; also for other simulators."""
    out = out or default_out(Path(card).stem)
    from cosim.api.export import kinds_of, planned, system_as_fmu

    asked = {"ssp": ssp, "modelica": modelica, "modelica_flange": modelica_flange, "c": c}
    kinds = kinds_of(**asked, mujoco=mujoco, urdf=urdf, isaac=isaac)
    if as_fmu:
        done = system_as_fmu(card, out, VERSIONS[fmi], platform, force, kinds, say)
        put_json(done.as_json()) if as_json else put(str(done))
        return
    plan = planned(card, out, VERSIONS[fmi], platform, force, kinds, recording)
    with stage(f"{Path(card).stem}: {len(plan.archives)} FMUs") as progress:
        done = plan.write(progress)
    put_json(done.as_json()) if as_json else put(str(done))
