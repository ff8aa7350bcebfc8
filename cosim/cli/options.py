"""Options that more than one verb has, and the command line that does the same again."""

import os
from itertools import count
from pathlib import Path
from typing import Annotated

import typer

from cosim.support.command import command_of
from cosim.support.terminal import say_once_begun

__all__ = ["Cluster", "Columns", "Force", "Layout", "Out", "Units", "command_of", "default_out", "results"]
RESULTS = "cosim_out"
"""Folder of results whose own folder is not given."""

Columns = Annotated[
    list[str] | None, typer.Option("--columns", help="Our name = the file's: tau=force run3.csv:tau=current ...")
]
Units = Annotated[list[str] | None, typer.Option("--units", help="Units in the files: q=deg run3.csv:t=ms ...")]
Layout = Annotated[list[str] | None, typer.Option("--layout", help="CSV format: decimal=comma header=4 period=1ms ...")]
Out = Annotated[
    Path | None, typer.Option("--out", "-o", help="Folder for the results; cosim_out/NAME-n where it is not given.")
]
Cluster = Annotated[str, typer.Option("--cluster", help="Address of a Dask scheduler: tcp://host:8786.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite what is there.")]


def results() -> Path:
    """Return the folder of results whose own folder is not given."""
    return Path(os.environ.get("COSIM_OUT") or RESULTS)


def default_out(name: str) -> Path:
    """Return a folder that is not there yet, for results of `name`, said once work begins: cosim_out/NAME-1, ..."""
    stem = "".join(c if c.isalnum() or c in "._-" else "_" for c in name).strip("._") or "results"
    free = (results() / f"{stem}-{k}" for k in count(1))
    found = next(path for path in free if not path.exists())
    say_once_begun(f"results go to {found}")
    return found
