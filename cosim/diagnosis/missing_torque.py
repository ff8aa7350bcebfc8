"""The file of missing torque: one row for each row of each recording, empty where nothing can be said."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.result import Array, Trace
from cosim.support.files import replacing

HOLE = 1.5
"""A step of a trace longer than this many of its usual steps is a hole: nothing was judged inside."""


def write_missing_torque(traces: Sequence[Trace], recordings: Sequence[Recording], path: Path) -> None:
    """Write for each row what the refitted base leaves, its 95 % band, and what the effects leave, in N m (N).

    Values are null where the diagnosis says nothing: where filters settle at the ends of a recording, inside gaps and
    beside them, at readings that were left out.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts = []
    for trace, recording in zip(traces, recordings, strict=True):
        silent = ~covered(trace.t, recording.t)
        signals = {"missing_torque": trace.missing, "band": trace.band, "after": trace.tau - trace.after}
        values = {name: np.interp(recording.t, trace.t, signal) for name, signal in signals.items()}
        columns = {name: pa.array(column, mask=silent) for name, column in values.items()}
        names = pa.array([recording.name] * len(recording))
        parts.append(pa.table({"recording": names, "t": recording.t, **columns}))
    with replacing(path, True) as partial:
        pq.write_table(pa.concat_tables(parts), partial)


def covered(known: Array, wanted: Array) -> np.ndarray:
    """Which wanted times lie between two neighbouring known times, (rows,) of bool."""
    step = HOLE * float(np.median(np.diff(known)))
    after = np.searchsorted(known, wanted, "right").clip(1, len(known) - 1)
    inside = (wanted >= known[0]) & (wanted <= known[-1])
    return np.asarray(inside & (known[after] - known[after - 1] <= step) | np.isin(wanted, known))
