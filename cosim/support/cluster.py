"""A Dask cluster: its address, its client, and whether its workers have this version of mount-cosim."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pkgutil import resolve_name
from typing import Any

from cosim.support.errors import MissingPackageError, SweepError
from cosim.support.extras import install
from cosim.support.version import __version__

PATIENCE = 10.0
"""Seconds that a scheduler may take to answer."""
ADDRESS = re.compile(r"(?:[a-z][a-z0-9+]*://)?(?:\[[0-9a-fA-F:]+\]|[^\s:/\[\]]+):[0-9]{1,5}(?:/\S*)?|inproc://\S+")
"""Of a scheduler: host and port, with or without its protocol."""
VERSION = "cosim.support.version:__version__"


@contextmanager
def connected(address: str, close: Callable[[], None]) -> Iterator[tuple[Any, int]]:
    """Yield a client of a cluster and how many calls are done there at a time.

    Args:
        address: of its scheduler, tcp://host:8786.
        close: called on each worker at the end.

    Raises:
        MissingPackageError: Dask is not installed here.
        SweepError: nobody answers at the address, or mount-cosim is not there.
    """
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
    """Refuse workers of another version; a function of the standard library asks, which all versions have."""
    try:
        there = set(client.run(resolve_name, VERSION).values())
    except Exception as error:  # what a worker raises when it cannot import this comes in many shapes
        raise SweepError(f"The workers at {address} do not have mount-cosim: {error}.", culprit=address) from error
    if there != {__version__}:
        found = ", ".join(sorted(there))
        message = f"The workers at {address} have mount-cosim {found}; this is {__version__}."
        raise SweepError(message, culprit=address, value=found)
