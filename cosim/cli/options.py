"""Options that more than one verb has, and the command line that does the same again."""

import os
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from shlex import join
from typing import Annotated

import typer

from cosim.support.terminal import say

RESULTS = "cosim_out"
"""Folder of results whose own folder is not given."""

Columns = Annotated[
    list[str] | None, typer.Option("--columns", help="Our name = the file's: tau=force run3.csv:tau=current ...")
]
Units = Annotated[list[str] | None, typer.Option("--units", help="Units in the files: q=deg run3.csv:t=ms ...")]
Layout = Annotated[
    list[str] | None, typer.Option("--layout", help="How texts are written: decimal=comma header=4 period=1ms ...")
]
Out = Annotated[
    Path | None, typer.Option("--out", "-o", help="Folder for the results; cosim_out/NAME-n where it is not given.")
]
Cluster = Annotated[str, typer.Option("--cluster", help="Address of a Dask scheduler: tcp://host:8786.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite what is there.")]


def default_out(name: str) -> Path:
    """Return a folder that is not there yet, for results of `name`, and say so: cosim_out/NAME-1, -2, ..."""
    stem = "".join(c if c.isalnum() or c in "._-" else "_" for c in name).strip("._") or "results"
    free = (Path(os.environ.get("COSIM_OUT") or RESULTS) / f"{stem}-{k}" for k in count(1))
    found = next(path for path in free if not path.exists())
    say(f"results go to {found}")
    return found


def command_of(verb: str, arguments: Sequence[object], options: Mapping[str, object]) -> str:
    """The command line that does the same again.

    Args:
        verb: "diagnose", "hardware run".
        arguments: what stands before the options.
        options: by name; a list is an option given several times, True one without a value; None, False and "" are
            left out.
    """
    words = ["cosim", *verb.split(), *map(str, arguments)]
    for name, given in options.items():
        for value in given if isinstance(given, list) else [given]:
            if value is not None and value is not False and value != "":
                words += [name] if value is True else [name, str(value)]
    for folder in filter(None, os.environ.get("COSIM_PLUGINS", "").split(os.pathsep)):
        words += ["--plugins", folder]
    return join(words)
