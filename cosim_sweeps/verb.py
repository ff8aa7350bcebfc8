"""`cosim sweep`: one scenario many times, to one table and its picture."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from cosim.cli.options import Cluster, Out, command_of, default_out
from cosim.support.terminal import messages, put, put_json, say, stage

GROUP = "Simulate"
EXAMPLES = ("cosim sweep gains.toml", "cosim sweep gains.toml --workers 4 --out gains")
PAUSE = 10.0
"""Seconds between two lines of progress where there is no terminal."""


def sweep(
    file: Annotated[Path, typer.Argument(help="What is varied and what is kept (.toml).", metavar="SWEEP")],
    out: Out = None,
    cluster: Cluster = "",
    workers: Annotated[int | None, typer.Option("--workers", help="Processes; the cores of this machine.")] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Run again what failed.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Start over, whatever is there.")] = False,
) -> None:
    """Run a scenario many times; write DIR/table.parquet, a row a run, and DIR/sweep.svg, its picture."""
    out = out or default_out(file.stem)
    from cosim_sweeps.file import read_sweep
    from cosim_sweeps.front import sweep as conduct

    title = f"{file.stem}: {read_sweep(file).design.runs:,} runs"
    command = command_of("sweep", [file], {"--out": out, "--cluster": cluster})
    try:
        with _reporting(title) as on_progress:
            done = conduct(
                file,
                out,
                workers=workers,
                cluster=cluster,
                retry=retry,
                force=force,
                command=command,
                on_progress=on_progress,
                on_build=say,
            )
    except KeyboardInterrupt:
        say(f"what was done until then is in {out / 'table.parquet'}; the same command goes on from there")
        raise
    for line in str(done).splitlines():
        say(line)
    if as_json:
        put_json(asdict(done.summary) | {"table": str(done.table), "picture": str(done.picture), "best": done.best})
    else:
        put(str(done.table))


@contextmanager
def _reporting(title: str) -> Iterator[Callable[[int, int, int], None]]:
    """Yield what tells the progress: a bar on a terminal, a line now and then elsewhere."""
    with stage(title) as bar:
        lines = not messages().is_terminal
        last, before = time.monotonic(), 0

        def on_progress(done: int, of: int, failed: int) -> None:
            nonlocal last, before
            bar(done, of)
            if lines and time.monotonic() - last > PAUSE:
                rate = (done - before) / (time.monotonic() - last)
                lost = f", {failed:,} without result" if failed else ""
                say(f"{done:,} of {of:,} runs{lost}, about {(of - done) / rate:.0f} s left")
                last, before = time.monotonic(), done

        yield on_progress
