"""`cosim prove`: how often the diagnosis finds physics that was concealed from it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from cosim.cli.options import Out, default_out
from cosim.support.terminal import put, put_json, say, stage

GROUP = "Prove"
EXAMPLES = ("cosim prove --cases 10 --out proof", "cosim prove --seed 7 --workers 2")


def prove(
    out: Out = None,
    cases: Annotated[int, typer.Option("--cases", help="Cases in all.")] = 60,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the benchmark.")] = 1,
    seconds: Annotated[float, typer.Option("--seconds", help="Length of each recording [s].")] = 60.0,
    workers: Annotated[
        int | None, typer.Option("--workers", help="Cases at a time; the cores of this machine.")
    ] = None,
    purpose: Annotated[
        str, typer.Option("--purpose", help="scoring, or tuning: whether the code may be shaped by it.")
    ] = "scoring",
    decks: Annotated[
        Path | None,
        typer.Option("--decks", help="List of benchmarks to which this one is added, for example decks.md."),
    ] = None,
    rough: Annotated[
        bool, typer.Option("--rough", help="Machines that are not quite what equations say of them.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print proof.json instead of the scores.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Start over, whatever is there.")] = False,
) -> None:
    """Blind benchmark: hide effects in simulated recordings, diagnose, open what was sealed, score against the bars."""
    out = out or default_out("prove")
    from cosim_studies.proof.conduct import Benchmark, check, code, conduct
    from cosim_studies.proof.ledger import enlist

    benchmark = Benchmark(seed, cases, seconds, rough)
    check(benchmark, workers)
    if decks is not None:
        enlist(decks, benchmark.generator, seed, cases, purpose, code())
    command = f"cosim prove --cases {cases} --seed {seed} --seconds {seconds:g}{' --rough' * rough} --out {out}"
    try:
        with _reporting(f"{cases} concealed cases") as on_progress:
            found = conduct(
                benchmark, out, workers=workers, force=force, on_seal=say, on_progress=on_progress, command=command
            )
    except KeyboardInterrupt:
        say(f"what was done until then is scored in {out / 'README.md'}; the same command goes on from there")
        raise
    if as_json:
        put_json(found)
    else:
        head = f"{'score':<64} {'value [95 % range]':<22} {'target':<8} result"
        put("\n".join([head, *(_line(score) for score in found["scores"])]))
    say(f"read {out / 'README.md'}")


@contextmanager
def _reporting(title: str) -> Iterator[Callable[[int, int, str], None]]:
    """Yield what tells the progress: a bar on a terminal, and for each case a line with the time to go."""
    with stage(title) as bar:
        begun, before = time.monotonic(), -1

        def on_progress(done: int, of: int, last: str) -> None:
            nonlocal before
            before = done - 1 if before < 0 else before
            bar(done, of)
            left = (of - done) * (time.monotonic() - begun) / (done - before)
            say(f"{last}; {done} of {of}, about {left:.0f} s left")

        yield on_progress


def _line(score: dict[str, object]) -> str:
    """One score on one line."""
    from cosim_studies.proof.page import estimate, met

    return f"{score['title']:<64} {estimate(score):<22} {score['asked']:<8} {met(score, 'missed')}".rstrip()
