"""A sweep from its file to its table: check, rehearse, run what is not done yet, write."""

import hashlib
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from cosim.support.cell import LostError
from cosim.support.errors import SweepError
from cosim.support.files import sha256
from cosim.support.version import __version__
from cosim.sweeps.file import Sweep
from cosim.sweeps.job import Job, Row, job_of, rehearse
from cosim.sweeps.journal import Journal
from cosim.sweeps.pool import Numbered, Pool, close_cells, cluster, free, local, most_workers, new_cell, warm
from cosim.sweeps.portable_job import files_of
from cosim.sweeps.table import write_table
from cosim.system.scenario import Scenario

OnProgress = Callable[[int, int, int], None]
"""Called after each run with runs done, runs in all, and runs that came to nothing."""


@dataclass(frozen=True)
class Summary:
    """How a sweep went: runs in all, done now, found done, failed (all of them), seconds of this session, the table."""

    runs: int
    done: int
    found: int
    failed: int
    seconds: float
    table: Path
    outside: int = 0
    """Runs that left the range in which a component is proven."""
    left: str = ""
    """How the first of them did."""


def conduct(
    sweep: Sweep,
    scenario: Scenario,
    out: Path,
    *,
    workers: int | None = None,
    address: str = "",
    force: bool = False,
    retry: bool = False,
    on_progress: OnProgress = lambda done, of, failed: None,
    command: str = "",
) -> Summary:
    """Run a sweep, or what is left of it, and write `out`/table.parquet.

    Args:
        sweep: what `read_sweep` returned.
        scenario: the scenario it names, with an FMU for each component.
        out: folder of the sweep; one that was begun there is continued.
        workers: processes; the cores of this machine where not given.
        address: of a Dask cluster that does the runs instead.
        force: start over.
        retry: run again what failed, crashed or took too long.
        on_progress: called after each run.
        command: what the table says it was made by.

    Raises:
        SweepError, WiringError, FmuError, SignalError: before the first run.
        OutputError: `out` holds another sweep.
    """
    processes = most_workers(workers, sweep.design.runs)
    if sweep.record and address:
        raise SweepError("record = true keeps files on this machine; it does not go with --cluster.", culprit="record")
    begun = perf_counter()
    job = job_of(sweep, scenario, out / "recordings" if sweep.record else None)
    with ExitStack() as stack:
        stack.callback(close_cells)
        if not address:
            warm(processes)
        units = _units(job)
        journal = stack.enter_context(Journal(out, _identity(sweep, scenario), force, fits=sweep.fits))
        known = {run for run, row in journal.rows.items() if row["status"] == "ok" or not retry}
        rest = [(number, point) for number, point in enumerate(sweep.design.points()) if number not in known]
        failed = sum(journal.rows[run]["status"] != "ok" for run in known)
        table = stack.enter_context(_table(out, sweep, journal, units, _origin(sweep, scenario, command)))
        rows = stack.enter_context(closing(_rows(_pool(job, processes, address), rest)))
        for done, row in enumerate(rows, len(known) + 1):
            journal.append(row)
            failed += row["status"] != "ok"
            on_progress(done, sweep.design.runs, failed)
        outside = [run for run, row in sorted(journal.rows.items()) if row["status"] == "ok" and row["reason"]]
        left = f"run {outside[0]}: {journal.rows[outside[0]]['reason']}" if outside else ""
    return Summary(sweep.design.runs, len(rest), len(known), failed, perf_counter() - begun, table, len(outside), left)


def _rows(pool: AbstractContextManager[Pool], rest: list[Numbered]) -> Generator[Row, None, None]:
    if rest:
        with pool as ready:
            yield from ready.rows(rest)


def _pool(job: Job, workers: int, address: str) -> AbstractContextManager[Pool]:
    return cluster(job, address) if address else local(job, workers)


@contextmanager
def _table(out: Path, sweep: Sweep, journal: Journal, units: dict[str, str], origin: dict[str, str]) -> Iterator[Path]:
    """Write the table of what is done when the block ends, however it ends."""
    path = out / "table.parquet"
    try:
        yield path
    finally:
        rows = [row for _, row in sorted(journal.rows.items())]
        write_table(path, sweep.columns, rows, units, origin)


def _origin(sweep: Sweep, scenario: Scenario, command: str) -> dict[str, str]:
    made = {"version": f"mount-cosim {__version__}", "command": command}
    return made | {"scenario": scenario.text, "sweep": sweep.content, "runs": str(sweep.design.runs)}


def _units(job: Job) -> dict[str, str]:
    """Rehearse in a process of its own, and return the units of the columns as far as they are known."""
    cell = new_cell()
    try:
        found: dict[str, str] = cell.call(rehearse, job, timeout=job.timeout)
    except LostError:
        found = {}  # a scenario that crashes as it stands may run with other parameters
    free(cell)
    return {"seconds": "s"} | found | {name: one[0].unit for name, one in job.varied.items()}


def _identity(sweep: Sweep, scenario: Scenario) -> dict[str, str]:
    texts = {"sweep file": sweep.content, "scenario": scenario.text}
    hashes = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items()}
    files = {f"file of {name}": sha256(path) for name, path in files_of(scenario).items()}
    return {"version": __version__} | hashes | files
