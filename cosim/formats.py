"""File formats of recordings: bytes to named columns, nothing judged yet.

CSV (also .gz), Parquet, MAT (v5; v7.3 is HDF5), HDF5, MDF4. A column is float64, or object where the file holds text.
A CSV header may carry a unit in brackets, `q [deg]`; a Parquet file carries it in its field's metadata.
"""

import gzip
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from cosim.errors import CosimError, MissingPackageError, RecordingError

ORIGIN_KEY = b"cosim.origin"
UNIT_KEY = b"unit"


@dataclass(frozen=True)
class Columns:
    """What a file holds: columns of equal length by name, units where stated, origin where one was written."""

    values: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    origin: dict[str, Any] = field(default_factory=dict)


def read_columns(path: Path) -> Columns:
    """Read every column of a file.

    Raises:
        RecordingError: the file is missing, empty, of an unknown kind, or cannot be read.
        MissingPackageError: its format needs an optional package.
    """
    _check_file(path)
    reader = _READERS.get(_suffix(path))
    if reader is None:
        raise RecordingError(f"{path} is of no known kind; known are: {', '.join(_READERS)}.", culprit=str(path))
    try:
        columns = reader(path)
    except CosimError:
        raise
    except Exception as error:  # every reader has its own exceptions; each means the same to the user
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__
        raise RecordingError(f"{path} cannot be read as {_suffix(path)}: {reason}.", culprit=str(path)) from error
    if not any(len(values) for values in columns.values.values()):
        raise RecordingError(f"{path} holds no samples.", culprit=str(path))
    return columns


def _check_file(path: Path) -> None:
    if not path.exists():
        raise RecordingError(f"{path} does not exist.", culprit=str(path))
    if not path.is_file():
        raise RecordingError(f"{path} is not a file.", culprit=str(path))
    if path.stat().st_size == 0:
        raise RecordingError(f"{path} is empty.", culprit=str(path))


def _suffix(path: Path) -> str:
    return "".join(path.suffixes[-2:]).lower() if path.suffix.lower() == ".gz" else path.suffix.lower()


def _read_csv(path: Path) -> Columns:
    from pyarrow import csv

    data = gzip.decompress(path.read_bytes()) if path.suffix.lower() == ".gz" else path.read_bytes()
    comments, header = _header(data)
    delimiter = max(",;\t", key=header.count)
    table = csv.read_csv(
        pa.BufferReader(data),
        read_options=csv.ReadOptions(skip_rows=comments, block_size=len(data) + 1),
        parse_options=csv.ParseOptions(delimiter=delimiter),
        convert_options=csv.ConvertOptions(timestamp_parsers=[]),
    )
    named = [_split_unit(name) for name in table.column_names]
    values = {name: _array(column) for (name, _), column in zip(named, table.columns, strict=True)}
    return Columns(values, {name: unit for name, unit in named if unit})


def _header(data: bytes) -> tuple[int, str]:
    """Return the number of leading comment lines and the line after them."""
    for count, line in enumerate(data.splitlines()[:1000]):
        if not line.startswith(b"#"):
            return count, line.decode("utf-8-sig", "replace")
    return 0, ""


def _split_unit(header: str) -> tuple[str, str]:
    name, bracket, unit = header.strip().partition("[")
    return (name.strip(), unit.rstrip("] ")) if bracket and header.rstrip().endswith("]") else (header.strip(), "")


def _read_parquet(path: Path) -> Columns:
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        table, metadata = file.read(), file.metadata.metadata or {}
    units = {field.name: (field.metadata or {}).get(UNIT_KEY, b"").decode() for field in table.schema}
    values = {name: _array(table[name]) for name in table.column_names if not name.startswith("__index_level_")}
    origin = json.loads(metadata.get(ORIGIN_KEY, b"{}"))
    return Columns(values, {name: unit for name, unit in units.items() if unit}, origin)


def _array(column: Any) -> np.ndarray:
    kind = column.type
    numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)
    if numeric or pa.types.is_null(kind) or pa.types.is_decimal(kind):
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
    return np.asarray(column.to_pylist(), dtype=object)


def _read_mat(path: Path) -> Columns:
    with path.open("rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            return _read_hdf5(path)
    from scipy.io import loadmat

    found: dict[str, np.ndarray] = {}
    for name, value in loadmat(path, squeeze_me=True, simplify_cells=True).items():
        fields = value.items() if isinstance(value, dict) else [(name, value)]
        found |= {key: np.asarray(item) for key, item in fields if not name.startswith("__")}
    return Columns(_vectors(found))


def _read_hdf5(path: Path) -> Columns:
    h5py = _package("h5py", "hdf5", path)
    found: dict[str, np.ndarray] = {}
    with h5py.File(path, "r") as file:
        file.visititems(
            lambda name, item: found.update({name.split("/")[-1]: item[()]} if hasattr(item, "dtype") else {})
        )
    return Columns(_vectors({name: np.squeeze(value) for name, value in found.items()}))


def _read_mdf(path: Path) -> Columns:
    mdf = _package("asammdf", "mdf", path).MDF(path)
    frame = mdf.to_dataframe(time_from_zero=False)
    units = {name: str(mdf.get(name).unit or "") for name in frame.columns if name in mdf}
    values = {"t": frame.index.to_numpy()} | {name: frame[name].to_numpy() for name in frame.columns}
    mdf.close()
    return Columns(_vectors(values), {name: unit for name, unit in units.items() if unit})


def _vectors(found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Keep the numeric vectors that have the commonest length longer than one."""
    vectors = {name: value for name, value in found.items() if value.ndim == 1 and value.dtype.kind in "fiub"}
    lengths = Counter(len(value) for value in vectors.values() if len(value) > 1)
    rows = lengths.most_common(1)[0][0] if lengths else 0
    return {name: np.asarray(value, dtype=np.float64) for name, value in vectors.items() if len(value) == rows}


def _package(name: str, extra: str, path: Path) -> Any:
    from importlib import import_module

    try:
        return import_module(name)
    except ImportError as error:
        install = f"pip install 'mount-cosim[{extra}]'"
        raise MissingPackageError(f"{path} needs the package {name} to be read: {install}") from error


_READERS: dict[str, Callable[[Path], Columns]] = {
    ".csv": _read_csv,
    ".csv.gz": _read_csv,
    ".parquet": _read_parquet,
    ".mat": _read_mat,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".mf4": _read_mdf,
}
