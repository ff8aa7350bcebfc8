"""Parquet: columns with units in the metadata of their fields, and an origin in that of the file.

Columns of structs and of lists of one length, as data sets of robots have them, are columns each: `state.1`, `state.2`.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cosim.data.binary.channels import columns_of_arrays
from cosim.data.columns import ORIGIN_KEY, UNIT_KEY, Columns
from cosim.data.limits import NUMBER, check_cells, check_unpacked, short
from cosim.data.text.table import as_array


def read(path: Path) -> Columns:
    """Read a Parquet file; an origin that is none is left out with a note."""
    from pyarrow import default_memory_pool, parquet

    with parquet.ParquetFile(path) as file:
        check_cells(path, file.metadata.num_rows, len(file.schema_arrow))
        texts = _check_declared(path, file.metadata)
    with parquet.ParquetFile(path, read_dictionary=texts, pre_buffer=False) as file:  # it would hold the whole file
        table, metadata = file.read(), file.metadata.metadata or {}
    _check_texts(path, table)
    units = {field.name: (field.metadata or {}).get(UNIT_KEY, b"").decode("utf-8", "replace") for field in table.schema}
    if table.num_rows == 1 and (one_row := _of_one_row(path, table, units)):
        return one_row
    columns = [(name, table[name]) for name in table.column_names if not name.startswith("__index_level_")]
    leaves = dict(leaf for name, column in columns for leaf in _leaves(path, name, column))
    check_cells(path, table.num_rows, len(leaves))
    values = {name: as_array(column) for name, column in leaves.items()}
    origin = _origin(metadata.get(ORIGIN_KEY, b"{}"))
    notes = () if isinstance(origin, dict) else (f"{path.stem}: its origin was left out, as it is no table of facts.",)
    stated = {name: unit for name, unit in units.items() if unit}
    del table, columns, leaves
    default_memory_pool().release_unused()  # what was unpacked on the way: a fifth of large recordings
    return Columns(values, stated, origin if isinstance(origin, dict) else {}, notes=notes)


def _of_one_row(path: Path, table: Any, units: Mapping[str, str]) -> Columns | None:
    """Return a table whose single row holds lists: a signal each, as those of MAT files are; None of any other."""
    import pyarrow as pa

    kinds = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
    lists = [field.name for field in table.schema if any(is_one(field.type) for is_one in kinds)]
    cells = {name: table[name][0].values for name in lists if table[name][0].is_valid}
    check_cells(path, sum(map(len, cells.values())), 1)
    arrays = {name: as_array(pa.chunked_array([cell])) for name, cell in cells.items()}
    if not any(one.dtype.kind == "f" and len(one) > 1 for one in arrays.values()):
        return None
    return columns_of_arrays(path, arrays, units)


def _check_declared(path: Path, metadata: Any) -> list[str]:
    """Refuse a file whose columns say that they unpack to more than it may; returns those of texts.

    A page of repeats claims few bytes and holds any number of values, so both are counted.
    """
    size, texts = 0, []
    for number in range(metadata.num_columns):
        column = metadata.schema.column(number)
        width = max(column.length, NUMBER)
        parts = [metadata.row_group(group).column(number) for group in range(metadata.num_row_groups)]
        size += sum(max(part.num_values * width, part.total_uncompressed_size) for part in parts)
        check_unpacked(path, size, f"column {short(column.path)}")
        texts += [column.path] if column.physical_type == "BYTE_ARRAY" else []
    return texts


def _check_texts(path: Path, table: Any) -> None:
    """Refuse texts that take more than a file may unpack to once each row has its own: one text may be in each row."""
    import pyarrow as pa

    size = 0
    for name in table.column_names:
        for part in table[name].chunks if pa.types.is_dictionary(table[name].type) else ():
            import pyarrow.compute as pc  # a tenth of a second that a table of numbers does not need

            lengths = pc.binary_length(part.dictionary)
            size += pc.sum(lengths.take(part.indices)).as_py() or 0
            check_unpacked(path, size, f"column {short(name)}")


def _leaves(path: Path, name: str, column: Any) -> Iterator[tuple[str, Any]]:
    """Walk through a column to its numbers: fields of structs by name, lists of one length by number from 1."""
    import pyarrow as pa

    kind = column.type
    if not pa.types.is_nested(kind):
        yield name, column
        return
    import pyarrow.compute as pc  # a tenth of a second that a table of numbers does not need

    if pa.types.is_struct(kind):
        for place, member in enumerate(kind):
            yield from _leaves(path, f"{name}.{member.name}", pc.struct_field(column, [place]))
    elif width := _width(column):
        check_cells(path, len(column), width)
        for place in range(width):
            yield from _leaves(path, f"{name}.{place + 1}", pc.list_element(column, place))
    else:
        yield name, column


def _width(column: Any) -> int:
    """Return how many values each list of a column holds; 0 if it holds no lists, or lists of several lengths."""
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    if pa.types.is_fixed_size_list(kind):
        return 0 if column.null_count else int(kind.list_size)
    if column.null_count or not (pa.types.is_list(kind) or pa.types.is_large_list(kind)) or not len(column):
        return 0
    lengths = pc.min_max(pc.list_value_length(column))
    return int(lengths["min"].as_py()) if lengths["min"] == lengths["max"] else 0


def _origin(text: bytes) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None
