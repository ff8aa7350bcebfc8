"""Output of EPICS' camonitor: a line is one reading of a process variable, its stamp, and its alarm if it has one.

    M1:TORQUE  2024-03-01 12:00:00.001234 0.125
    M1:POS     2024-03-01 12:00:00.001250 3.5 HIGH MINOR

Readings with the severity INVALID are no readings; lines of what is not connected, and of arrays, are left out.
Source: caMonitor.c of EPICS base: "%s %s", name and time stamp, then the value and, if there is an alarm, status and
severity.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_cells, several, short
from cosim.data.long_form import by_signal

READING = re.compile(
    r"(?P<name>\S+)\s+(?P<date>\d{4}-\d\d-\d\d)\s+(?P<time>\d\d:\d\d:\d\d(?:\.\d{1,9})?)\s+(?P<value>\S+)(?P<alarm>.*)"
)
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
LEAST = 3
"""Lines of the first ones that must be readings."""


def recognises(lines: Sequence[str]) -> bool:
    """Whether a text is the output of camonitor."""
    written = [line for line in lines[:40] if line.strip()]
    return sum(READING.fullmatch(line.strip()) is not None for line in written) >= max(LEAST, len(written) // 2)


def read(path: Path, data: bytes, lines: Sequence[str]) -> Columns:
    """Read the output of camonitor; each process variable is a channel with times of its own."""
    written = [line.strip() for line in data.decode("utf-8", "replace").split("\n") if line.strip()]
    check_cells(path, len(written), 2)
    found = [READING.fullmatch(line) for line in written]
    good = [one for one in found if one and _is_one_number(one)]
    odd = [line for line, one in zip(written, found, strict=True) if not (one and _is_one_number(one))]
    if not good:
        return Columns({})
    stamps = np.array([f"{one['date']}T{one['time']}" for one in good], dtype="datetime64[ns]")
    seconds = (stamps - stamps.min()).astype(np.int64) * 1e-9
    values = np.array([float(one["value"]) if "INVALID" not in one["alarm"] else np.nan for one in good])
    names = np.array([one["name"] for one in good], dtype=object)
    channels, clocks = by_signal(names, seconds, values)
    said = several(len(odd), "line that is no reading was", "lines that are no reading were")
    notes = (f"{path.stem}: {said} left out, such as {short(odd[0])!r}.",) if odd else ()
    return Columns(
        channels, format="EPICS camonitor", start=str(stamps.min().astype("datetime64[ms]")), notes=notes, clocks=clocks
    )


def _is_one_number(reading: re.Match[str]) -> bool:
    """Whether a reading is one number, and what stands behind it an alarm and no further value of an array."""
    behind = reading["alarm"].split()
    return NUMBER.fullmatch(reading["value"]) is not None and not any(map(NUMBER.fullmatch, behind))
