"""TOML of any content: what the parser of the standard library cannot take is a mistake in the file like another."""

import tomllib

from cosim.support.plain import Parsed


def parsed(text: str) -> Parsed:
    """Return what a TOML text says.

    Raises:
        tomllib.TOMLDecodeError: it is not TOML, is nested too deeply, or holds a number too long to be one.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError as error:
        raise tomllib.TOMLDecodeError("its brackets are nested too deeply") from error
    except ValueError as error:  # Python's limit for whole numbers from text
        raise tomllib.TOMLDecodeError("a number in it has too many digits") from error
