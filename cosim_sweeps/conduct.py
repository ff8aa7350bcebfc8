"""A sweep from its file to its table: check, rehearse, run what is not done yet, write."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import pyarrow as pa
from pyarrow import parquet

from cosim.data.columns import ORIGIN_KEY, UNIT_KEY
from cosim.support.cell import LostError
from cosim.support.cells import close_cells, free, most_workers, new_cell, warm
from cosim.support.errors import SweepError
from cosim.support.files import replacing, sha256
from cosim.support.journal import RUNS, Journal
from cosim.support.version import __version__
from cosim.system.portable_job import files_of
from cosim.system.scenario import Scenario
from cosim_sweeps.file import Sweep
from cosim_sweeps.runs import Job, job_of, rehearse, rows_of

TABLE, PICTURE, RECORDINGS = "table.parquet", "sweep.svg", "recordings"
MADE = ("sweep.json", RUNS, TABLE, PICTURE, RECORDINGS)
"""Files of the folder: what the runs depend on, a line a run, the table, its picture, a recording a run."""
TYPES = {"run": pa.int64(), "status": pa.string(), "reason": pa.string()}
"""Of the table's columns; the others are numbers."""
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

    `scenario` is the one that the sweep names, with an FMU for each component; `address` is that of a Dask cluster that
    does the runs instead. Everything else is as of `cosim.sweep`.

    Raises:
        SweepError, WiringError, FmuError, SignalError: before the first run.
        OutputError: `out` holds another sweep.
    """
    processes = most_workers(workers, sweep.design.runs)
    if sweep.settings.record and address:
        raise SweepError("record = true keeps files on this machine; it does not go with --cluster.", culprit="record")
    begun = perf_counter()
    job = job_of(sweep, scenario, out / RECORDINGS if sweep.settings.record else None)
    with ExitStack() as stack:
        stack.callback(close_cells)
        if not address:
            warm(processes)
        units = _units(job)
        journal = stack.enter_context(Journal(out, _identity(sweep, scenario), force, "sweep", MADE, sweep.fits))
        known = {run for run, row in journal.rows.items() if row["status"] == "ok" or not retry}
        rest = [(number, point) for number, point in enumerate(sweep.design.points()) if number not in known]
        failed = sum(journal.rows[run]["status"] != "ok" for run in known)
        stack.enter_context(_table(out / TABLE, sweep, journal, units, _origin(sweep, scenario, command)))
        rows = stack.enter_context(closing(rows_of(job, rest, processes, address)))
        for done, row in enumerate(rows, len(known) + 1):
            journal.append(row)
            failed += row["status"] != "ok"
            on_progress(done, sweep.design.runs, failed)
        outside = [run for run, row in sorted(journal.rows.items()) if row["status"] == "ok" and row["reason"]]
        left = f"run {outside[0]}: {journal.rows[outside[0]]['reason']}" if outside else ""
    seconds = perf_counter() - begun
    return Summary(sweep.design.runs, len(rest), len(known), failed, seconds, out / TABLE, len(outside), left)


@contextmanager
def _table(
    path: Path, sweep: Sweep, journal: Journal, units: Mapping[str, str], origin: Mapping[str, str]
) -> Iterator[None]:
    """Write the table of what is done when the block ends, however it ends; what a failed run lacks is null."""
    try:
        yield
    finally:
        rows = [row for _, row in sorted(journal.rows.items())]
        metadata = {name: {UNIT_KEY: units.get(name, "").encode()} for name in sweep.columns}
        fields = [pa.field(name, TYPES.get(name, pa.float64()), metadata=unit) for name, unit in metadata.items()]
        columns = [[row[one.name] if one.name in TYPES else float(row[one.name]) for row in rows] for one in fields]
        arrays = [pa.array(one, field.type, from_pandas=True) for one, field in zip(columns, fields, strict=True)]
        schema = pa.schema(fields, metadata={ORIGIN_KEY: json.dumps(origin).encode()})
        with replacing(path, force=True) as partial:
            parquet.write_table(pa.Table.from_arrays(arrays, schema=schema), partial)


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
