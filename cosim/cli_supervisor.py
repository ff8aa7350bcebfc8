"""`cosim hardware alpaca`: the simulated mount as a telescope for programs of observatories."""

from math import radians
from pathlib import Path
from time import sleep
from typing import Annotated

import typer

from cosim.terminal import put, say


def alpaca(
    scenario: Annotated[str, typer.Argument(help='A scenario (.toml) with a signal of kind "star".')] = "two_axis",
    port: Annotated[int, typer.Option("--port", help="TCP port; 0: any free one.")] = 11111,
    address: Annotated[
        str, typer.Option("--address", help="0.0.0.0: every machine of the network may ask.")
    ] = "127.0.0.1",
    longitude: Annotated[float, typer.Option("--longitude", help="Of the site, degrees east.")] = 0.0,
    speed: Annotated[float, typer.Option("--speed", help="Simulated seconds a second.")] = 1.0,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Directory for the recording.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite what is there.")] = False,
) -> None:
    """Serve a simulated mount as an ASCOM Alpaca telescope until Ctrl-C; it starts parked."""
    from cosim.cli_cache import with_fmus
    from cosim.files import check_free
    from cosim.scenario import read_scenario
    from cosim.supervisor.alpaca import Server
    from cosim.supervisor.mount import SimulatedMount
    from cosim.supervisor.telescope import Telescope

    recording = out / "recording.parquet" if out else None
    if recording:
        check_free(recording, force)
    ready = with_fmus(read_scenario(scenario), say)
    mount = SimulatedMount(ready, speed=speed, recording=recording, force=force)
    with mount, Server(Telescope(mount, radians(longitude)), address, port) as server:
        put(f"http://{address}:{server.port}/api/v1/telescope/0")
        say("Ctrl-C ends it" if server.discovery else "Ctrl-C ends it; discovery is another program's here")
        while not mount.failure:
            sleep(0.2)
    say(mount.failure)
    raise typer.Exit(1)
