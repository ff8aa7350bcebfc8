"""The command line that does the same again."""

import os
from collections.abc import Mapping, Sequence
from shlex import join


def command_of(verb: str, arguments: Sequence[object], options: Mapping[str, object]) -> str:
    """The command line that does the same again.

    Args:
        verb: "diagnose", "hardware run".
        arguments: what stands before the options.
        options: by name; a list is an option given several times, True one without a value; None, False and "" are
            left out.
    """
    words = ["cosim", *verb.split(), *map(str, arguments)]
    for name, given in options.items():
        for value in given if isinstance(given, list) else [given]:
            if value is not None and value is not False and value != "":
                words += [name] if value is True else [name, str(value)]
    for folder in filter(None, os.environ.get("COSIM_PLUGINS", "").split(os.pathsep)):
        words += ["--plugins", folder]
    return join(words)
