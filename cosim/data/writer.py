"""Write recordings: at once, or streamed row by row without holding the run in memory."""

import gzip
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv, parquet

from cosim.data.columns import ORIGIN_KEY, UNIT_KEY
from cosim.support.errors import OutputError
from cosim.support.files import check_free, partial_of, take_place
from cosim.support.interrupts import uninterrupted
from cosim.support.plain import JsonObject

Table = Mapping[str, np.ndarray]
GROUP = 32_768
"""Rows of a row group in a streamed file at least: what the master hands over at once is not copied."""
ENCODING: JsonObject = {"use_dictionary": False, "compression": "none", "write_statistics": False}
"""Doubles of a simulation hardly compress; plain pages are written about as fast as the disk takes them."""

_TYPES = {"String": pa.string(), "Binary": pa.binary(), "Int64": pa.int64(), "UInt64": pa.uint64()}


class MemoryWriter:
    """Keeps what is written, for runs whose recording is wanted as arrays.

    Args:
        units: of all columns, by name.
        origin: what the recording says about where it comes from; may be filled until it is closed.
        kinds: FMI types of the columns that are no doubles: String, Binary, Int64, UInt64.
    """

    def __init__(self, units: Mapping[str, str], origin: JsonObject, kinds: Mapping[str, str] | None = None) -> None:
        self.units, self.origin, self.rows = dict(units), origin, 0
        self.kinds = dict(kinds or {})
        self._chunks: list[Table] = []

    def write(self, table: Table) -> None:
        """Append rows; `table` has the columns of `units`, each of shape (rows,)."""
        self._chunks.append(table)
        self.rows += len(next(iter(table.values())))

    def table(self) -> dict[str, np.ndarray]:
        """Return all rows by column."""
        return {name: _joined(self._chunks, name) for name in self.units}

    def take(self) -> list[Table]:
        """Hand over what was written since the last time; the count goes on."""
        chunks, self._chunks = self._chunks, []
        return chunks

    def close(self) -> None:
        """Do nothing; the rows stay."""


class StreamWriter(MemoryWriter):
    """A Parquet file that grows chunk by chunk and takes its name when it is closed.

    Closing makes the file complete whatever ended the run; `origin` may be filled until then. A thread puts one group
    of rows into the file while the next one is simulated: writing took a quarter of the time of a quick run.
    """

    def __init__(
        self,
        path: Path,
        units: Mapping[str, str],
        origin: JsonObject,
        force: bool = False,
        kinds: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(units, origin, kinds)
        check_free(path, force)
        self.path, self._written, self._force = path, 0, force
        self._partial = partial_of(path)
        self._schema = schema(units, self.kinds)
        self._file = parquet.ParquetWriter(self._partial, self._schema, **encoding(self.kinds))
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._under_way: Future[None] | None = None

    def write(self, table: Table) -> None:
        """Append rows; they go to the file in groups of at least GROUP."""
        super().write(table)
        if self.rows - self._written >= GROUP:
            self._flush()

    def close(self) -> None:
        """Complete the file; raises OutputError, and leaves no file, if it cannot be written."""
        with uninterrupted(), self._thread:
            try:
                self._complete()
            except OutputError:
                self._partial.unlink(missing_ok=True)
                raise
            except OSError as error:
                self._partial.unlink(missing_ok=True)
                message = f"{self.path} cannot be written: {error.strerror or error}."
                raise OutputError(message, culprit=str(self.path)) from error

    def __enter__(self) -> "StreamWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _complete(self) -> None:
        self._flush()
        self._wait()
        self._file.add_key_value_metadata({ORIGIN_KEY: json.dumps(self.origin).encode()})
        self._file.close()
        take_place(self._partial, self.path, self._force)

    def _flush(self) -> None:
        if self.rows == self._written:
            return
        self._wait()
        self._under_way = self._thread.submit(self._put, self.take())
        self._written = self.rows

    def _wait(self) -> None:
        """Wait for the group under way; what went wrong with it is raised here, and again when the file is closed."""
        if self._under_way:
            self._under_way.result()

    def _put(self, chunks: Sequence[Table]) -> None:
        arrays = [_array(_joined(chunks, field.name), field.type) for field in self._schema]
        self._file.write_table(pa.Table.from_arrays(arrays, schema=self._schema))


def _joined(chunks: Sequence[Table], name: str) -> np.ndarray:
    if len(chunks) == 1:
        return chunks[0][name]
    return np.concatenate([chunk[name] for chunk in chunks]) if chunks else np.empty(0)


def _array(column: np.ndarray, kind: Any = None) -> Any:
    """Wrap a column for Arrow without a copy; `pyarrow.array` would import pandas, half a second of a run."""
    if kind is not None and kind != pa.float64():
        return pa.array(column.tolist(), type=kind)
    values = np.ascontiguousarray(column, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), len(values), [None, pa.py_buffer(values)])


def schema(units: Mapping[str, str], kinds: Mapping[str, str] | None = None) -> Any:
    """Return the Arrow schema of a recording with these columns, units and (where not doubles) FMI types.

    Doubles are never null (NaN is a value), and a column that says so is written a tenth faster.
    """
    types = {name: _TYPES[kind] for name, kind in (kinds or {}).items()}
    named = ((name, types.get(name, pa.float64()), {UNIT_KEY: unit.encode()}) for name, unit in units.items())
    return pa.schema([pa.field(name, kind, kind != pa.float64(), metadata) for name, kind, metadata in named])


def encoding(kinds: Mapping[str, str]) -> JsonObject:
    """Return how a file is packed: of text and binaries, equal values are written once."""
    repeated = [name for name, kind in kinds.items() if kind in ("String", "Binary")]
    return {**ENCODING, "use_dictionary": repeated or False}


def write_parquet(path: Path, table: Table, units: Mapping[str, str], origin: Mapping[str, Any]) -> None:
    """Write a whole table with units and origin."""
    kinds = {name: kind for name, column in table.items() if (kind := kind_of(column))}
    full = schema({name: units.get(name, "") for name in table}, kinds)
    metadata = {ORIGIN_KEY: json.dumps(dict(origin)).encode()}
    arrays = [_array(column, field.type) for column, field in zip(table.values(), full, strict=True)]
    parquet.write_table(pa.Table.from_arrays(arrays, schema=full.with_metadata(metadata)), path, **encoding(kinds))


def kind_of(column: np.ndarray) -> str:
    """Return the FMI type of a column that is no doubles; empty for one that is."""
    if column.dtype != object:
        return {"int64": "Int64", "uint64": "UInt64"}.get(column.dtype.name, "")
    return "Binary" if len(column) and isinstance(column[0], bytes) else "String"


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
