"""A job with its files, for machines that do not have them: FMUs and recordings are sent to a cluster once."""

import hashlib
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Generic, Protocol, Self, TypeVar

from cosim.support.cluster import connected
from cosim.support.files import cache_home, replacing
from cosim.system.scenario import Scenario
from cosim.system.sections import ComponentSection


class WithScenario(Protocol):
    """What can travel: it has a scenario, whose files can be elsewhere."""

    @property
    def scenario(self) -> Scenario:
        """The scenario, whose components all have their FMU."""

    def with_scenario(self, scenario: Scenario) -> Self:
        """The same with another scenario."""


J = TypeVar("J", bound=WithScenario)


@dataclass(frozen=True)
class PortableJob(Generic[J]):
    """A job, and what is in the files it names, by their path where it was made."""

    job: J
    files: Mapping[Path, bytes]

    @classmethod
    def of(cls, job: J) -> "PortableJob[J]":
        """Pack the FMUs and recordings of a job."""
        return cls(job, {path: path.read_bytes() for path in files_of(job.scenario).values()})

    def job_here(self) -> J:
        """Return the job with paths on this machine, where its files are put once."""
        here = {path: _stored(content, path.suffix) for path, content in self.files.items()}
        return self.job.with_scenario(_located(self.job.scenario, here))


@dataclass(frozen=True)
class Cluster:
    """A cluster that has a job: `threads` calls are done at a time."""

    threads: int
    executor: Executor
    portable: Any
    """The job where it is, a future of Dask."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Call a function of a module there, with the `PortableJob` as its first argument."""
        return self.executor.submit(function, self.portable, *arguments)


@contextmanager
def on_cluster(job: WithScenario, address: str, close: Callable[[], None]) -> Iterator[Cluster]:
    """Send a job to a cluster; `close` is called on each worker at the end, errors are those of `connected`."""
    with connected(address, close) as (client, threads):
        portable = client.scatter(PortableJob.of(job), broadcast=True, hash=False)
        yield Cluster(threads, client.get_executor(pure=False), portable)


def files_of(scenario: Scenario) -> dict[str, Path]:
    """List by their owner the files a scenario needs: FMUs, and recordings that are replayed."""
    made = {f"components.{name}": one.fmu or _python(one) for name, one in scenario.components.items()}
    replayed = {f"signals.{name}": _file(signal) for name, signal in scenario.signals.items()}
    return {name: path for name, path in (made | replayed).items() if path is not None}


def _file(signal: Any) -> Path | None:
    return getattr(signal, "file", None)


def _python(section: ComponentSection) -> Path | None:
    return Path(section.python.rpartition(":")[0]) if section.python else None


@lru_cache(maxsize=8)
def _stored(content: bytes, suffix: str) -> Path:
    path = cache_home() / "sweeps" / (hashlib.sha256(content).hexdigest() + suffix)
    if not path.exists():
        with replacing(path, force=True) as partial:
            partial.write_bytes(content)
    return path


def _located(scenario: Scenario, here: Mapping[Path, Path]) -> Scenario:
    components = {name: _moved(one, here) for name, one in scenario.components.items()}
    signals: dict[str, Any] = {
        name: signal.model_copy(update={"file": here[file]}) if (file := _file(signal)) else signal  # type: ignore[attr-defined]
        for name, signal in scenario.signals.items()
    }
    return replace(scenario, components=components, signals=signals)


def _moved(section: ComponentSection, here: Mapping[Path, Path]) -> ComponentSection:
    if section.fmu is not None:
        return section.model_copy(update={"fmu": here[section.fmu]})
    file = _python(section)
    function = (section.python or "").rpartition(":")[2]
    return section if file is None else section.model_copy(update={"python": f"{here[file]}:{function}"})
