"""`cosim card`: recordings to a first card."""

from pathlib import Path
from typing import Annotated

import typer

from cosim.cli.options import Columns, Force, Layout, Units, default_out
from cosim.support.terminal import put, put_json, say, stage


def card(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings of one axis.", metavar="RECORDING...")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The card (.toml); cosim_out/NAME-n/card.toml where not given.")
    ] = None,
    motion: Annotated[str, typer.Option("--motion", help="rotary or linear, where no unit says it.")] = "",
    inertia: Annotated[
        float | None, typer.Option("--inertia", help="Known inertia [kg m2] or mass [kg].", min=1e-12)
    ] = None,
    columns: Columns = None,
    units: Units = None,
    layout: Layout = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON.")] = False,
    force: Force = False,
) -> None:
    """Estimate a first card from recordings: inertia, friction, constant torque and weight, with ranges."""
    from cosim.api.card import card as estimate
    from cosim.reading import read_recordings
    from cosim.support.files import check_free, directory

    file = out or default_out(recordings[0].stem) / "card.toml"
    check_free(file, force)
    read = read_recordings(recordings, {}, columns, units, motion, layout)
    with stage("estimating a card") as progress:
        done = estimate(read, motion=motion, inertia=inertia, on_progress=progress.log)
    directory(file.parent)
    done.write(file, force)
    put_json(done.as_json()) if as_json else put(str(done))
    say(f"Wrote {file}; a diagnosis takes it with --card {file}")
