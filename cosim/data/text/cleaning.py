"""What stands around numbers in a text and is none: comments between samples and behind them, and MATLAB's brackets."""

import re
from collections.abc import Sequence
from pathlib import Path

from cosim.data.limits import short

COMMENT = re.compile(rb"^[ \t]*(?:#(?!N|V|\d)|%|//)[^\n]*\n?", re.MULTILINE)
"""A line that is a comment; `#N/A` and `#NV` stand for no value, and `#3` is no comment either."""
BEHIND = re.compile(rb"^([ \t]*[+-]?\.?\d[^%#\n]*?)[ \t]+(?:%|//|#)[ \t]*[A-Za-z][^\n]*", re.MULTILINE)
"""A comment behind the numbers of a row."""
ENDS = re.compile(rb";[ \t]*(?=\r?$)", re.MULTILINE)
OPENS = re.compile(rb"^([ \t]*)[\w.]+[ \t]*=[ \t]*\[[ \t]*(?:\.\.\.)?", re.MULTILINE)
"""A matrix begins: `log = [`."""
CLOSES = re.compile(rb"\][ \t]*;?[ \t]*(?=\r?$)", re.MULTILINE)
SEPARATED = re.compile(r"\S[ \t,]+\S")
MOST = 0.8
"""Share of the lines with digits that must end with a semicolon for it to end rows and not to part columns."""


def without_comments(path: Path, body: bytes) -> tuple[bytes, tuple[str, ...]]:
    """Leave out lines between samples that are comments, with a note."""
    if not any(sign in body for sign in (b"#", b"%", b"//")):
        return body, ()
    lines = [found.group().decode("utf-8", "replace").strip() for found in COMMENT.finditer(body)]
    body = COMMENT.sub(b"", body)
    if not lines:
        return body, ()
    many = f"{len(lines):,} comments were" if len(lines) > 1 else "one comment was"
    return body, (f"{path.stem}: {many} left out between the samples, such as {short(lines[-1])!r}.",)


def without_remarks(data: bytes) -> bytes:
    """Return a text without the comments behind the numbers of its rows."""
    return BEHIND.sub(rb"\1", data) if any(sign in data for sign in (b" %", b" #", b" //", b"\t%", b"\t#")) else data


def without_brackets(data: bytes, lines: Sequence[str]) -> bytes:
    """Return a text whose rows end with a semicolon, as those of MATLAB, without it and the brackets of a matrix."""
    rows = [
        line.strip() for line in lines if any(sign.isdigit() for sign in line) and not line.lstrip().startswith("%")
    ]
    ended = [row for row in rows if row.endswith(";") and row.count(";") == 1 and SEPARATED.search(row)]
    if len(ended) < 2 or len(ended) < MOST * len(rows):
        return data
    return ENDS.sub(b"", CLOSES.sub(b"", OPENS.sub(rb"\1", data)))
