"""A job on a Dask cluster: FMUs and recordings are sent there once, mount-cosim must be installed there."""

import re
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from cosim.support.errors import MissingPackageError, SweepError
from cosim.support.extras import install
from cosim.sweeps.portable_job import PortableJob, WithScenario

PATIENCE = 10.0
"""Seconds that a scheduler may take to answer."""
ADDRESS = re.compile(r"(?:[a-z][a-z0-9+]*://)?(?:\[[0-9a-fA-F:]+\]|[^\s:/\[\]]+):[0-9]{1,5}(?:/\S*)?|inproc://\S+")
"""Of a scheduler: host and port, with or without its protocol."""


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
    """Send a job to a cluster; `close` is called on each worker at the end.

    Raises:
        MissingPackageError: Dask is not installed here.
        SweepError: nobody answers at the address, or mount-cosim is not there.
    """
    with connected(address, close) as (client, threads):
        portable = client.scatter(PortableJob.of(job), broadcast=True, hash=False)
        yield Cluster(threads, client.get_executor(pure=False), portable)


@contextmanager
def connected(address: str, close: Callable[[], None]) -> Iterator[tuple[Any, int]]:
    """Yield a client of a cluster and how many calls are done there at a time; the rest as `on_cluster`."""
    client = _client(address)
    try:
        threads = sum(client.nthreads().values())
        if not threads:
            raise SweepError(f"The cluster at {address} has no workers.", culprit=address)
        _check_versions(client, address)
        yield client, threads
    finally:
        with suppress(Exception):  # a cluster that is gone has closed them
            client.run(close)
        client.close()


def _client(address: str) -> Any:
    if not ADDRESS.fullmatch(address):
        message = f"--cluster {address} is no address of a Dask scheduler; write it as tcp://host:8786."
        raise SweepError(message, culprit=address)
    try:
        from dask.distributed import Client
    except ImportError as error:
        message = f"--cluster needs Dask: {install('cluster')}"
        raise MissingPackageError(message) from error
    try:
        return Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        message = f"No Dask scheduler answers at {address}; give its address as tcp://host:8786."
        raise SweepError(message, culprit=address) from error


def _check_versions(client: Any, address: str) -> None:
    from cosim.support.version import __version__

    try:
        there = set(client.run(version).values())
    except Exception as error:  # what a worker raises when it cannot import this comes in many shapes
        raise SweepError(f"The workers at {address} do not have mount-cosim: {error}.", culprit=address) from error
    if there != {__version__}:
        found = ", ".join(sorted(there))
        message = f"The workers at {address} have mount-cosim {found}; this is {__version__}."
        raise SweepError(message, culprit=address, value=found)


def version() -> str:
    """Return the version of mount-cosim where this is called."""
    from cosim.support.version import __version__

    return __version__
