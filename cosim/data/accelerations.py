"""A measured acceleration tells the units of time and position: it is the second derivative of the position.

    a = k d2q/dt2,  k from increments of the mean speed and integrals of a between the middles of equal parts

A time that is counted in s but is in ms makes k = 1e6, a position in degrees that is taken for rad k = .0175.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.data import questions
from cosim.data.assign import OURS, Assigned, units_stated
from cosim.data.columns import Columns
from cosim.data.limits import LARGEST
from cosim.data.roles import is_named
from cosim.data.text.unit_words import is_known, spelled
from cosim.data.times import SECONDS, read_clock
from cosim.support.units import unit

Array = npt.NDArray[np.float64]
PARTS, LEAST = 200, 20
"""Parts over which mean speeds are taken, and rows that each needs: an encoder's step is small beside its motion."""
FOLLOWS = 0.9
"""Share of the energy of its integrals that the position must explain of a column that is its acceleration."""
NEAR = 0.1
"""Relative error within which k is a ratio of units."""
POSITIONS = {"rad": ("deg", "rev", "mrad"), "m": ("mm", "um")}
"""Units of a position that a file may not state, by what they become."""


def check_acceleration(path: Path, found: Columns, served: Assigned, given: Mapping[str, str]) -> None:
    """Ask for the unit of the time or the position where a measured acceleration says that it is another.

    Args:
        path: the file, for messages.
        found: its columns as they are.
        served: the columns under our names, in the units of the file.
        given: what the user says of units, by our name; what is given is not asked for.

    Raises:
        UndecidedError: the acceleration is that of the position only in another unit.
    """
    kinds = {name: _kind(found, name) for name in served.values if name not in OURS}
    for name, kind in kinds.items():
        if not kind or not _is_numeric(served, "t") or not _is_numeric(served, "q") or not _is_numeric(served, name):
            continue
        stated = served.units.get("q", "")
        q = np.asarray(
            unit(spelled(stated)).to_si(served.values["q"].astype(np.float64)) if stated else served.values["q"]
        )
        a = np.asarray(unit(spelled(units_stated(found, name))).to_si(served.values[name].astype(np.float64)))
        clock = read_clock(path, served.values["t"], served.sources["t"], served.units.get("t", ""), servo=False)
        size = unit(clock.unit).factor if clock.unit else 1.0
        k = _ratio(np.asarray(clock.values, np.float64) * size, q.astype(np.float64), a)
        fitting = next((key for key, one in SECONDS.items() if key != "s" and _near(k * (one / size) ** 2)), "")
        if fitting and "t" not in given and not _near(k):
            raise questions.time_by_speed(path, clock.unit or "s", fitting, name, "the second derivative")
        position = next((one for one in POSITIONS[kind] if _near(k / unit(one).factor)), "")
        if position and not stated and "q" not in given and not _near(k):
            raise questions.position_by_speed(path, name, position, False, served.values, "the second derivative")


def _kind(found: Columns, name: str) -> str:
    """Return what the position of a measured acceleration is in, rad or m; empty of any other column."""
    text = units_stated(found, name)
    si = unit(spelled(text)).si if is_known(text) else ""
    return {"rad/s2": "rad", "m/s2": "m"}.get(si, "") if not is_named(name, "asked", "wrong") else ""


def _is_numeric(served: Assigned, name: str) -> bool:
    column = served.values.get(name)
    return column is not None and column.dtype.kind in "fiu" and bool((np.abs(column) < LARGEST).all())


def _ratio(t: Array, q: Array, a: Array) -> float:
    """Return k of a = k d2q/dt2; 0 where the position does not explain the acceleration."""
    edges = np.unique(np.linspace(0, len(t) - 1, min(PARTS, len(t) // LEAST) + 1).astype(int))
    lasted = np.diff(t[edges])
    if len(edges) < LEAST or (lasted <= 0).any():
        return 0.0
    speed = np.diff(q[edges]) / lasted
    middles = 0.5 * (t[edges][1:] + t[edges][:-1])
    way = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(t))])
    gained, integral = np.diff(speed), np.diff(np.interp(middles, t, way))
    own, energy = float(gained @ gained), float(integral @ integral)
    if own <= 0 or energy <= 0:
        return 0.0
    k = float(integral @ gained) / own
    left = integral - k * gained
    return k if 1 - float(left @ left) / energy > FOLLOWS else 0.0


def _near(value: float) -> bool:
    return abs(value - 1) <= NEAR
