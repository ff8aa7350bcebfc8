"""The table of a sweep: one row a run, with units and origin, as Parquet."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from cosim.data.columns import ORIGIN_KEY, UNIT_KEY
from cosim.support.files import replacing
from cosim.sweeps.job import Row

TYPES = {"run": pa.int64(), "status": pa.string(), "reason": pa.string()}


def write_table(
    path: Path, columns: Sequence[str], rows: Sequence[Row], units: Mapping[str, str], origin: Mapping[str, Any]
) -> None:
    """Write the rows; numbers that a failed run does not have are null."""
    fields = [pa.field(name, _type(name), metadata={UNIT_KEY: units.get(name, "").encode()}) for name in columns]
    schema = pa.schema(fields, metadata={ORIGIN_KEY: json.dumps(dict(origin)).encode()})
    arrays = [_array(one, [row[one.name] for row in rows]) for one in fields]
    with replacing(path, force=True) as partial:
        parquet.write_table(pa.Table.from_arrays(arrays, schema=schema), partial)


def _array(field: Any, values: Sequence[Any]) -> Any:
    numbers = map(float, values) if field.type == pa.float64() else values
    return pa.array(list(numbers), field.type, from_pandas=True)


def _type(name: str) -> Any:
    return TYPES.get(name, pa.float64())
