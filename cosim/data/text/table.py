"""A table of text as columns: the preamble is left, the body is parsed at once."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

from cosim.data.columns import Columns, doubles
from cosim.data.limits import check_cells, short
from cosim.data.text.cells import lists_of, without_comments
from cosim.data.text.fields import NOTHING, is_number
from cosim.data.text.header import CLOCK_FORMAT, LABEL, NO_UNIT
from cosim.data.text.layout import MANY_SHORT, Layout
from cosim.data.text.names import split_unit
from cosim.data.text.unit_words import contradict, is_unit, spelled
from cosim.support.errors import RecordingError

NESTED = "a list"
"""What stands for each list of lengths that differ: it is no number, and millions of objects would be made of it."""


def table_of(path: Path, data: bytes, layout: Layout) -> Columns:
    """Parse the body of a text whose layout is known."""
    body, commented = _body(path, data, layout)
    body, restarts, again = _without_header(path, body, _head(data, layout))
    again = commented + again
    check_cells(path, body.count(b"\n"), layout.count)
    table, notes = _parsed(path, body, layout)
    names, units, contradictions = names_of(layout)
    pairs = zip(names, table.columns, strict=True)
    # A separator at the end of each row makes a column without a name that holds nothing.
    held = [(name, column) for name, column in pairs if name or not pa.types.is_null(column.type)]
    read = {name: _values(column, layout.decimal) for name, column in held}
    parted = {name: lists_of(path, column) for name, column in read.items()}
    kept = {
        (f"{name}.{k}" if parted[name] else name): one
        for name, column in read.items()
        for k, one in enumerate(parted[name] or [column], 1)
    }
    return Columns(
        kept,
        {name: unit for name, unit in units.items() if name in kept},
        notes=again + notes,
        missing=again + notes,
        numbered=not layout.names,
        restarts=restarts,
        contradictions=contradictions,
        header=layout.line,
    )


def _values(column: Any, decimal: str) -> np.ndarray:
    """Return a column of text as numbers where it holds some: thousands may be parted, and empty cells hold blanks."""
    found = as_array(column)
    if found.dtype != object:
        return found
    texts = [None if text is None or not str(text).strip() else str(text).strip() for text in found]
    if all(text is None or is_number(text, decimal) for text in texts) and any(texts):
        return np.array([np.nan if text is None else float(text.replace(decimal, ".")) for text in texts])
    return grouped(found, decimal)


def _head(data: bytes, layout: Layout) -> tuple[bytes, ...]:
    """Return the lines of names and units above the first sample, as they stand in the file."""
    above = data.split(b"\n", layout.first)[: layout.first]
    written = [line.strip() for line in above if line.strip()]
    return tuple(written[-(1 + bool(layout.units)) :]) if layout.names else ()


def _without_header(path: Path, body: bytes, head: Sequence[bytes]) -> tuple[bytes, tuple[int, ...], tuple[str, ...]]:
    """Leave out the names of the columns where they stand again among the samples: a logger that was started anew.

    Returns the body without them, the rows (from 0) before which they stood, and a note.
    """
    if not any(line in body for line in head):
        return body, (), ()
    lines = [line for line in body.split(b"\n") if line.strip()]
    kept = [line for line in lines if line.strip() not in head]
    at = [row for row, line in enumerate(lines) if line.strip() in head]
    restarts = tuple(row - before for before, row in enumerate(at))
    told = f"the names of the columns stand again at row {at[0] + 1:,}" if at else ""
    note = f"{path.stem}: {told}; such lines were left out ({len(at):,})."
    return b"\n".join(kept), restarts, ((note,) if at else ())


def grouped(column: np.ndarray, decimal: str) -> np.ndarray:
    """Read numbers whose thousands are parted, `1,931.5` or `1.931,5`; any other column is returned as it is.

    One of them must have a group and a decimal sign, or two groups: `1,931` alone may be 1.931.
    """
    sign = "." if decimal == "," else ","
    part = rf"({re.escape(decimal)}\d+)?"
    number = re.compile(rf"[+-]?(\d{{1,3}}({re.escape(sign)}\d{{3}})*|\d+){part}")
    texts = [str(text) for text in column] if column.dtype == object else []
    if not texts or not all(number.fullmatch(text) for text in texts):
        return column
    if not any(text.count(sign) > 1 or (sign in text and decimal in text) for text in texts):
        return column
    return np.array([float(text.replace(sign, "").replace(decimal, ".")) for text in texts])


def _body(path: Path, data: bytes, layout: Layout) -> tuple[bytes, tuple[str, ...]]:
    """Return the samples as text, runs of blanks as tabs, without comments; and notes on what was left out."""
    start = 0
    for _ in range(layout.first):
        start = data.find(b"\n", start) + 1
    body, notes = without_comments(path, data[start:] if start else data)
    if layout.torn:
        notes = (*notes, f"{path.stem}: the first row was left out; names and first value stand in it as one word.")
    if layout.separator == " ":
        body = b"\n".join(b"\t".join(line.split()) for line in body.split(b"\n"))
    return layout.sample.encode() + b"\n" + body if layout.sample else body, notes


def _parsed(path: Path, body: bytes, layout: Layout) -> tuple[Any, tuple[str, ...]]:
    """Parse rows; what is no row is left out with a note if it is a comment or ends the file, and refused elsewhere.

    Rows that end before the last column are read as far as they go where that column is missing in many of them.
    """
    odd: list[Any] = []
    try:
        return _read(body, layout, None), ()
    except pa.ArrowInvalid as error:
        if "Expected" not in str(error):
            raise

    _check_utf8(path, body)  # the parser cannot hand over a row that is none

    def skip(row: Any) -> str:
        odd.append(row)
        return "skip"

    table = _read(body, layout, skip)
    samples = [row for row in odd if not _is_remark(row.text)]
    if _lacks_its_last(samples, len(table), layout):
        return _filled(path, body, layout, len(samples))
    torn = next((row for row in samples if row.number <= len(table)), None)
    if torn is not None:
        text = f"{path}: row {torn.number:,} has {torn.actual_columns} fields where the others have {layout.count}: "
        raise RecordingError(f"{text}{short(torn.text)!r}.", culprit=str(path), value=torn.actual_columns)
    lines = f"{len(odd)} lines that are no samples were" if len(odd) > 1 else "one line that is no sample was"
    return table, (f"{path.stem}: {lines} left out, such as {short(odd[-1].text)!r}.",)


def _lacks_its_last(samples: Sequence[Any], rows: int, layout: Layout) -> bool:
    """Whether many rows have all columns but the last: a few such rows are torn, and no value in them is certain."""
    short_by_one = all(row.actual_columns == layout.count - 1 for row in samples)
    return layout.count > 2 and short_by_one and len(samples) > MANY_SHORT * (rows + len(samples))


def _filled(path: Path, body: bytes, layout: Layout, missing: int) -> tuple[Any, tuple[str, ...]]:
    """Parse rows of which many end before the last column; nothing is read there."""
    sign = b"\t" if layout.separator == " " else layout.separator.encode()
    lines = [line.rstrip(b"\r") for line in body.split(b"\n") if line.strip()]
    whole = [line + sign if line.count(sign) == layout.count - 2 else line for line in lines]
    table, notes = _parsed(path, b"\n".join(whole), layout)
    name = layout.names[-1] if layout.names else f"#{layout.count}"
    note = f'{path.stem}: {missing:,} rows end before the last column, "{short(name)}"; it is empty there.'
    return table, (*notes, note)


def _check_utf8(path: Path, body: bytes) -> None:
    """Refuse a text whose head was UTF-8, and that later is not."""
    try:
        body.decode()
    except UnicodeDecodeError as error:
        row = body.count(b"\n", 0, error.start) + 1
        text = (
            f"{path}: row {row:,} holds bytes that are no UTF-8; --layout encoding=cp1252 (or another) says what it is."
        )
        raise RecordingError(text, culprit=str(path), value=row) from None


def _is_remark(text: str) -> bool:
    return text.lstrip().startswith(("#", "%", "//")) or not any(one.isdigit() for one in text)


SMALL = 4_000_000
"""Bytes that are read without threads: one that still lets go of the text while the process ends takes it down."""


def _read(body: bytes, layout: Layout, odd: Any) -> Any:
    return csv.read_csv(
        pa.BufferReader(body),
        read_options=csv.ReadOptions(
            column_names=[str(number) for number in range(layout.count)],
            block_size=len(body) + 1,
            use_threads=odd is None and len(body) > SMALL,  # rows are numbered only without threads
        ),
        parse_options=csv.ParseOptions(
            delimiter="\t" if layout.separator == " " else layout.separator, invalid_row_handler=odd
        ),
        convert_options=csv.ConvertOptions(decimal_point=layout.decimal, null_values=[*NOTHING]),
    )


def names_of(layout: Layout) -> tuple[list[str], dict[str, str], dict[str, tuple[str, str]]]:
    """Return the name of each column, the units that names and a row of units state, and where these contradict.

    Columns that differ by their unit alone keep it in their name; those of one name have their number there.
    """
    if not layout.names:
        numbered = [f"#{number + 1}" for number in range(layout.count)]
        return numbered, _stated(numbered, layout.labels), {}
    whole = [name.strip().strip("'").strip() for name in layout.names]
    parted = [split_unit(name) for name in whole]
    names = _distinct([name for name, _ in parted], whole)
    named = {name: unit for name, (_, unit) in zip(names, parted, strict=True) if unit}
    rows = _stated(names, layout.labels) | _stated(names, layout.units)
    twice = {name: (unit, rows[name]) for name, unit in named.items() if name in rows}
    contradictions = {name: both for name, both in twice.items() if all(map(is_unit, both)) and contradict(*both)}
    return names, rows | named, contradictions


def _stated(names: Sequence[str], texts: Sequence[str]) -> dict[str, str]:
    """Return units by the names of their columns; one that is not known is kept, so that it is asked for."""
    rows = {name: text.strip("[]() ") for name, text in zip(names, texts, strict=False)}
    said = {name: text for name, text in rows.items() if text.lower() not in NO_UNIT and not LABEL.search(text.lower())}
    return {name: spelled(text) for name, text in said.items() if not CLOCK_FORMAT.fullmatch(text)}


def _distinct(bare: Sequence[str], whole: Sequence[str]) -> list[str]:
    often, exactly = Counter(bare), Counter(whole)
    named = [long if often[name] > 1 and name else name for name, long in zip(bare, whole, strict=True)]
    return [
        f"{name} (#{place})" if name and exactly[long] > 1 else name
        for place, (name, long) in enumerate(zip(named, whole, strict=True), 1)
    ]


def as_array(column: Any) -> np.ndarray:
    """Return an Arrow column as float64, int64 where a double would lose digits, datetime64, or object for text."""
    kind = column.type
    if kind == pa.float64() and not column.null_count:
        return doubles(getattr(column, "chunks", [column]))
    if pa.types.is_timestamp(kind) or pa.types.is_date(kind):
        return np.asarray(column.cast(pa.timestamp("ns")).to_numpy(), dtype="datetime64[ns]")
    if pa.types.is_time(kind):
        return np.asarray(column.cast(pa.time64("ns")).cast(pa.int64()).to_numpy()).astype("timedelta64[ns]")
    if pa.types.is_integer(kind) and not column.null_count and _is_long(column):
        return np.asarray(column.to_numpy())
    numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)
    if numeric or pa.types.is_null(kind) or pa.types.is_decimal(kind):
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
    if pa.types.is_dictionary(kind):
        return _shared(column) if _is_text(kind.value_type) else as_array(column.cast(kind.value_type))
    if pa.types.is_nested(kind):
        return np.full(len(column), NESTED, dtype=object)
    return np.asarray(column.to_pylist(), dtype=object)


def _is_text(kind: Any) -> bool:
    tests = (pa.types.is_string, pa.types.is_large_string, pa.types.is_binary, pa.types.is_large_binary)
    return any(test(kind) for test in tests)


def _shared(column: Any) -> np.ndarray:
    """Return texts that stand once in a dictionary as one object each, however many rows have it."""
    parts = [np.empty(0, dtype=object)]
    for part in column.chunks:
        texts = np.array([*part.dictionary.to_pylist(), None], dtype=object)
        parts.append(texts[part.indices.fill_null(len(texts) - 1).to_numpy(zero_copy_only=False)])
    return np.concatenate(parts)


def _is_long(column: Any) -> bool:
    """Whether integers are beyond 2^53, from where on a double skips some."""
    values = column.to_numpy()
    return bool(len(values)) and max(abs(int(values.min())), abs(int(values.max()))) > 2**53
