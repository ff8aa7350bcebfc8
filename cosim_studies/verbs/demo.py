"""`cosim demo`: the whole chain on an embedded example."""

import time
from pathlib import Path
from typing import Annotated

import typer

from cosim.support.memory import keep_freed_memory
from cosim.support.terminal import put, say, stage

GROUP = "Diagnose"
EXAMPLES = ("cosim demo", "cosim demo --out mine --force")


def demo(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for everything the demo makes.")] = Path(
        "cosim_demo"
    ),
    force: Annotated[bool, typer.Option("--force", help="Overwrite an earlier demo.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also print how exact the integration inside the FMU is.")
    ] = False,
) -> None:
    """Export FMUs, co-simulate, diagnose recordings of a machine with effects its card lacks, write the better FMU."""
    from cosim.report.terminal import summary
    from cosim.support.files import check_free
    from cosim_studies.demo import TABLE, run_demo

    keep_freed_memory()
    check_free(out, force)
    started = time.perf_counter()
    with stage("cosim demo: recordings of a mount with effects that its card lacks") as progress:
        done = run_demo(out, f"cosim demo --out {out}", progress.tell)
    put(summary(done.diagnosis, out=out / "diagnosis"))
    put(
        f"\nClosed loop on the set point of the validation run, RMS of simulated minus recorded torque [N·m]:\n"
        f"{done.before.torque:.3g} with the card's FMU, {done.after.torque:.3g} with the improved one"
    )
    if verbose:
        put(f"\n{done.table}")
    say(f"{time.perf_counter() - started:.1f} s; everything is in {out}, the check of the integration in {TABLE}")
