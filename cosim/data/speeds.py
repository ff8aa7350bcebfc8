"""The measured speed of an axis among the columns of a file: the slope of the position, which tells units.

    v = k dq/dt,  k from increments of q and integrals of v over equal parts of the recording

k = 1 where time, position and speed are in the units that were taken. Another k that is a ratio of units says which of
them was taken wrongly: 1000 is a time in ms, 57.3 a speed in degrees a second, .0175 a position in degrees.

Where no speed was recorded, a measured acceleration tells the units of time and position:

    a = k d2q/dt2,  k from increments of the mean speed and integrals of a between the middles of equal parts

A time that is counted in s but is in ms makes k = 1e6, a position in degrees that is taken for rad k = .0175.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.data import questions
from cosim.data.assign import OURS, Assigned, units_stated
from cosim.data.columns import Array, Columns
from cosim.data.limits import LARGEST, listed, short
from cosim.data.registers import continued
from cosim.data.roles import is_named, is_speed
from cosim.data.text.unit_words import is_known, spelled
from cosim.data.times import FASTEST, SECONDS, SLOWEST, clock_of
from cosim.support.units import unit

PARTS = 400
"""Parts of a recording over which increments are taken: short beside a motion, long beside a step of an encoder."""
LEAST = 20
"""Rows that are needed."""
BENDS, LEAST_BENDS = 200, 20
"""Parts over which mean speeds are taken for an acceleration, how many and the rows that each needs: an encoder's step
is small beside its motion."""
FOLLOWS = 0.95
"""Share of the energy of its integrals that the slope of the position explains of a column that is its speed."""
NEAR = 0.025
"""Relative error within which k is a ratio of units: rev/s and a sixth, which is degrees beside rpm, differ by 5 %."""
BENDS_FOLLOW, BENDS_NEAR = 0.9, 0.1
"""The same share, and the same error, of an acceleration."""
REPEATS = 0.98
"""Share of a torque or current that the torque explains where it is the torque again, as a diagnosis takes it."""
KEPT = "_original"
"""End of the name of a column whose own name was given to another: it is kept, as was promised."""
POSITIONS = {"rad": ("deg", "rev", "mrad", "0.001 deg", "arcsec", "arcmin", "urad"), "m": ("mm", "um")}
"""Units in which positions are recorded, by what they become, the usual ones first ..."""
USUAL = 3
"""... so many, which an acceleration tells apart."""
SPEEDS = {
    "rad": ("deg/s", "rpm", "rev/s", "mrad/s", "0.001 deg/s", "arcsec/s"),
    "m": ("mm/s", "m/min", "mm/min", "um/s"),
}
"""Units in which speeds are recorded, by what the position becomes."""


@dataclass(frozen=True)
class Speed:
    """A column that is named as a speed: its name, k, and the share of it that the slope of the position explains."""

    name: str
    k: float
    follows: float

    @property
    def is_own(self) -> bool:
        """Whether it is the speed of this axis, in some unit."""
        return self.follows > FOLLOWS


def with_speed(path: Path, found: Columns, served: Assigned, given: Mapping[str, str]) -> Assigned:
    """Give the measured speed of the axis its name `v`, and leave out what repeats it or the torque.

    Args:
        path: the file, for messages.
        found: its columns as they are.
        served: the columns under our names, in the units of the file.
        given: what the user says of units, by our name.

    Returns:
        The columns with `v`, if there is one, in the unit that makes it the slope of the position, and notes.

    Raises:
        UndecidedError: the speed says that a stated unit of time, position or speed is wrong.
    """
    if found.origin:  # this project wrote it, under names of its own that it needs again
        return served
    if "t" not in served.values or not (
        "q" in served.values and _is_numeric(served.values["q"]) and len(served.values["q"]) >= LEAST
    ):
        return served
    named = [name for name in served.values if name == "v" or (name not in OURS and _may_be_speed(found, name))]
    speeds = [one for name in named if (one := _speed(path, found, served, name)) and one.is_own]
    if "v" not in served.values or any(one.name == "v" for one in speeds):
        best = max(speeds, key=lambda one: _rank(found, one), default=None)
        served = _chosen(path, found, served, given, best) if best else served
    if not speeds:
        _check_accelerations(path, found, served, given)
    again = tuple(one.name for one in speeds if one.name in served.values and one.name != "v")
    others = [name for name in served.values if name not in (*OURS, *again) and not name.endswith(KEPT)]
    again += tuple(name for name in others if _is_torque_again(served, name))
    if not again:
        return served
    said = "repeat the speed or the torque in another unit and are no causes"
    note = f"{path.stem}: columns that {said} were left out: {listed(again)}."
    kept = {name: column for name, column in served.values.items() if name not in again}
    units = {name: text for name, text in served.units.items() if name not in again}
    return replace(served, values=kept, units=units, notes=(*served.notes, note))


def _is_numeric(column: np.ndarray) -> bool:
    return column.dtype.kind in "fiu"


def _si_unit(found: Columns, name: str) -> str:
    """Return what the unit of a column becomes in SI; empty where none that is known is stated."""
    text = units_stated(found, name)
    return unit(spelled(text)).si if is_known(text) else ""


def _may_be_speed(found: Columns, name: str) -> bool:
    kind = _si_unit(found, name)
    measured = not is_named(name, "asked", "wrong")
    return (kind in ("rad/s", "m/s") and measured) or (is_speed(name) and kind in ("", "1", "1/s"))


def _rank(found: Columns, one: Speed) -> tuple[bool, bool, float]:
    """The column called v first, then the one that the format calls so, then the one that is the slope itself."""
    return one.name == "v", found.roles.get("v") == one.name, -abs(np.log(abs(one.k) + 1e-300))


def _speed(path: Path, found: Columns, served: Assigned, name: str) -> Speed | None:
    """Compare a column with the slope of the position."""
    if not _is_numeric(served.values[name]):
        return None
    clock = clock_of(path, served)
    if clock.values.dtype == object:
        return None
    t = clock.seconds
    turned, _ = continued(path.stem, {"q": served.values["q"].astype(np.float64)}, served.units)
    q, v = _si(turned["q"], served.units.get("q", "")), _si(served.values[name], _unit_of(found, served, name))
    good = np.isfinite(t) & (np.abs(q) < LARGEST) & (np.abs(v) < LARGEST)
    t, q, v = t[good], q[good], v[good]
    return Speed(name, *times_slope(t, q, v)) if len(t) >= LEAST else None


def _unit_of(found: Columns, served: Assigned, name: str) -> str:
    text = served.units.get(name, "") or units_stated(found, name)
    return text if is_known(text) else ""


def _si(values: np.ndarray, text: str) -> Array:
    return np.asarray(unit(spelled(text)).to_si(values.astype(np.float64)) if text else values, dtype=np.float64)


def times_slope(t: Array, q: Array, v: Array) -> tuple[float, float]:
    """Return k of v = k dq/dt, and the share of the integrals of v that it explains; parts with a gap are left out."""
    edges = np.unique(np.linspace(0, len(t) - 1, min(PARTS, len(t) // 2) + 1).astype(int))
    way = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    moved, integral, lasted = np.diff(q[edges]), np.diff(way[edges]), np.diff(t[edges])
    whole = (lasted > 0) & (lasted < 3 * np.median(lasted))
    return _ratio(moved[whole], integral[whole]) if whole.sum() >= LEAST / 2 else (0.0, 0.0)


def _ratio(moved: Array, integral: Array) -> tuple[float, float]:
    """Return k of integral = k moved, and the share of the energy that it explains; 0 where either never changes."""
    energy, own = float(integral @ integral), float(moved @ moved)
    if energy <= 0 or own <= 0:
        return 0.0, 0.0
    k = float(integral @ moved) / own
    left = integral - k * moved
    return k, 1 - float(left @ left) / energy


def _chosen(path: Path, found: Columns, served: Assigned, given: Mapping[str, str], best: Speed) -> Assigned:
    """Call a column v, in the unit that makes it the slope; the time too where that is what its unit says."""
    stated = _unit_of(found, served, best.name)
    ours = "" if best.name == "v" else f', v = "{short(best.name)}"'
    factor = abs(best.k)
    if time := _time_unit(served, factor, bool(stated)):
        if "t" in served.units and "t" not in given:
            raise questions.time_by_speed(path, served.units["t"], time, best.name)
        if "t" not in given:
            told = f'"{served.sources["t"]}" was taken for {time}, as "{short(best.name)}" is the slope of the position'
            note = f"{path.stem}: {told} then; --units t=s if it counts s."
            served = replace(served, units=served.units | {"t": time}, notes=(*served.notes, note))
            factor /= 1 / SECONDS[time]
    if not _near(factor, 1.0) and "v" not in given:
        family = unit(spelled(served.units["q"])).si if served.units.get("q") else ""
        position = _of_ratio(POSITIONS, family, 1 / factor)
        if position and "q" not in given and (stated or not _of_ratio(SPEEDS, family, factor)):
            raise questions.position_by_speed(path, best.name, position, bool(served.units.get("q")), served.values)
        fitting = _of_ratio(SPEEDS, family, factor)
        if fitting and not stated:
            stated = fitting
            told = f'"{short(best.name)}" was taken for {fitting}, as it is the slope of the position then'
            served = replace(served, notes=(*served.notes, f"{path.stem}: {told}; --units v=... says it otherwise."))
        elif best.name != "v":
            return served  # the speed of another shaft: it is left out as one that repeats
    if _near(factor, 1.0) and stated and not served.units.get("q") and unit(spelled(stated)).si.endswith("/s"):
        served = replace(served, units=served.units | {"q": unit(spelled(stated)).si.removesuffix("/s")})
    if not ours:
        return replace(served, units=served.units | ({"v": stated} if stated else {}))
    values = {"v" if name == best.name else name: column for name, column in served.values.items()}
    units = {name: text for name, text in served.units.items() if name != best.name} | ({"v": stated} if stated else {})
    sources = {name: source for name, source in served.sources.items() if name != best.name} | {"v": best.name}
    note = f'{path.stem}: "{short(best.name)}" is the slope of the position and serves as v, its speed.'
    return Assigned(values, units, sources, (*served.notes, note))


def _time_unit(served: Assigned, factor: float, stated: bool) -> str:
    """Return the unit of time that makes a speed the slope, if a servo is sampled so; empty where it is the one taken.

    Where the unit of the speed is not stated and seconds are a servo's too, the speed may be in thousandths.
    """
    t = served.values["t"]
    if not _is_numeric(t) or _near(factor, 1.0):
        return ""
    step = float(np.median(np.diff(t.astype(np.float64)))) if len(t) > 1 else 0.0
    taken = unit(spelled(served.units["t"])).factor if served.units.get("t") else 1.0
    own = step > 0 and SLOWEST <= 1 / (step * taken) <= FASTEST
    for name, size in SECONDS.items():
        plausible = step > 0 and SLOWEST <= 1 / (step * size) <= FASTEST
        if plausible and _near(factor * size / taken, 1.0) and (stated or not own):
            return name
    return ""


def _of_ratio(units: Mapping[str, tuple[str, ...]], family: str, ratio: float) -> str:
    """Return the unit of which one is `1 / ratio` of ours; of the axis' own kind where it is known."""
    names = units.get(family) or (*units["rad"], *units["m"])
    return next((name for name in names if _near(ratio * unit(name).factor, 1.0)), "")


def _near(value: float, wanted: float = 1.0, within: float = NEAR) -> bool:
    return abs(value - wanted) <= within * wanted


def _is_torque_again(served: Assigned, name: str) -> bool:
    """Whether a torque or current is the torque again, in another unit."""
    column, tau = served.values[name], served.values.get("tau")
    if tau is None or not (is_named(name, "torque", "current") and _is_numeric(column) and _is_numeric(tau)):
        return False
    good = (np.abs(column) < LARGEST) & (np.abs(tau) < LARGEST)
    if good.sum() < LEAST or np.ptp(column[good]) == 0 or np.ptp(tau[good]) == 0:
        return False
    return float(np.corrcoef(column[good], tau[good])[0, 1] ** 2) > REPEATS


def _check_accelerations(path: Path, found: Columns, served: Assigned, given: Mapping[str, str]) -> None:
    """Ask for the unit of the time or the position where a measured acceleration says that it is another."""
    for name in (one for one in served.values if one not in OURS):
        kind = _position_of(found, name)
        if not kind or not all(_is_sound(served.values[one]) for one in ("t", "q", name)):
            continue
        stated = served.units.get("q", "")
        q, a = _si(served.values["q"], stated), _si(served.values[name], units_stated(found, name))
        clock = clock_of(path, served)
        k = _times_bend(clock.seconds, q, a)
        if _near(k, within=BENDS_NEAR):
            continue
        sizes = {key: k * (one / clock.size) ** 2 for key, one in SECONDS.items() if key != "s"}
        fitting = next((key for key, one in sizes.items() if _near(one, within=BENDS_NEAR)), "")
        if fitting and "t" not in given:
            raise questions.time_by_speed(path, clock.unit or "s", fitting, name, "the second derivative")
        usual = POSITIONS[kind][:USUAL]
        position = next((one for one in usual if _near(k / unit(one).factor, within=BENDS_NEAR)), "")
        if position and not stated and "q" not in given:
            raise questions.position_by_speed(path, name, position, False, served.values, "the second derivative")


def _position_of(found: Columns, name: str) -> str:
    """Return what the position of a measured acceleration is in, rad or m; empty of any other column."""
    kind = {"rad/s2": "rad", "m/s2": "m"}.get(_si_unit(found, name), "")
    return kind if not is_named(name, "asked", "wrong") else ""


def _is_sound(column: np.ndarray) -> bool:
    return _is_numeric(column) and bool((np.abs(column) < LARGEST).all())


def _times_bend(t: Array, q: Array, a: Array) -> float:
    """Return k of a = k d2q/dt2; 0 where the position does not explain the acceleration."""
    edges = np.unique(np.linspace(0, len(t) - 1, min(BENDS, len(t) // LEAST_BENDS) + 1).astype(int))
    lasted = np.diff(t[edges])
    if len(edges) < LEAST_BENDS or (lasted <= 0).any():
        return 0.0
    middles = 0.5 * (t[edges][1:] + t[edges][:-1])
    way = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(t))])
    k, follows = _ratio(np.diff(np.diff(q[edges]) / lasted), np.diff(np.interp(middles, t, way)))
    return k if follows > BENDS_FOLLOW else 0.0
