"""The file of missing torque: one row for each row of each recording, empty where nothing can be said."""

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Array, Trace
from cosim.support.files import replacing

if TYPE_CHECKING:
    import pyarrow as pa

ROWS = 2**19
"""Rows that are made and written at a time."""
HOLE = 1.5
"""A step of a trace longer than this many of its usual steps is a hole: nothing was judged inside."""


def write_missing_torque(traces: Sequence[Trace], recordings: Sequence[Recording], path: Path) -> None:
    """Write for each row what the refitted base leaves, its 95 % band, and what the effects leave, in N m (N).

    Values are null where the diagnosis says nothing: where filters settle at the ends of a recording, inside gaps and
    beside them, at readings that were left out.
    """
    from pyarrow import parquet

    tables = (one for both in zip(traces, recordings, strict=True) for one in _tables(*both))
    first = next(tables)
    with replacing(path, True) as partial, parquet.ParquetWriter(partial, first.schema) as file:
        for one in itertools.chain([first], tables):
            file.write_table(one)


def _tables(trace: Trace, recording: Recording) -> Iterator["pa.Table"]:
    """The rows of a recording, some at a time: all columns together are as large as the recording itself."""
    import pyarrow as pa

    signals = {"missing_torque": trace.missing, "band": trace.band, "after": trace.tau - trace.after}
    for first in range(0, len(recording), ROWS):
        t = recording.t[first : first + ROWS]
        silent, names = ~covered(trace.t, t), pa.array([recording.name]).take(pa.array(np.zeros(len(t), int)))
        columns = {n: pa.array(np.interp(t, trace.t, signal), mask=silent) for n, signal in signals.items()}
        yield pa.table({"recording": names, "t": t, **columns})


def covered(known: Array, wanted: Array) -> np.ndarray:
    """Which wanted times lie between two neighbouring known times, (rows,) of bool."""
    steps = np.diff(known)
    whole = np.concatenate([[False], steps <= HOLE * float(np.median(steps)), [False]])
    after = np.searchsorted(known, wanted, "right")
    return np.asarray(whole[after] | (known[after - 1] == wanted))
