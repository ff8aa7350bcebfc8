"""Write recordings: at once, or streamed row by row without holding the run in memory."""

import gzip
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv, parquet

from cosim.files import check_free, directory
from cosim.formats import ORIGIN_KEY, UNIT_KEY
from cosim.interrupts import uninterrupted

Table = Mapping[str, np.ndarray]
GROUP = 65_536
"""Rows of a row group in a streamed file."""
ENCODING = {"use_dictionary": False, "compression": "none", "write_statistics": False}
"""Doubles of a simulation hardly compress; plain pages are written about as fast as the disk takes them."""


class MemoryWriter:
    """Keeps what is written, for runs whose recording is wanted as arrays."""

    def __init__(self, units: Mapping[str, str], origin: dict[str, Any]) -> None:
        self.units, self.origin, self.rows = dict(units), origin, 0
        self._chunks: list[Table] = []

    def write(self, table: Table) -> None:
        """Append rows; `table` has the columns of `units`, each of shape (rows,)."""
        self._chunks.append(table)
        self.rows += len(next(iter(table.values())))

    def table(self) -> dict[str, np.ndarray]:
        """Return all rows by column."""
        empty = np.empty(0)
        return {name: np.concatenate([empty, *(chunk[name] for chunk in self._chunks)]) for name in self.units}

    def clear(self) -> None:
        """Forget the rows that were taken out; the count goes on."""
        self._chunks = []

    def close(self) -> None:
        """Do nothing; the rows stay."""


class StreamWriter(MemoryWriter):
    """A Parquet file that grows chunk by chunk and takes its name when it is closed.

    Closing makes the file complete whatever ended the run; `origin` may be filled until then.
    """

    def __init__(self, path: Path, units: Mapping[str, str], origin: dict[str, Any], force: bool = False) -> None:
        super().__init__(units, origin)
        check_free(path, force)
        self.path, self._written = path, 0
        self._partial = directory(path.parent) / f".{path.name}.{os.getpid()}.partial"
        self._schema = schema(units)
        self._file = parquet.ParquetWriter(self._partial, self._schema, **ENCODING)

    def write(self, table: Table) -> None:
        """Append rows; they go to the file in groups of at least GROUP."""
        super().write(table)
        if self.rows - self._written >= GROUP:
            self._flush()

    def close(self) -> None:
        """Complete the file."""
        with uninterrupted():
            self._flush()
            self._file.add_key_value_metadata({ORIGIN_KEY: json.dumps(self.origin).encode()})
            self._file.close()
            os.replace(self._partial, self.path)

    def __enter__(self) -> "StreamWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _flush(self) -> None:
        if self.rows == self._written:
            return
        arrays = [_array(column) for column in self.table().values()]
        self._file.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        self.clear()
        self._written = self.rows


def _array(column: np.ndarray) -> Any:
    """Wrap a column for Arrow without a copy; `pyarrow.array` would import pandas, half a second of a run."""
    values = np.ascontiguousarray(column, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), len(values), [None, pa.py_buffer(values)])


def schema(units: Mapping[str, str]) -> Any:
    """Return the Arrow schema of a recording with these columns and units."""
    return pa.schema([pa.field(name, pa.float64(), metadata={UNIT_KEY: text.encode()}) for name, text in units.items()])


def write_parquet(path: Path, table: Table, units: Mapping[str, str], origin: Mapping[str, Any]) -> None:
    """Write a whole table with units and origin."""
    full = schema({name: units.get(name, "") for name in table})
    metadata = {ORIGIN_KEY: json.dumps(dict(origin)).encode()}
    arrow = pa.Table.from_arrays([_array(column) for column in table.values()], schema=full.with_metadata(metadata))
    parquet.write_table(arrow, path, **ENCODING)


def write_csv(path: Path, table: Table, units: Mapping[str, str], origin: Mapping[str, Any]) -> None:
    """Write a table as text; doubles keep all their digits, units are SI, the origin has no place in a CSV."""
    with path.open("wb") as file:
        csv.write_csv(pa.table(dict(table)), file)


def write_csv_gz(path: Path, table: Table, units: Mapping[str, str], origin: Mapping[str, Any]) -> None:
    """Write a table as compressed text."""
    with gzip.open(path, "wb") as file:
        csv.write_csv(pa.table(dict(table)), file)


WRITERS: dict[str, Callable[[Path, Table, Mapping[str, str], Mapping[str, Any]], None]] = {
    ".parquet": write_parquet,
    ".csv": write_csv,
    ".csv.gz": write_csv_gz,
}
