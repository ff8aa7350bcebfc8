"""`cosim.run`: a scenario to a recording, its statistics and a page of pictures."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from cosim.api.changes import changed
from cosim.master.isolated import CALL_TIMEOUT, run_isolated
from cosim.master.result import RunResult, Statistics
from cosim.master.simulate import Options, Progress
from cosim.master.simulate import run as run_here
from cosim.models.cache import with_fmus
from cosim.plots.digest import tracking
from cosim.support.files import check_free, replacing
from cosim.support.lock import claimed
from cosim.system.address import Value
from cosim.system.scenario import Scenario, read_scenario

RECORDING, STATISTICS, PAGE = "recording.parquet", "run.json", "run.html"


def run(
    scenario: str | Path | Scenario,
    out: str | Path | None = None,
    *,
    set: Mapping[str, Value] | None = None,  # the word of the option
    stop: float | None = None,
    page: bool = True,
    outside: bool = False,
    force: bool = False,
    compiled: bool = True,
    isolate: bool | None = None,
    call_timeout: float = CALL_TIMEOUT,
    command: str = "cosim.run",
    on_progress: Progress | None = None,
    on_build: Callable[[str], None] = lambda text: None,
) -> RunResult:
    """Run a scenario; FMUs of its cards are built where the cache does not have them.

    Args:
        scenario: a scenario (.toml) or SSP: its path, the name of a shipped one ("sidereal"), or a `Scenario`.
        out: folder for recording.parquet, run.json and run.html; None keeps the recording in memory and writes nothing.
        set: other numbers for this run, by name: {"controller.kp": 400.0}; those that a sweep can vary.
        stop: time at which it ends instead [s].
        page: write run.html, the page of pictures.
        outside: read files beside an SSP that it names outside of itself.
        force: overwrite what is there.
        compiled: False asks for the loop in Python, which is slow and gives the same bits.
        isolate: run in a process of its own, which may crash; None does so where there is a folder and the scenario
            has FMUs or functions that are given.
        call_timeout: seconds that one call of an isolated component may take.
        command: what the recording shall say it was made by.
        on_progress: called between chunks with ticks done and ticks in all.
        on_build: told of each FMU that is built.

    Returns:
        `RunResult`.

    Raises:
        ScenarioError, SweepError, WiringError, FmuError, SignalError, OutputError: before the first step; one sentence
            each.
        StepError: a component failed; what was recorded before is in the file.
        LostComponentError: an isolated component ended, crashed or blocked its process.
    """
    wanted = scenario if isinstance(scenario, Scenario) else read_scenario(str(scenario), outside)
    folder = None if out is None else Path(out)
    for path in files_of(folder, page).values():
        check_free(path, force)
    ready = changed(with_fmus(wanted, on_build), set or {}, stop)
    options = Options(None, force, on_progress, compiled, command)
    if folder is None:
        done = run_here(ready, options)
        return replace(done, statistics={**done.statistics, "scenario": wanted.name})
    return Delivery(folder, options, is_foreign(wanted) if isolate is None else isolate, call_timeout, page).of(ready)


@dataclass(frozen=True)
class Delivery:
    """A run into a folder: how it is carried out, here or in a process of its own, and what is written; see `run`."""

    folder: Path
    options: Options
    isolate: bool
    call_timeout: float = CALL_TIMEOUT
    page: bool = True

    def of(self, scenario: Scenario) -> RunResult:
        """Run a scenario whose FMUs are there; its process inherits the lock of the folder."""
        options = replace(self.options, path=self.folder / RECORDING)
        with claimed(self.folder, "run") as lock:
            if self.isolate:
                done = run_isolated(scenario, options, call_timeout=self.call_timeout, keep=(lock,))
            else:
                done = run_here(scenario, options)
            return self._written(scenario, done)

    def _written(self, scenario: Scenario, done: RunResult) -> RunResult:
        """Write the page and the statistics beside the recording."""
        files, force = files_of(self.folder, self.page), self.options.force
        told: Statistics = {**done.statistics, "scenario": scenario.name, "recording": str(files["recording"])}
        told["tracking"] = [asdict(one) | {"statement": str(one)} for one in tracking(files["recording"])]
        if self.page:
            from cosim.plots.run_page import write_page

            told["page"] = str(write_page(files["page"], files["recording"], scenario, done.statistics, force))
        with replacing(files["statistics"], force) as partial:
            partial.write_text(json.dumps(told, indent=2) + "\n", "utf-8")
        return replace(done, statistics=told, files=files)


def is_foreign(scenario: Scenario) -> bool:
    """Whether a scenario runs what was not built here from a card: FMUs and functions that are given."""
    return any(one.fmu is not None or one.python is not None for one in scenario.components.values())


def files_of(out: Path | None, page: bool = True) -> dict[str, Path]:
    """Return the files of a run by kind; none where nothing is written."""
    names = {"recording": RECORDING, "statistics": STATISTICS} | ({"page": PAGE} if page else {})
    return {} if out is None else {kind: out / name for kind, name in names.items()}
