"""`cosim check`: does an FMU run here as its maker meant."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from cosim.cli.options import Force
from cosim.support.terminal import finish_stdout, put, put_json, say, stage


def check(
    fmu: Annotated[Path, typer.Argument(help="The FMU, also a third-party one.", metavar="FMU")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for check.json and pictures. [nothing is written]")
    ] = None,
    rtol: Annotated[float, typer.Option("--rtol", help="Allowed difference relative to the range.")] = 1e-4,
    interface: Annotated[str, typer.Option("--interface", help="co-simulation or model-exchange. [what it has]")] = "",
    timeout: Annotated[float, typer.Option("--timeout", help="Seconds that one experiment may take.")] = 60.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the check as JSON.")] = False,
    force: Force = False,
) -> None:
    """Run the experiments in an FMU's archive (FMI-LS-REF) and compare each variable; exit 1 if one fails."""
    from cosim.api.check import check as carry_out

    with stage(f"checking {fmu.name or fmu}") as progress:
        done = carry_out(
            fmu, out, rtol=rtol, interface=interface, timeout=timeout, force=force, on_progress=progress.log
        )
    put_json(done.as_json()) if as_json else put(str(done))
    if out:
        say(f"Wrote {', '.join(map(str, done.files.values()))}")
    if not done.passed:
        finish_stdout()
        sys.exit(1)
