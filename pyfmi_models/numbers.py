"""Bounds of the numbers in a card: beyond them arithmetic would fail, not physics; and TOML of any content."""

import tomllib
from typing import Any

LARGEST = 1e300
"""Beyond this a number in a card is no number: it would overflow in the first product."""
LARGEST_GIVEN = 1e12
"""Of inertia, torque limit, ratio, noise, gains, in SI units: far above any axis, far below trouble."""
LEAST = 1e-9
"""Of what is divided by: inertia [kg m2 or kg], torque limit [N m or N], ratio. A watch's balance has 1e-9 kg m2."""
MOST_COUNTS = 2.0**53
"""Of an encoder a turn: every whole number up to it is a double."""
FASTEST, SLOWEST = 1e9, 1e-3
"""Rates of a controller [Hz]."""
LONGEST_NAME = 100
"""Characters; files and C functions get the name too."""
SHOWN = 60
"""Characters of a value that a message shows."""


Table = dict[str, Any]
"""A table as it came out of TOML: nothing of it is known until it is checked."""


def parsed(text: str) -> Table:
    """Return what a TOML text says; what Python's parser cannot take is a mistake in it like another.

    Raises:
        tomllib.TOMLDecodeError: it is not TOML, is nested too deeply, or holds a number too long to be one.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise tomllib.TOMLDecodeError("its brackets are nested too deeply") from None
    except ValueError:  # Python's limit for whole numbers from text
        raise tomllib.TOMLDecodeError("a number in it has too many digits") from None


def shown(value: object) -> str:
    """Write a value as it stands in a card, cut short where it is long."""
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}... ({len(text):,} characters)"
