"""`cosim hardware alpaca` and `indi`: the simulated mount as a telescope for programs of observatories."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from math import radians
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.terminal import put, say

if TYPE_CHECKING:
    from cosim.supervisor.mount import SimulatedMount
    from cosim.supervisor.telescope import Telescope

ScenarioArgument = Annotated[str, typer.Argument(help='A scenario (.toml) with a signal of kind "star".')]
AddressOption = Annotated[str, typer.Option("--address", help="0.0.0.0: every machine of the network may ask.")]
LongitudeOption = Annotated[float, typer.Option("--longitude", help="Of the site, degrees east.")]
SpeedOption = Annotated[float, typer.Option("--speed", help="Simulated seconds a second.")]
OutOption = Annotated[Path | None, typer.Option("--out", "-o", help="Directory for the recording.")]
ForceOption = Annotated[bool, typer.Option("--force", help="Overwrite what is there.")]


def alpaca(
    scenario: ScenarioArgument = "two_axis",
    port: Annotated[int, typer.Option("--port", help="TCP port; 0: any free one.")] = 11111,
    address: AddressOption = "127.0.0.1",
    longitude: LongitudeOption = 0.0,
    speed: SpeedOption = 1.0,
    out: OutOption = None,
    force: ForceOption = False,
) -> None:
    """Serve a simulated mount as an ASCOM Alpaca telescope until Ctrl-C; it starts parked."""
    from cosim.supervisor.alpaca import Server

    with ExitStack() as stack:
        mount, telescope = stack.enter_context(_telescope(scenario, longitude, speed, out, force))
        server = stack.enter_context(Server(telescope, address, port))
        put(f"http://{address}:{server.port}/api/v1/telescope/0")
        say("Ctrl-C ends it" if server.discovery else "Ctrl-C ends it; discovery is another program's here")
        _wait(mount)


def indi(
    scenario: ScenarioArgument = "two_axis",
    port: Annotated[int, typer.Option("--port", help="TCP port; 0: any free one.")] = 7624,
    address: AddressOption = "127.0.0.1",
    longitude: LongitudeOption = 0.0,
    speed: SpeedOption = 1.0,
    out: OutOption = None,
    force: ForceOption = False,
) -> None:
    """Serve a simulated mount as an INDI telescope until Ctrl-C; it starts parked."""
    from cosim.supervisor.indi import IndiServer

    with ExitStack() as stack:
        mount, telescope = stack.enter_context(_telescope(scenario, longitude, speed, out, force))
        server = stack.enter_context(IndiServer(telescope, address, port))
        put(f"{telescope.name}@{address}:{server.port}")
        say("Ctrl-C ends it")
        _wait(mount)


@contextmanager
def _telescope(
    scenario: str, longitude: float, speed: float, out: Path | None, force: bool
) -> "Iterator[tuple[SimulatedMount, Telescope]]":
    """Run the mount of a scenario and yield it with its telescope."""
    from cosim.cli_cache import with_fmus
    from cosim.files import check_free
    from cosim.scenario import read_scenario
    from cosim.supervisor.mount import SimulatedMount
    from cosim.supervisor.pointing import Pointing
    from cosim.supervisor.telescope import Telescope

    recording = out / "recording.parquet" if out else None
    if recording:
        check_free(recording, force)
    ready = with_fmus(read_scenario(scenario), say)
    with SimulatedMount(ready, speed=speed, recording=recording, force=force) as mount:
        yield mount, Telescope(Pointing(mount, radians(longitude)))


def _wait(mount: "SimulatedMount") -> None:
    """Wait until the simulation ends by itself, which is a failure."""
    while not mount.failure:
        sleep(0.2)
    say(mount.failure)
    raise typer.Exit(1)
