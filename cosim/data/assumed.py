"""Units that a file does not state: SI is assumed, and said with the option that says otherwise; or asked.

What no axis does in SI units is asked: a position that turns through more than `TURNED` rad may be one in degrees, a
speed of whole numbers beyond `FAST` is one in rpm, whole numbers that are a torque count something.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cosim.data import questions
from cosim.data.columns import Array
from cosim.data.limits import short

SI = {"tau": "N.m or N", "q": "rad or m", "v": "rad/s or m/s"}
"""Units in which columns of ours are taken that state none; a file with our own names is in them by definition."""
EXAMPLES = {"tau": "mN.m", "q": "deg", "v": "rpm"}
TURNED = 20.0
"""Span of a position [rad] beyond which it may as well be in degrees: three turns."""
FAST, FASTEST = 50.0, 1000.0
"""Speeds [rad/s] from which on whole numbers, and any, may as well be rpm: 480 and 9,550 rpm."""
WHOLE, DISTINCT = 5.0, 4
"""Span from which on whole numbers count something, and how many different ones are needed to say so."""


def assumed(
    path: Path, table: Mapping[str, Array], sources: Mapping[str, str], units: Mapping[str, str]
) -> tuple[str, ...]:
    """Note which columns are taken in SI units because nothing states a unit.

    Args:
        path: the file, for the note.
        table: our columns that were read, in the units of the file.
        sources: our names to the file's.
        units: the units that are stated, by our name.

    Raises:
        UndecidedError: a column is in no SI unit, as far as one can tell; the message names the option that decides.
    """
    silent = [ours for ours in SI if ours in table and ours not in units and sources.get(ours, ours) != ours]
    for ours in silent:
        if why := _implausible(ours, table[ours]):
            raise questions.no_unit(path, ours, sources[ours], why)
    if not silent:
        return ()
    told = ", ".join(f'"{short(sources[ours])}" ({ours} in {SI[ours]})' for ours in silent)
    option = " ".join(f"{ours}={EXAMPLES[ours]}" for ours in silent)
    return (f"{path.stem}: no unit is stated for {told}; if it is another, say which, for example --units {option}.",)


def _implausible(ours: str, column: Array) -> str:
    """Say why a column is hardly in SI units; empty where it may be."""
    span, largest = float(np.ptp(column)), float(np.abs(column).max())
    whole = bool((column == np.rint(column)).all()) and len(np.unique(column)) >= DISTINCT
    ends = f"goes from {column.min():.6g} to {column.max():.6g}"
    if whole and (largest > FAST if ours == "v" else span > WHOLE):
        return f"holds whole numbers and {ends}"
    limits = {"q": (span, TURNED), "v": (largest, FASTEST)}
    return ends if ours in limits and limits[ours][0] > limits[ours][1] else ""
