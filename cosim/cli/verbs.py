"""Which verbs there are: those of this package, and those that other packages plug in (`cosim.support.plugins`)."""

from collections.abc import Iterator
from importlib import import_module
from types import ModuleType

import typer

from cosim.cli.help import ORDER
from cosim.support.errors import PlugInError
from cosim.support.plugins import VERBS as PLUGGED
from cosim.support.plugins import loaded, names
from cosim.support.terminal import say


def verbs(under: str = "") -> tuple[str, ...]:
    """Names of all verbs; or of those that packages add below one of ours, as "alpaca" below "hardware"."""
    if under:
        return tuple(name.partition(".")[2] for name in names(PLUGGED) if name.startswith(f"{under}."))
    return (*ORDER, *(name for name in names(PLUGGED) if "." not in name and name not in ORDER))


def module_of(verb: str, under: str = "") -> ModuleType:
    """Import the module of a verb (raises PlugInError)."""
    if not under and verb in ORDER:
        return import_module(f"cosim.cli.{verb}")
    found: ModuleType = loaded(PLUGGED, f"{under}.{verb}" if under else verb)
    return found


def modules(called: str) -> Iterator[tuple[str, ModuleType]]:
    """Yield the verb that is called with its module, or all that there are; what cannot be loaded is said.

    Raises:
        PlugInError: the verb that is called cannot be loaded.
    """
    if called in ORDER or called in verbs():
        yield called, module_of(called)
    else:
        yield from _loadable("")


def attach(app: typer.Typer, under: str) -> None:
    """Give the app of a verb what packages add below it."""
    for name, module in _loadable(under):
        app.command(name)(getattr(module, name))


def _loadable(under: str) -> Iterator[tuple[str, ModuleType]]:
    for verb in verbs(under):
        try:
            yield verb, module_of(verb, under)
        except PlugInError as error:
            say(f"cosim: {error}")
