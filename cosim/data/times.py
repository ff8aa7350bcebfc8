"""Columns of time, however they count: time stamps, seconds since 1970, ms or us, checked against their sampling.

A servo is sampled at 10 Hz to 50 kHz, and a recording of it lasts 2 s at least. So a column without a unit that steps
by one second or more counts something smaller than seconds; where two units fit, where it steps by a tenth of a second
to one, or by less than 20 us as the days of a spreadsheet do, it is refused and `--units t=...` decides.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.data import questions
from cosim.data.assign import Assigned
from cosim.data.limits import short
from cosim.data.roles import is_named
from cosim.data.text.unit_words import is_unit
from cosim.support import units

SLOWEST, FASTEST = 10.0, 50e3
"""Rates at which servos are sampled [Hz]."""
SHORTEST = 2.0
"""Seconds below which a recording tells nothing (LEAST_SECONDS of the diagnosis)."""
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
YEARS = 1e9, 4.2e9
"""Seconds since 1970 of 2001 and 2103: a time between them is a date."""
DAY = 86_400.0
COUNTED = re.compile(r"(?<=:\d\d)[;:](\d{1,3})$")
"""Milliseconds that are counted behind the seconds, as in 22:13:04;75 and 22:13:04:075."""


@dataclass(frozen=True)
class Clock:
    """Time stamps, the unit they are in, when they start if that is known, and what was concluded.

    `origin` is the time of a 0 in ns since 1970, where the column holds dates from which it was taken off.
    """

    values: np.ndarray
    unit: str = ""
    start: str = ""
    notes: tuple[str, ...] = ()
    origin: int = 0

    @property
    def seconds(self) -> np.ndarray:
        """The time stamps in seconds; a unit that is not stated is seconds."""
        return np.asarray(self.values * self.size, np.float64)

    @property
    def size(self) -> float:
        """Seconds of one unit."""
        return units.unit(self.unit).factor if self.unit else 1.0


def clock_of(path: Path, served: Assigned, servo: bool = False) -> Clock:
    """Return the time among columns under our names as `read_clock` reads it."""
    return read_clock(path, served.values["t"], served.sources["t"], served.units.get("t", ""), servo)


def read_clock(path: Path, column: np.ndarray, name: str, stated: str, servo: bool) -> Clock:
    """Turn a column of time into numbers of one unit.

    Args:
        path: the file, for messages.
        column: the column as `Columns` has it.
        name: its name in the file.
        stated: its unit where it was stated.
        servo: whether its sampling must be one of a servo.

    Raises:
        UndecidedError: its unit is ambiguous; the message names the option that decides.
    """
    if column.dtype == object:
        column = _parsed(column)
    if column.dtype.kind in "mM":
        return _of_stamps(column)
    if column.dtype == object or len(column) < 2:
        return Clock(column, stated)
    unit = stated or _of_date(column)
    notes: tuple[str, ...] = ()
    if not unit and servo:
        unit = _of_sampling(path, column, name)
        notes = _unit_note(path, column, name, unit)
    values, start, origin = _since_first(column, unit)
    return Clock(values, unit, start, notes, origin)


def _parsed(column: np.ndarray) -> np.ndarray:
    """Read time stamps of text: 01.03.2024 22:13:04,5 and the like; text that is none stays."""
    import pandas as pd

    texts = [_pointed(str(text)) for text in column]
    if ":" not in texts[0]:
        return column
    try:
        if "-" in texts[0] or "/" in texts[0] or texts[0].count(".") > 1:
            stamps = pd.to_datetime(pd.Series(texts), format="mixed", dayfirst=texts[0][:4].count(".") > 0, utc=True)
            return np.asarray(stamps.dt.tz_localize(None), dtype="datetime64[ns]")
        return np.asarray(pd.to_timedelta(pd.Series(texts)), dtype="timedelta64[ns]")
    except (ValueError, OverflowError):
        return column


def _pointed(text: str) -> str:
    """Return a time stamp with a point before the parts of a second."""
    if text.count(":") > 1 and (found := COUNTED.search(text)):
        return f"{text[: found.start()]}.{int(found[1]):03d}"
    return text.replace(",", ".")


def _of_stamps(column: np.ndarray) -> Clock:
    """Return seconds since the first stamp; clocks of a day go on past midnight."""
    missing = np.isnat(column)
    valid = column[~missing]
    seconds = np.where(missing, np.nan, (column - valid[:1]).astype(np.int64) * 1e-9) if len(valid) else column
    if column.dtype.kind == "m":
        seconds = seconds + DAY * np.cumsum(np.concatenate([[0], np.diff(seconds) < -DAY / 2]))
    start = str(column[0].astype("datetime64[ms]")) if column.dtype.kind == "M" and not missing[0] else ""
    origin = int(valid[0].astype("datetime64[ns]").astype(np.int64)) if start else 0
    return Clock(np.asarray(seconds, dtype=np.float64), "s", start, origin=origin)


def check_slow(path: Path, column: np.ndarray, name: str, stated: str) -> None:
    """Ask for the unit of a time that steps by a second or more and states none, of a table that is no axis.

    Raises:
        UndecidedError: it may count seconds, or less; the message names the option that decides.
    """
    if stated or column.dtype.kind not in "iuf" or len(column) < 2 or _of_date(column):
        return
    values, _, step = _steps(column)
    if step >= 1 and not _is_since_1970(values):
        if not is_named(name, "time"):
            raise questions.counting(path, name, step, _fitting(step))
        fitting = _fitting(step)
        raise questions.rates(path, name, step, [*fitting, "s"], _rates(step, ("s", *fitting)))


def _is_since_1970(values: np.ndarray) -> bool:
    return bool(YEARS[0] <= values[0] <= YEARS[1])


def _of_date(column: np.ndarray) -> str:
    """Return the unit in which a column counts since 1970, or an empty text if it does not."""
    first = float(column[0])
    return next((unit for unit, size in SECONDS.items() if YEARS[0] <= first * size <= YEARS[1] and unit != "s"), "")


def _fitting(step: float) -> list[str]:
    """Return the units in which such a step is that of a servo."""
    return [unit for unit, size in SECONDS.items() if SLOWEST <= 1 / (step * size) <= FASTEST]


def _of_sampling(path: Path, column: np.ndarray, name: str) -> str:
    """Return the unit that makes the steps of a column those of a servo; seconds wherever they can be."""
    values, steps, step = _steps(column)
    if step > 0 and float(np.max(steps)) < 1 / FASTEST:
        raise questions.too_fast(path, name, step)
    if step <= 1 / SLOWEST:
        return ""
    if step < 1:
        raise questions.rates(path, name, step, ("ms", "s"), _rates(step, ("s", "ms"), " and "))
    if not is_named(name, "time") and not is_unit(name):
        raise questions.counting(path, name, step, _fitting(step))
    span = float(np.nanmax(values) - np.nanmin(values))
    fitting = _fitting(step)
    lasting = [unit for unit in fitting if span * SECONDS[unit] >= SHORTEST] or fitting
    if len(lasting) == 1:
        return lasting[0]
    raise questions.rates(path, name, step, lasting, _rates(step, lasting or SECONDS))


def _steps(column: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return a column as doubles, its steps where it has values, and their median."""
    values = column.astype(np.float64)
    steps = np.diff(values[np.isfinite(values)])
    return values, steps, float(np.median(steps)) if len(steps) else 0.0


def _rates(step: float, units: Iterable[str], joint: str = " or ") -> str:
    return joint.join(f"{1 / (step * SECONDS[unit]):.4g} Hz in {unit}" for unit in units)


def _unit_note(path: Path, column: np.ndarray, name: str, unit: str) -> tuple[str, ...]:
    if not unit:
        return ()
    rate = 1 / (float(np.median(np.diff(column.astype(np.float64)))) * SECONDS[unit])
    told = f'"{short(name)}" was taken for {unit}, as its rate is {rate:.4g} Hz then; --units t=s if it counts s.'
    return (f"{path.stem}: {told}",)


def _since_first(column: np.ndarray, unit: str) -> tuple[np.ndarray, str, int]:
    """Return times since the first where they count from 1970 in less than seconds, exact to the last digit.

    Returns also the first as an ISO text and in ns since 1970.
    """
    first = column[0]
    if unit in ("ms", "us", "ns") and YEARS[0] <= float(first) * SECONDS[unit] <= YEARS[1]:
        ticks = int(float(first) * SECONDS[unit] * 1e3)
        origin = int(first) * round(SECONDS[unit] / SECONDS["ns"])
        since = np.asarray(column - column.dtype.type(int(first)), dtype=np.float64)
        return since, str(np.datetime64(ticks, "ms")), origin
    return np.asarray(column, dtype=np.float64), "", 0
