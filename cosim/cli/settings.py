"""Defaults of a folder of work: `cosim.toml`, or `[tool.cosim]` in pyproject.toml, here or in a folder above.

out = "results"                     where results go whose folder is not given
card = "axis.toml"                  of verbs that take one; relative to this file
plugins = "mine"                    folder of own laws and effects; relative to this file
[columns]                           as --columns, --units, --layout; the command line comes before them
tau = "force"
[units]
q = "arcsec"
[diagnose]                          options of one verb by their names: quick = true
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.support.errors import InputError
from cosim.support.plain import Parsed

FILE, PROJECT = "cosim.toml", "pyproject.toml"
PAIRS = ("columns", "units", "layout")
PATHS = ("card", "plugins", "out")


@dataclass(frozen=True)
class Settings:
    """What a file of defaults says."""

    path: Path | None = None
    pairs: dict[str, dict[str, str]] = field(default_factory=dict)
    """Columns, units, layout: our name to the value."""
    paths: dict[str, str] = field(default_factory=dict)
    """Card, plugins and folder of results, found from the folder of the file."""
    verbs: dict[str, Parsed] = field(default_factory=dict)
    """Options of each verb."""

    def listed(self, name: str) -> list[str]:
        """Pairs as an option would have them: ["tau=force"]."""
        return [f"{key}={value}" for key, value in self.pairs.get(name, {}).items()]

    def of_verb(self, verb: str) -> Parsed:
        """Defaults of a verb's options, by the names of its parameters."""
        shared = {name: value for name, value in self.paths.items() if name == "card"}
        return shared | self.verbs.get(verb, {})

    def check(self, verb: str, options: Sequence[str]) -> None:
        """Refuse a default of an option that the verb has not (raises InputError)."""
        for name in self.verbs.get(verb, {}):
            if name not in options:
                choices = tuple(option.replace("_", "-") for option in options)
                text = f"{self.path}: [{verb}] {name} is no option of it; options are: {', '.join(choices)}."
                raise InputError(text, culprit=name, choices=choices)


def read_settings(verbs: Callable[[], Sequence[str]], here: Path | None = None) -> Settings:
    """Read the nearest file of defaults; none is no fault. Which verbs there are is asked only where there is one.

    Raises:
        InputError: it is not TOML, a key in it is unknown, or a value is of the wrong kind.
    """
    folder = Path.cwd() if here is None else here
    for place in (folder, *folder.parents):
        if (path := place / FILE).is_file():
            return _checked(path, _parsed(path), verbs())
        if (path := place / PROJECT).is_file():
            table = _parsed(path).get("tool", {})
            if isinstance(table, dict) and "cosim" in table:
                return _checked(path, table["cosim"], verbs())
    return Settings()


def _parsed(path: Path) -> Parsed:
    import tomllib

    try:
        return tomllib.loads(path.read_text("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        if path.name == PROJECT:
            return {}  # somebody else's file
        raise InputError(f"{path} is not valid TOML: {error}.", culprit=str(path)) from None


def _checked(path: Path, given: Any, verbs: Sequence[str]) -> Settings:
    if not isinstance(given, dict):
        raise InputError(f"{path}: [tool.cosim] must be a section with keys.", culprit=str(path))
    choices = (*PATHS, *PAIRS, *verbs)
    for key, value in given.items():
        if key not in choices:
            rule = f"keys there are: {', '.join(choices)}"
            raise InputError(f'{path}: "{key}" is no key; {rule}.', culprit=key, choices=choices)
        section = key in PAIRS or key in verbs
        if not (section and isinstance(value, dict)) and not (key in PATHS and isinstance(value, str)):
            kind = "text in quotes" if key in PATHS else "a section with keys"
            raise InputError(f"{path}: {key} = {value!r} is wrong; it must be {kind}.", culprit=key, value=value)
    pairs = {name: {key: str(value) for key, value in given.get(name, {}).items()} for name in PAIRS}
    own = {
        verb: {k.replace("-", "_"): v for k, v in given[verb].items()}
        for verb in verbs
        if isinstance(given.get(verb), dict)
    }
    return Settings(
        path, pairs, {key: _from(path, key, given[key]) for key in PATHS if isinstance(given.get(key), str)}, own
    )


def _from(path: Path, key: str, value: str) -> str:
    """A path as seen from here; the name of a shipped card stays a name."""
    there = path.parent / value
    if key == "card" and not there.exists():
        return value
    return os.path.relpath(there)
