"""Log files of LinuxCNC's halscope: a sampling period, then pairs of a pin's name and its value.

    Sampling period is 1000000 ns

    joint.0.motor-pos-fb +1.25000000000000 pid.0.output -0.31000000000000

Machinekit writes `nSec` for `ns`, and `(null)` for a channel that records nothing.
Source: `write_log_file` in src/hal/utils/scope_files.c of LinuxCNC, and of Machinekit.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_cells, short
from cosim.support.errors import RecordingError

PERIOD = re.compile(r"Sampling period is ([0-9]{1,12}) n(?:s|Sec)\b")
UNUSED = "(null)"
"""Name of a channel without a pin."""


def recognises(lines: Sequence[str]) -> bool:
    """Whether a text is a log of halscope."""
    return bool(lines) and PERIOD.match(lines[0]) is not None


def read(path: Path, data: bytes, lines: Sequence[str]) -> Columns:
    """Read a log of halscope; time starts at 0 and steps by the sampling period, and is none where that is 0."""
    found = PERIOD.match(lines[0])
    period = int(found[1]) * 1e-9 if found else 0.0
    rows = [row for line in data.decode("utf-8", "replace").split("\n")[1:] if (row := line.split())]
    if not rows:
        return Columns({})
    labels = rows[0][::2]
    check_cells(path, len(rows), len(labels))
    whole = rows if rows[-1][::2] == labels and len(rows[-1]) % 2 == 0 else rows[:-1]
    torn = next((number for number, row in enumerate(whole, 1) if row[::2] != labels or len(row) % 2), 0)
    if torn:
        text = f"{path}: row {torn:,} does not name the pins of the first row: {short(' '.join(whole[torn - 1]))!r}."
        raise RecordingError(text, culprit=str(path), value=torn)
    values = np.array([row[1::2] for row in whole], dtype=np.float64)
    table = {label: values[:, place] for place, label in enumerate(labels) if label != UNUSED}
    time = {"t": np.arange(len(values)) * period} if period else {}
    return Columns(time | table, dict.fromkeys(time, "s"), format="LinuxCNC halscope")
