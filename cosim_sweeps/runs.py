"""Runs of a sweep: points of the parameter space to rows of the table, in processes of this machine or of a cluster."""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from time import perf_counter

from cosim.data.recording import Recording
from cosim.master.simulate import run
from cosim.support.cell import LostError
from cosim.support.cells import as_they_come, close_cells, own_cell, threads
from cosim.support.errors import CosimError, StepError
from cosim.support.plain import Parsed
from cosim.system.address import Address, addresses, find
from cosim.system.portable_job import PortableJob, on_cluster
from cosim.system.scenario import Scenario
from cosim.system.wire import Record
from cosim_sweeps.file import Sweep
from cosim_sweeps.statistics import Statistic
from cosim_sweeps.variation import Point

Numbered = tuple[int, Point]
"""A point and the number of its run."""
Row = Parsed
"""Column to value: run, what was varied, statistics, seconds, status ("ok", "failed", "crashed", "timeout"), reason.

The reason of a run that is ok is how it left the range in which a component is proven, where it did."""


@dataclass(frozen=True)
class Job:
    """What all runs of a sweep share; it goes to other processes and machines."""

    scenario: Scenario
    varied: Mapping[str, tuple[Address, ...]]
    statistics: Mapping[str, Statistic]
    timeout: float | None = None
    recordings: Path | None = None
    kept: tuple[str, ...] = ()

    def with_scenario(self, scenario: Scenario) -> "Job":
        """Return the same runs of another scenario."""
        return replace(self, scenario=scenario)

    def begun(self, number: int, point: Point) -> Row:
        """Return the row of a run that has come to nothing yet."""
        nothing = dict.fromkeys(self.statistics, nan)
        varied = dict(zip(self.varied, point, strict=True))
        return {"run": number, **varied, **nothing, "seconds": nan, "status": "failed", "reason": ""}

    def at(self, point: Point) -> Scenario:
        """Return the scenario of a point."""
        scenario = self.scenario
        for addresses_, value in zip(self.varied.values(), point, strict=True):
            for address in addresses_:
                scenario = address.set(scenario, value)
        return scenario


def job_of(sweep: Sweep, scenario: Scenario, recordings: Path | None = None) -> Job:
    """Join a sweep and its scenario, whose components all have their FMU.

    Raises:
        SweepError: something varied does not exist.
        FmuError: a component is no FMU.
    """
    known = addresses(scenario)
    varied = {
        name: tuple(find(target, known, f"{sweep.path}: vary.{name}") for target in variation.of)
        for name, variation in sweep.variations.items()
    }
    wanted = dict.fromkeys(name for statistic in sweep.statistics.values() for name in statistic.signals)
    watched = {name: scenario.records.get(name) or Record(name) for name in wanted}
    kept = dict(scenario.records) if recordings else {}
    changed = replace(scenario, records=kept | watched, decimation=sweep.settings.decimation or scenario.decimation)
    return Job(changed, varied, sweep.statistics, sweep.settings.timeout, recordings, tuple(kept))


def work(job: Job, number: int, point: Point) -> Row:
    """Run one point. Whatever goes wrong is said in the row."""
    row, begun = job.begun(number, point), perf_counter()
    try:
        done = run(job.at(point))
        row |= {name: one.of(done.recording) for name, one in job.statistics.items()}
        _keep(job, number, done.recording)
        outside = done.statistics.get("outside", ())
        row |= {"status": "ok", "reason": outside[0] if outside else ""}
    except CosimError as error:
        row["reason"] = str(error)
    except Exception as error:  # whatever a foreign FMU or a full disk raises costs this row only
        row["reason"] = f"{type(error).__name__}: {error}"
    return row | {"seconds": perf_counter() - begun}


def rehearse(job: Job) -> dict[str, str]:
    """Take a step or two of the scenario as it stands and return the units of the statistics.

    Raises:
        InputError: the wiring, a signal, an FMU or a statistic is not as it must be.
    """
    ticks = min(2 * job.scenario.decimation, job.scenario.ticks)
    try:
        recording = run(replace(job.scenario, ticks=ticks)).recording
    except StepError:
        return {}  # with other parameters it may go on
    return {name: one.checked_unit(recording, job.scenario.stop) for name, one in job.statistics.items()}


def _keep(job: Job, number: int, recording: Recording) -> None:
    if job.recordings is not None:
        table = {name: recording[name] for name in ("t", *job.kept)}
        replace(recording, table=table).write(job.recordings / f"{number:06d}.parquet", force=True)


Submit = Callable[[Numbered], "Future[Row]"]


def rows_of(job: Job, points: Sequence[Numbered], workers: int, address: str) -> Generator[Row, None, None]:
    """Do the runs on a cluster, where there is its address, else in `workers` processes here; errors of `on_cluster`.

    Rows are yielded as they come. A run more waits for each process, on a cluster two.
    """
    if points:
        with _there(job, address) if address else _here(job, workers) as (submit, most):
            yield from as_they_come(points, submit, most)


@contextmanager
def _here(job: Job, workers: int) -> Iterator[tuple[Submit, int]]:
    with threads(workers, "sweep") as executor:
        yield lambda one: executor.submit(_isolated, job, *one), 2 * workers


@contextmanager
def _there(job: Job, address: str) -> Iterator[tuple[Submit, int]]:
    with on_cluster(job, address, close_cells) as cluster:
        yield lambda one: cluster.submit(_remote, *one), 3 * cluster.threads


def _remote(portable: PortableJob[Job], number: int, point: Point) -> Row:
    return _isolated(portable.job_here(), number, point)


def _isolated(job: Job, number: int, point: Point) -> Row:
    """Do one run in the cell of this thread; a crash becomes a row."""
    try:
        row: Row = own_cell().call(work, job, number, point, timeout=job.timeout)
    except LostError as loss:
        return job.begun(number, point) | {"status": loss.status, "reason": str(loss)}
    return row
