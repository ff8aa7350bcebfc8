"""`cosim.sweep`: one scenario many times, with other numbers each time."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosim.models.cache import with_fmus
from cosim.support.html import facts
from cosim.support.notebook import shows_progress
from cosim.system.scenario import read_scenario
from cosim_sweeps.conduct import PICTURE, Summary, conduct
from cosim_sweeps.file import read_sweep
from cosim_sweeps.results import Results, read_results


@dataclass(frozen=True)
class SweepResult:
    """What a sweep gave: its table, its picture, how it went, and its best run."""

    summary: Summary
    picture: Path

    @property
    def table(self) -> Path:
        """The table (Parquet), a row a run."""
        return self.summary.table

    @property
    def results(self) -> Results:
        """The columns of the table as arrays (runs,)."""
        return read_results(self.table)

    @property
    def best(self) -> dict[str, float]:
        """The run whose first statistic is nearest to zero: its number, what was varied, its statistics."""
        return self.results.best_row()

    def frame(self) -> object:
        """Return the table as a pandas `DataFrame`."""
        import pandas

        return pandas.read_parquet(self.table)

    def plot(self) -> Any:
        """Return the picture as a matplotlib figure."""
        from cosim_sweeps.picture import figure_of

        return figure_of(self.results)

    def __str__(self) -> str:
        done = self.summary
        before = f", {done.found:,} of them done before" if done.found else ""
        failed = f"; {done.failed:,} came to nothing, the table says why" if done.failed else ""
        left = f"{done.outside:,} runs left what is proven; {done.left}\n" if done.outside else ""
        how = f"{done.runs:,} runs{before}, {done.seconds:.3g} s{failed}; picture: {self.picture}"
        best = f"{words}\n" if (words := self.results.best_words) else ""
        return f"{best}{left}{how}"

    def __repr__(self) -> str:
        return f"SweepResult({self.summary.runs:,} runs, table={str(self.table)!r})"

    def _repr_html_(self) -> str:
        return facts("sweep", {"result": str(self), "table": str(self.table)})


@shows_progress(lambda done, of, failed: f"{done:,} of {of:,} runs" + (f", {failed:,} failed" if failed else ""))
def sweep(
    file: str | Path,
    out: str | Path,
    *,
    workers: int | None = None,
    cluster: str = "",
    retry: bool = False,
    force: bool = False,
    command: str = "cosim.sweep",
    on_progress: Callable[[int, int, int], None] = lambda done, of, failed: None,
    on_build: Callable[[str], None] = lambda text: None,
) -> SweepResult:
    """Run a scenario many times; write `out`/table.parquet, a row a run, and `out`/sweep.svg, its picture.

    Args:
        file: what is varied and what is kept of a run (.toml), see `cosim_sweeps`.
        out: folder of the sweep; one that was begun there is continued.
        workers: processes; the cores of this machine where not given.
        cluster: address of a Dask scheduler that does the runs instead.
        retry: run again what failed.
        force: start over.
        command: what the table says it was made by.
        on_progress: called after each run with runs done, runs in all, and runs that came to nothing.
        on_build: called with a word on each FMU that is built.

    Raises:
        SweepError, ScenarioError, WiringError, FmuError, SignalError, OutputError: before the first run.
    """
    wanted = read_sweep(Path(file))
    ready = with_fmus(read_scenario(wanted.scenario), on_build)
    done = conduct(
        wanted,
        ready,
        Path(out),
        workers=workers,
        address=cluster,
        force=force,
        retry=retry,
        on_progress=on_progress,
        command=command,
    )
    from cosim_sweeps.picture import draw  # what draws takes long to load

    return SweepResult(done, draw(done.table, done.table.with_name(PICTURE)))
