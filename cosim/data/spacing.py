"""Rows without a time that were taken evenly: `--layout period=1ms` says how far apart."""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cosim.data.columns import Columns
from cosim.support.errors import RecordingError
from cosim.support.units import unit

PERIOD = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)\s*(s|ms|us|ns)?")


def with_time(columns: Columns, layout: Mapping[str, str]) -> Columns:
    """Return columns with a time `t` from 0, if `layout` has a period.

    Raises:
        RecordingError: the period is none, or lines are missing between the samples.
    """
    if "period" not in layout:
        return columns
    found = PERIOD.fullmatch(layout["period"].strip())
    period = float(found[1]) * unit(found[2] or "s").factor if found and found[1].count(".") < 2 else 0.0
    if not 0 < period < np.inf:
        text = f"--layout period={layout['period']}: it is the time between two rows, for example 1ms or 0.001."
        raise RecordingError(text, culprit="period", value=layout["period"])
    if columns.missing:
        text = f"--layout period={layout['period']} needs evenly spaced rows: {' '.join(columns.missing)}"
        raise RecordingError(text, culprit="period", value=layout["period"])
    rows = len(next(iter(columns.values.values())))
    values = {"t": np.arange(rows) * period} | {name: column for name, column in columns.values.items() if name != "t"}
    return replace(columns, values=values, units=columns.units | {"t": "s"})
