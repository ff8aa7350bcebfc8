"""Small pieces of HTML with which results show themselves in a notebook."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any


def facts(title: str, values: Mapping[str, Any]) -> str:
    """Write a title and pairs of name and value as a table."""
    rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>" for name, value in values.items())
    return f"<p><b>{escape(title)}</b></p><table>{rows}</table>"


def table(title: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Write rows with the same keys as a table under a title."""
    if not rows:
        return ""
    head = "".join(f"<th>{escape(name)}</th>" for name in rows[0])
    body = "".join("<tr>" + "".join(f"<td>{escape(str(v))}</td>" for v in row.values()) + "</tr>" for row in rows)
    return f"<p><b>{escape(title)}</b></p><table><tr>{head}</tr>{body}</table>"


def text(lines: str) -> str:
    """Write text as it stands on a terminal."""
    return f"<pre>{escape(lines)}</pre>"
