"""`cosim hardware alpaca` and `indi`: the simulated mount as a telescope for programs of observatories."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from math import radians
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.cli.options import Force
from cosim.support.terminal import put, say

if TYPE_CHECKING:
    from cosim_observatory.mount import SimulatedMount
    from cosim_observatory.telescope import Telescope

Served = AbstractContextManager[tuple[str, str]]
"""A server that runs: where it is, and what else there is to say."""


def _command(kind: str, default: int, served: "Callable[[Telescope, str, int], Served]") -> Callable[..., None]:
    """Make the command that serves the simulated mount as a telescope of a kind, at a TCP port by default."""

    def command(
        scenario: Annotated[str, typer.Argument(help='A scenario (.toml) with a signal of kind "star".')] = "two_axis",
        port: Annotated[int, typer.Option("--port", help="TCP port; 0: any free one.")] = default,
        address: Annotated[
            str, typer.Option("--address", help="0.0.0.0: every machine of the network may ask.")
        ] = "127.0.0.1",
        longitude: Annotated[float, typer.Option("--longitude", help="Of the site, degrees east.")] = 0.0,
        speed: Annotated[float, typer.Option("--speed", help="Simulated seconds a second.")] = 1.0,
        out: Annotated[Path | None, typer.Option("--out", "-o", help="Directory for the recording.")] = None,
        force: Force = False,
    ) -> None:
        with ExitStack() as stack:
            mount, telescope = stack.enter_context(_telescope(scenario, longitude, speed, out, force))
            place, told = stack.enter_context(served(telescope, address, port))
            put(place)
            say(f"Ctrl-C ends it{told}")
            _wait(mount)

    command.__doc__ = f"Serve a simulated mount as an {kind} telescope until Ctrl-C; it starts parked."
    return command


@contextmanager
def _alpaca(telescope: "Telescope", address: str, port: int) -> Iterator[tuple[str, str]]:
    from cosim_observatory.alpaca import Server

    with Server(telescope, address, port) as server:
        found = "" if server.discovery else "; discovery is another program's here"
        yield f"http://{address}:{server.port}/api/v1/telescope/0", found


@contextmanager
def _indi(telescope: "Telescope", address: str, port: int) -> Iterator[tuple[str, str]]:
    from cosim_observatory.indi import IndiServer

    with IndiServer(telescope, address, port) as server:
        yield f"{telescope.name}@{address}:{server.port}", ""


alpaca = _command("ASCOM Alpaca", 11111, _alpaca)
indi = _command("INDI", 7624, _indi)


@contextmanager
def _telescope(
    scenario: str, longitude: float, speed: float, out: Path | None, force: bool
) -> "Iterator[tuple[SimulatedMount, Telescope]]":
    """Run the mount of a scenario and yield it with its telescope."""
    from cosim.models.cache import with_fmus
    from cosim.support.files import check_free
    from cosim.system.scenario import read_scenario
    from cosim_observatory.mount import SimulatedMount
    from cosim_observatory.pointing import Pointing
    from cosim_observatory.telescope import Telescope

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
