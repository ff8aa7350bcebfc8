"""Texts, binaries and exact integers of a run by number, as the bus carries them (see pool.h)."""

import ctypes
from ctypes import c_char_p, c_int64, c_void_p

import numpy as np

from cosim.fmi.types import OPAQUE


class Pool:
    """The contents that the bus of one run names; equal contents have equal numbers, and 0 is the empty one.

    Args:
        library: the compiled loop.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        library.pool_new.restype, library.pool_new.argtypes = c_void_p, []
        library.pool_free.restype, library.pool_free.argtypes = None, [c_void_p]
        library.pool_number.restype, library.pool_number.argtypes = c_int64, [c_void_p, c_char_p, c_int64]
        library.pool_read.restype = c_void_p
        library.pool_read.argtypes = [c_void_p, c_int64, ctypes.POINTER(c_int64)]
        library.pool_sweep.restype, library.pool_sweep.argtypes = c_int64, [c_void_p, c_void_p, c_int64]
        self._library = library
        self.address: int = library.pool_new()

    def __del__(self) -> None:
        if getattr(self, "address", 0):
            self._library.pool_free(self.address)

    def number(self, content: bytes) -> int:
        """Return the number of a content."""
        return int(self._library.pool_number(self.address, content, len(content)))

    def content(self, number: float) -> bytes:
        """Return the content that a number names."""
        size = c_int64()
        address = self._library.pool_read(self.address, int(number), ctypes.byref(size))
        return ctypes.string_at(address, size.value) if address else b""

    def column(self, numbers: np.ndarray, kind: str) -> np.ndarray:
        """Return what a recorded column names: text, bytes, or integers of 64 bits."""
        named, places = np.unique(numbers, return_inverse=True)
        contents = [self.content(number) for number in named]
        if kind not in OPAQUE:
            padded = (content or bytes(8) for content in contents)
            return np.frombuffer(b"".join(padded), dtype=np.dtype(kind.lower()))[places]
        values = [one.decode("utf-8", "replace") for one in contents] if kind == "String" else contents
        table = np.empty(len(values), dtype=object)
        table[:] = values
        return table[places]

    def sweep(self, numbers: np.ndarray) -> int:
        """Forget all but these; returns how many contents are left."""
        used = np.ascontiguousarray(numbers, dtype=np.float64)
        return int(self._library.pool_sweep(self.address, used.ctypes.data_as(c_void_p), c_int64(len(used))))
