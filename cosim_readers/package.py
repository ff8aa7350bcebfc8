"""Packages that only some formats need."""

from importlib import import_module
from pathlib import Path
from typing import Any

from cosim.support.errors import MissingPackageError
from cosim.support.extras import install


def package(name: str, extra: str, path: Path) -> Any:
    """Import a package that an extra of this project brings (MissingPackageError says how to get it)."""
    try:
        return import_module(name)
    except ImportError as error:
        root = name.partition(".")[0]
        raise MissingPackageError(f"{path} needs the package {root} to be read: {install(extra)}") from error
