"""`cosim demo`: the whole chain on an embedded example."""

import time
from pathlib import Path
from typing import Annotated

import typer

from cosim.memory import keep_freed_memory
from cosim.terminal import put, say, stage


def demo(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for everything the demo makes.")] = Path(
        "cosim_demo"
    ),
    force: Annotated[bool, typer.Option("--force", help="Overwrite an earlier demo.")] = False,
) -> None:
    """Export, co-simulate, meet a recording with concealed physics, find it, prove it, write the better FMU."""
    from cosim.demo import run_demo
    from cosim.diagnosis.terminal import summary
    from cosim.files import check_free

    keep_freed_memory()
    check_free(out, force)
    started = time.perf_counter()
    with stage("cosim demo") as progress:
        done = run_demo(out, f"cosim demo --out {out}", progress.tell)
    put("The stiff bristle state inside the FMU, beside the paper's analytic update, at 0.1 ms\n")
    put(done.table)
    put("\nA night's recordings of a mount that has physics its card does not know\n")
    put(summary(done.diagnosis))
    put(
        f"\nIn closed loop on the held-out set point, simulated against recorded torque, RMS [N.m]:\n"
        f"{done.before.torque:.3g} with the card's FMU, {done.after.torque:.3g} with the improved one"
    )
    put(f"\nOpen {out / 'diagnosis' / 'report.html'}")
    say(f"{time.perf_counter() - started:.1f} s; everything is in {out}")
