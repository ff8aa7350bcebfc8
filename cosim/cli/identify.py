"""`cosim identify`: recordings and a card to the same card with identified numbers."""

from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.cli.complete import cards
from cosim.cli.options import Columns, Force, Layout, Out, Units, default_out
from cosim.support.terminal import put, put_json, say, stage


def identify(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings of the axis.", metavar="RECORDING...")],
    card: Annotated[
        str, typer.Option("--card", help="Model card (.toml), or the name of a shipped one.", autocompletion=cards)
    ],
    out: Out = None,
    free: Annotated[
        list[str] | None, typer.Option("--free", help="A parameter to identify: sigma0, Fc, inertia ... [all]")
    ] = None,
    cut: Annotated[
        float | None, typer.Option("--cut", min=0.0, help="Slowest speed of the friction map [rad/s or m/s].")
    ] = None,
    keep_inertia: Annotated[
        bool, typer.Option("--keep-inertia/--drop-inertia", help="Friction map: tau - J q'', or tau alone.")
    ] = True,
    starts: Annotated[int, typer.Option("--starts", min=1, help="Starts of the output-error fit.")] = 4,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random starts.")] = 0,
    columns: Columns = None,
    units: Units = None,
    layout: Layout = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print identify.json instead of the summary.")] = False,
    force: Force = False,
) -> None:
    """Identify a card's numbers: friction map, presliding steps, output error in closed loop."""
    out = out or default_out(Path(recordings[0]).stem)
    from cosim.api.identify import identify as find
    from cosim.estimation.identify.deliver import check_out
    from cosim.reading import read_recordings
    from pyfmi_models.card import read_card

    check_out(out, force)
    believed = read_card(card)
    read = read_recordings(recordings, believed.columns, columns, units, believed.mount.motion, layout)
    seconds, several = sum(one.duration for one in read), "s" * (len(read) > 1)
    say(f"Read {len(read)} recording{several}, {seconds:.0f} s; card {believed.mount.name}")
    given: Any = {"free": free or (), "cut": cut, "keep_inertia": keep_inertia, "starts": starts, "seed": seed}
    with stage("identifying") as progress:
        done = find(read, believed, out, force=force, on_progress=progress.log, **given)
    if as_json:
        put_json(done.as_json())
    else:
        put(str(done))
        say(f"Wrote {out / 'card.toml'}, identify.json and the figures")
