"""Options that more than one verb has."""

from typing import Annotated

import typer

Columns = Annotated[
    list[str] | None, typer.Option("--columns", help="Our name = the file's: tau=force run3.csv:tau=current ...")
]
Units = Annotated[list[str] | None, typer.Option("--units", help="Units in the files: q=deg run3.csv:t=ms ...")]
Layout = Annotated[
    list[str] | None, typer.Option("--layout", help="How texts are written: decimal=comma header=4 period=1ms ...")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite what is there.")]
