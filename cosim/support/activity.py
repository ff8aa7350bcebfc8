"""What a process is at, in memory that the process which watches it can read: so a crash has a name.

    bytes 0 .. 4095       a component and what is done with it, two lines; empty between such pieces of work
    bytes 4096 .. 8191    the loop (`loop.h`), with its tick and the component whose functions it calls
    bytes 8192 .. 65535   the names of the components in the order of the loop, one a line

No call into the system and no lock are needed. A process that nobody watches has a board too.
"""

import ctypes
import mmap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar
from weakref import ref

SIZE, LOOP, NAMES = 65_536, 4_096, 8_192
"""Bytes of a board, and where the loop and the names begin."""
S = TypeVar("S", bound=ctypes.Structure)


class Board:
    """The memory of one process; without a file nobody else can read it."""

    def __init__(self, path: Path | None = None) -> None:
        self._shown: Callable[[], Any] = lambda: None
        if path is None:
            self._memory: Any = bytearray(SIZE)
            return
        path.touch()
        with path.open("r+b") as file:
            file.truncate(SIZE)
            self._memory = mmap.mmap(file.fileno(), SIZE)

    def write(self, name: str = "", what: str = "") -> None:
        """Say what is being done with a component; nothing where both are empty."""
        self._put(0, LOOP, f"{name}\n{what}")

    def loop(self, kind: type[S], names: Sequence[str]) -> S:
        """Return a structure for a loop of components: on the board, or elsewhere while another loop lives there."""
        if self._shown() is not None:
            return kind()
        made = self.read_loop(kind)
        ctypes.memset(ctypes.byref(made), 0, ctypes.sizeof(made))
        self._shown = ref(made)
        self._put(NAMES, SIZE, "\n".join(names))
        return made

    def read_loop(self, kind: type[S]) -> S:
        """Return what lies on the board."""
        return kind.from_buffer(self._memory, LOOP)

    @property
    def work(self) -> tuple[str, str]:
        """A component and what is being done with it."""
        name, _, what = self._read(0, LOOP).partition("\n")
        return name, what

    @property
    def names(self) -> list[str]:
        """The components of the loop."""
        return self._read(NAMES, SIZE).split("\n")

    def _put(self, first: int, end: int, text: str) -> None:
        content = text.encode()[: end - first - 1]
        self._memory[first : first + len(content) + 1] = content + b"\0"

    def _read(self, first: int, end: int) -> str:
        return bytes(self._memory[first:end]).partition(b"\0")[0].decode("utf-8", "replace")


_BOARDS = [Board()]


def board() -> Board:
    """Return the board of this process."""
    return _BOARDS[-1]


def watched(path: Path) -> None:
    """Let another process read from now on what this one does."""
    _BOARDS.append(Board(path))


@contextmanager
def doing(name: str, what: str) -> Iterator[None]:
    """Say while the block lasts what is being done with a component: "is loaded"."""
    here = board()
    here.write(name, what)
    try:
        yield
    finally:
        here.write()
