"""Laws, effects and hypotheses from outside this package: files of a folder, and entry points of installed packages.

    COSIM_PLUGINS=DIR            folders whose .py files are loaded (several are separated as in PATH)
    cosim.effects, cosim.laws,
    cosim.hypotheses             groups of entry points; each names a class

Who keeps a table of classes follows its kind: a class that is loaded later comes into the table too. Classes in a
folder are told by what they are, so a file may hold a law, an effect and its hypothesis together. The folder is put at
the end of the path of imports: its files import each other by name, and worker processes find them.
"""

import os
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

from pyfmi_models.errors import PluginError

VARIABLE = "COSIM_PLUGINS"
GROUPS = ("cosim.effects", "cosim.laws", "cosim.hypotheses")
HOMES = ("pyfmi_models", "cosim")
"""Packages whose own classes are in the tables from the start."""

Adopt = Callable[[type], None]

_followers: list[tuple[type, str, Adopt]] = []
_known: list[type] = []
_loaded: set[str] = set()


def follow(base: type, word: str, adopt: Adopt) -> None:
    """Call `adopt` with each class from outside that is a `base` and has the class variable `word`, now and later."""
    _followers.append((base, word, adopt))
    for one in list(_known):
        _offer(one, base, word, adopt)


def register(kind: type) -> None:
    """Make a class known to all tables of its kind, unless it is known already or of these packages."""
    if kind in _known or kind.__module__.partition(".")[0] in HOMES:
        return
    _known.append(kind)
    for base, word, adopt in list(_followers):
        _offer(kind, base, word, adopt)


def is_again(new: type, old: type) -> bool:
    """Whether a class is another one defined anew, as in a notebook."""
    return (new.__module__, new.__qualname__) == (old.__module__, old.__qualname__)


def _offer(kind: type, base: type, word: str, adopt: Adopt) -> None:
    if issubclass(kind, base) and hasattr(kind, word):
        adopt(kind)


def load() -> None:
    """Load what the environment and installed packages bring; what is loaded already is left as it is.

    Raises:
        PluginError: a folder or file cannot be loaded; names it and what went wrong.
    """
    for folder in filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)):
        _load_folder(Path(folder))
    if "entry points" not in _loaded:
        from importlib.metadata import entry_points  # takes longer than everything else here

        _loaded.add("entry points")
        for group in GROUPS:
            for point in entry_points(group=group):
                register(_of_entry_point(point.name, point.load))


def load_plugins(folder: str | Path) -> None:
    """Load the files of a folder, here and in processes that are started from here.

    Raises:
        PluginError: as `load`.
    """
    path = str(Path(folder).absolute())
    known = [one for one in os.environ.get(VARIABLE, "").split(os.pathsep) if one]
    _load_folder(Path(path))
    os.environ[VARIABLE] = os.pathsep.join(dict.fromkeys([*known, path]))


def files() -> list[Path]:
    """Files of the folders that the environment names, for who keeps what was made from them."""
    folders = filter(None, os.environ.get(VARIABLE, "").split(os.pathsep))
    return [path for folder in folders for path in _files_of(Path(folder))]


def _of_entry_point(name: str, load: Callable[[], object]) -> type:
    try:
        found = load()
    except Exception as error:
        raise PluginError(f'The entry point "{name}" cannot be loaded: {type(error).__name__}: {error}.') from error
    if not isinstance(found, type):
        raise PluginError(f'The entry point "{name}" is no class; it must name a law, an effect or a hypothesis.')
    return found


def _load_folder(folder: Path) -> None:
    key = str(folder.absolute())
    if key in _loaded:
        return
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.exists() else "there is no such folder"
        raise PluginError(f"--plugins {folder}: {what}; it must be a folder of Python files with laws or effects.")
    paths = _files_of(folder)
    if not paths:
        raise PluginError(f"--plugins {folder}: there is no .py file in it; put a law or an effect there.")
    _loaded.add(key)
    if key not in sys.path:
        sys.path.append(key)
    for path in paths:
        for kind in _classes_of(_module(path)):
            register(kind)


def _files_of(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("*.py") if not path.name.startswith(("_", "test_")))


def _module(path: Path) -> ModuleType:
    if not path.stem.isidentifier():
        raise PluginError(f'{path}: "{path.stem}" is no name of a Python module; use letters, digits and underscores.')
    try:
        found = import_module(path.stem)
    except (Exception, SystemExit) as error:
        raise PluginError(f"{path} cannot be loaded: {type(error).__name__}: {error}.") from error
    if Path(getattr(found, "__file__", None) or "").absolute() != path.absolute():
        raise PluginError(f'{path}: another module is called "{path.stem}" already; give the file another name.')
    return found


def _classes_of(module: ModuleType) -> Iterator[type]:
    """Classes that a module defines itself; a name with an underscore is private."""
    own = (one for one in vars(module).values() if isinstance(one, type) and one.__module__ == module.__name__)
    return (one for one in own if not one.__name__.startswith("_"))
