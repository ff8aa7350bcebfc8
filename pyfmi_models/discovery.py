"""Find the classes of a package: a new file in it is all that a new class needs."""

import pkgutil
from collections.abc import Iterable
from importlib import import_module
from typing import TypeVar

Kind = TypeVar("Kind")


def classes_in(package: str, path: Iterable[str], base: type[Kind], word: str) -> tuple[type[Kind], ...]:
    """Import the modules of a package and return the subclasses of `base` that have the class variable `word`.

    They come by name of the module, within one in the order of its text; a name with an underscore is private.
    """
    modules = [import_module(f"{package}.{name}") for name in sorted(info.name for info in pkgutil.iter_modules(path))]
    own = [item for module in modules for item in vars(module).values() if _is_own(item, module.__name__)]
    return tuple(item for item in own if issubclass(item, base) and hasattr(item, word))


def _is_own(item: object, module: str) -> bool:
    return isinstance(item, type) and item.__module__ == module and not item.__name__.startswith("_")
