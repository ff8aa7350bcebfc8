"""`cosim compare`: runs and recordings over each other."""

from pathlib import Path
from typing import Annotated

import typer

from cosim.cli.options import Columns, Force, Out, Units, default_out
from cosim.support.terminal import put, put_json, say


def compare(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings, or folders of runs.", metavar="A B ...")],
    out: Out = None,
    columns: Columns = None,
    units: Units = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print compare.json instead of the summary.")] = False,
    force: Force = False,
) -> None:
    """Lay runs and recordings over each other: overlay, difference, RMS and largest difference of each column."""
    out = out or default_out("_".join(one.stem for one in recordings[:2]))
    from cosim.api.compare import compare as lay_over
    from cosim.reading import pairs_of

    done = lay_over(
        *recordings,
        out=out,
        columns=pairs_of("--columns", columns),
        units=pairs_of("--units", units),
        force=force,
    )
    put_json(done.as_json()) if as_json else put(str(done))
    say(f"Wrote {out / 'compare.html'}, compare.json and compare.svg")
