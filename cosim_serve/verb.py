"""`cosim serve`: the local page."""

from pathlib import Path
from typing import Annotated

import typer

from cosim.support.errors import MissingPackageError
from cosim.support.extras import install
from cosim.support.terminal import put, say

GROUP = "Machine"
EXAMPLES = ("cosim serve", "cosim serve --port 8123 --no-browser")


def serve(
    port: Annotated[int, typer.Option("--port", min=0, max=65_535, help="Port on 127.0.0.1; 0: any that is free.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    data: Annotated[
        Path | None, typer.Option("--data", help="Folder of what was diagnosed; by default the user's own.")
    ] = None,
) -> None:
    """Open a page on this machine: drop recordings and a card, get the report. Nothing is uploaded anywhere."""
    try:
        from cosim_serve.door import show
        from cosim_serve.folder import open_to
        from cosim_serve.server import serve as run
    except ModuleNotFoundError as error:
        text = f"cosim serve needs the package {error.name}: {install('serve')}"
        raise MissingPackageError(text) from error
    from platformdirs import user_data_path

    home = data or user_data_path("mount-cosim") / "serve"

    def ready(address: str, file: Path | None) -> None:
        if others := open_to(home):
            say(f"{home} can be entered by {others}, and stays so; each diagnosis in it is closed to them.")
        put(address)
        say("This address holds the key to the page: keep it to yourself. Ctrl-C ends it.")
        if browser and file is not None:
            show(file)

    run(home, port, ready)
