"""What installed packages add by entry points; nothing here imports them by name.

    cosim.verbs        a module as those of `cosim.cli`: it has a function of the verb's name, or the typer `app`, its
                       `GROUP` in the help and `EXAMPLES`; "hardware.alpaca" is the verb `cosim hardware alpaca`
    cosim.handles      a function or class that Python finds in `cosim` by the name
    cosim.exports      "simulators": plans the files of a card for other simulators, see `cosim.api.export.Simulators`;
                       "system": writes a system as one FMU
    cosim.identifiers  "model": what `cosim.identify` calls for an FMU or a system in the place of a card
    cosim.readers      "bag": reads files of the suffix .bag; a function of a path to `cosim.data.columns.Columns`,
                       run in a process of its own with limits of memory and time
    cosim.importers    a module that reads what a machine's tool exports as text: `recognises(lines)` its first lines,
                       `read(path, whole, lines)` gives `Columns`
    cosim.formulas     a function that looks for a closed form in the place of a learned table, see
                       `cosim.diagnosis.terms.closed_form`
    cosim.results      "table.parquet": tells facts and tables of the file of this name, or of the folder that has it;
                       a function of its path (InputError where it is another's)
    cosim.toml         "vary": tells facts and tables of a TOML file with this key, in the same way
    cosim.transports   a `PythonAdapter`, made of machine and cycle [s]: the way to a drive at `adapter = "NAME:PLACE"`
                       of a machine file, whose section [NAME] is the pydantic model `section` of the class

Classes of physics (`cosim.effects`, `cosim.laws`, `cosim.hypotheses`) come by the same means: `pyfmi_models.plugins`.
"""

from functools import cache
from typing import Any

from cosim.support.errors import PlugInError

EXPORTS, HANDLES, IDENTIFIERS = "cosim.exports", "cosim.handles", "cosim.identifiers"
IMPORTERS, READERS = "cosim.importers", "cosim.readers"
RESULTS, TOML = "cosim.results", "cosim.toml"
VERBS, TRANSPORTS = "cosim.verbs", "cosim.transports"


@cache
def names(group: str) -> tuple[str, ...]:
    """Names of the entry points of a group, in the order of the alphabet."""
    return tuple(sorted(_points(group)))


@cache
def loaded(group: str, name: str) -> Any:
    """Import what an entry point names.

    Raises:
        PlugInError: there is none, or it cannot be imported; one sentence with its package and the reason.
    """
    if name not in (points := _points(group)):
        raise PlugInError(f'No package that is installed plugs in "{name}" ({group}); reinstall mount-cosim.')
    point = points[name]
    try:
        return point.load()
    except Exception as error:
        home = point.dist.name if point.dist else point.value
        text = f'The plug-in "{name}" of {home} cannot be loaded: {type(error).__name__}: {error}; reinstall {home}.'
        raise PlugInError(text) from error


def _points(group: str) -> dict[str, Any]:
    from importlib.metadata import entry_points  # most commands need none of this

    return {point.name: point for point in entry_points(group=group)}
