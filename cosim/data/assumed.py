"""Units that a file does not state: what is assumed is said, with the option that says otherwise."""

from collections.abc import Collection, Mapping
from pathlib import Path

from cosim.data.limits import short

SI = {"tau": "N.m or N", "q": "rad or m", "v": "rad/s or m/s"}
"""Units in which columns of ours are taken that state none; a file with our own names is in them by definition."""
EXAMPLES = {"tau": "mN.m", "q": "deg", "v": "rpm"}


def assumed(
    path: Path, columns: Collection[str], sources: Mapping[str, str], units: Mapping[str, str]
) -> tuple[str, ...]:
    """Note which columns are taken in SI units because nothing states a unit.

    Args:
        path: the file, for the note.
        columns: our columns that were read.
        sources: our names to the file's.
        units: the units that are stated, by our name.
    """
    silent = [ours for ours in SI if ours in columns and ours not in units and sources.get(ours, ours) != ours]
    if not silent:
        return ()
    told = ", ".join(f'"{short(sources[ours])}" ({ours} in {SI[ours]})' for ours in silent)
    option = " ".join(f"{ours}={EXAMPLES[ours]}" for ours in silent)
    return (f"{path.stem}: no unit is stated for {told}; if it is another, say which, for example --units {option}.",)
