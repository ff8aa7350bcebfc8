"""`cosim sweep`: one scenario many times, to one table and its picture."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from cosim.cli.options import command_of
from cosim.support.terminal import messages, put, put_json, say, stage

PAUSE = 10.0
"""Seconds between two lines of progress where there is no terminal."""


def sweep(
    file: Annotated[Path, typer.Argument(help="What is varied and what is kept (.toml).", metavar="SWEEP")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the table; one begun there is continued.")],
    cluster: Annotated[str, typer.Option("--cluster", help="Address of a Dask scheduler: tcp://host:8786.")] = "",
    workers: Annotated[int | None, typer.Option("--workers", help="Processes; the cores of this machine.")] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Run again what failed.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Start over, whatever is there.")] = False,
) -> None:
    """Run a scenario many times; write DIR/table.parquet, a row a run, and DIR/sweep.svg, its picture."""
    from cosim.models.cache import with_fmus
    from cosim.sweep import conduct, read_sweep
    from cosim.system.scenario import read_scenario

    wanted = read_sweep(file)
    ready = with_fmus(read_scenario(wanted.scenario), say)
    title = f"{ready.name}: {wanted.design.runs:,} runs of {ready.stop:g} s"
    try:
        with _reporting(title) as on_progress:
            done = conduct(
                wanted,
                ready,
                out,
                workers=workers,
                address=cluster,
                force=force,
                retry=retry,
                on_progress=on_progress,
                command=command_of("sweep", [file], {"--out": out, "--cluster": cluster}),
            )
    except KeyboardInterrupt:
        say(f"what was done until then is in {out / 'table.parquet'}; the same command goes on from there")
        raise
    facts = asdict(done) | {"table": str(done.table), "picture": _picture(done.table)}
    say(_sentence(facts))
    if as_json:
        put_json(facts)
    else:
        put(facts["table"])


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


def _picture(table: Path) -> str:
    from cosim.plots.sweep import draw

    return str(draw(table, table.with_name("sweep.svg")))


def _sentence(facts: dict[str, object]) -> str:
    before = f", {facts['found']:,} of them done before" if facts["found"] else ""
    failed = f"; {facts['failed']:,} came to nothing, the table says why" if facts["failed"] else ""
    return f"{facts['runs']:,} runs{before}, {facts['seconds']:.3g} s{failed}; picture: {facts['picture']}"
