"""Parquet: columns with units in the metadata of their fields, and an origin in that of the file."""

import json
from pathlib import Path
from typing import Any

from cosim.data.columns import ORIGIN_KEY, UNIT_KEY, Columns
from cosim.data.limits import check_cells
from cosim.data.text.table import as_array


def read(path: Path) -> Columns:
    """Read a Parquet file; an origin that is none is left out with a note."""
    from pyarrow import default_memory_pool, parquet

    with parquet.ParquetFile(path) as file:
        check_cells(path, file.metadata.num_rows, len(file.schema_arrow))
        table, metadata = file.read(), file.metadata.metadata or {}
    default_memory_pool().release_unused()  # what was unpacked on the way: a fifth of large recordings
    units = {field.name: (field.metadata or {}).get(UNIT_KEY, b"").decode("utf-8", "replace") for field in table.schema}
    values = {name: as_array(table[name]) for name in table.column_names if not name.startswith("__index_level_")}
    origin = _origin(metadata.get(ORIGIN_KEY, b"{}"))
    notes = () if isinstance(origin, dict) else (f"{path.stem}: its origin was left out, as it is no table of facts.",)
    stated = {name: unit for name, unit in units.items() if unit}
    return Columns(values, stated, origin if isinstance(origin, dict) else {}, notes=notes)


def _origin(text: bytes) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None
