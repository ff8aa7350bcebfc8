"""The way into the page: a file that only its owner can read, and that leads to the address with the token.

The argument of a browser is seen by every user of the computer while it runs; the address must not be in it.
"""

import os
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from html import escape
from pathlib import Path

NAME = ".cosim-serve.html"
"""The file; it lasts as long as the server."""
PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}"><title>cosim</title></head>
<body><p><a href="{address}">Open the page of cosim</a></p></body></html>
"""


@contextmanager
def door(home: Path, address: str) -> Iterator[Path | None]:
    """Make the file in a folder, and remove it at the end; None where the folder takes none."""
    path = home / NAME
    try:
        yield _made(path, PAGE.format(address=escape(address)))
    finally:
        with suppress(OSError):
            path.unlink()


def show(path: Path) -> None:
    """Open the file in the user's browser, if there is one."""
    webbrowser.open(path.absolute().as_uri())


def _made(path: Path, text: str) -> Path | None:
    with suppress(OSError):
        path.unlink(missing_ok=True)  # of a server that was killed; or a link, which must not be followed
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        return path
    return None
