"""Tables of text, as loggers write them."""

from collections.abc import Iterable
from pathlib import Path


def written(path: Path, header: str, *columns: Iterable[object], sep: str = ",", empty: str = "nan") -> Path:
    """Write columns, of numbers (nine digits) or of text, below a header; without a header the rows alone."""
    rows = zip(*columns, strict=True)
    lines = [sep.join(empty if x != x else x if isinstance(x, str) else f"{x:.9g}" for x in row) for row in rows]
    path.write_text("\n".join(([header] if header else []) + lines) + "\n", encoding="utf-8")
    return path


def rows(*columns: Iterable[object], separator: str = ",", decimal: str = ".", end: str = "") -> str:
    """Return the rows of a table, of numbers (nine digits) or of text, without names."""
    cells = [[x if isinstance(x, str) else f"{x:.9g}".replace(".", decimal) for x in column] for column in columns]
    return "".join(separator.join(row) + end + "\n" for row in zip(*cells, strict=True))
