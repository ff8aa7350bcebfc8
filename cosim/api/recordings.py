"""`cosim.read`: a file, a data frame or a dict of arrays to a `Recording`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cosim.data.recording import REQUIRED, Recording
from cosim.support.errors import InputError

Source = Any
"""A path, a `Recording`, a pandas `DataFrame`, or a mapping of column to array."""


def read(
    source: Source,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    name: str = "recording",
    required: tuple[str, ...] = REQUIRED,
    layout: Mapping[str, str] | None = None,
) -> Recording:
    """Read and judge a recording; nothing is repaired, resampled or clipped.

    Args:
        source: path of a text (also .gz), Parquet, MAT, HDF5, MDF4 or MCAP file; a pandas `DataFrame` (an index named
            "t" is the time); a mapping of column to array of shape (rows,); or a `Recording`, returned as it is.
        columns: our name to the source's, {"tau": "force"}. Ours are `t` [s], `tau` [N.m; N on a linear axis],
            `q` [rad; m] or a measured speed `v` [rad/s; m/s], `q_d` [as q], `temperature` [degC].
        units: our name to the unit in the source, {"q": "arcsec"}; values become SI.
        name: what a table in memory is called in messages and reports; a file has a name of its own.
        required: columns that must be there, be finite and move ("q|v": either); () for any table with a time.
        layout: CSV format, {"decimal": "comma"}; see `Recording.read`.

    Returns:
        `Recording`: float64 columns of shape (rows,), with units, origin and notes.

    Raises:
        RecordingError: a column is missing, constant or not finite, time does not grow, or there are too few rows; the
            sentence names source, column, row and value.
        UnitError: a unit is unknown.
        MissingPackageError: the format needs a package that is not installed.
    """
    if isinstance(source, Recording):
        return source
    if isinstance(source, str | Path):
        return Recording.read(source, columns, units, required, layout)
    return Recording.of(_table(source), name, columns, units, required)


class Written(NamedTuple):
    """How sources are written: our name to theirs, our name to their unit, and of texts the layout."""

    columns: Mapping[str, str] | None = None
    units: Mapping[str, str] | None = None
    layout: Mapping[str, str] | None = None

    def with_columns_of(self, columns: Mapping[str, str]) -> "Written":
        """The same with a card's columns, which come after those that are given."""
        return self._replace(columns=dict(columns) | dict(self.columns or {}))


def read_all(
    sources: Source | Sequence[Source],
    kind: str,
    columns: Mapping[str, str] | None,
    units: Mapping[str, str] | None,
    layout: Mapping[str, str] | None = None,
) -> list[Recording]:
    """Read one recording or several; tables in memory are called "`kind` 1", "`kind` 2", ..."""
    several = sources if isinstance(sources, list | tuple) else [sources]
    return [
        read(one, columns=columns, units=units, name=f"{kind} {k}", layout=layout) for k, one in enumerate(several, 1)
    ]


def at_least_one(recordings: list[Recording]) -> list[Recording]:
    """Refuse a call without a recording (InputError)."""
    if not recordings:
        said = "No recording was given: give one at least, a path, a table or a Recording."
        raise InputError(said, culprit="recordings", value=0)
    return recordings


def _table(source: Any) -> dict[str, Any]:
    """Columns of a data frame or mapping by name."""
    if not hasattr(source, "columns"):
        return dict(source)
    index = {"t": source.index.to_numpy()} if source.index.name == "t" and "t" not in source.columns else {}
    return index | {str(name): source[name].to_numpy() for name in source.columns}
