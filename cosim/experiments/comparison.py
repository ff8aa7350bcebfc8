"""How far a simulated variable is from its reference, and what the difference looks like.

A variable passes where |y - r| <= rtol * max|r - mean r| + 1e-12 max|r| at every row of the reference (rtol * max|r|
where r is constant). Where it does not, the causes that explain it are tried: a gain, the sign, an offset, a shift in
time. One is named where with it the RMS of the difference is a tenth or less.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from cosim.experiments.series import Array

RTOL = 1e-4
"""Allowed difference relative to the range: of two solvers on one model; wiring, sign and delay errors are larger."""
ROUNDING = 1e-12
EXPLAINED = 0.1
"""Share of the RMS difference that a cause may leave."""
LAGS = 3
"""Rows by which a shift in time is looked for, on either side."""


@dataclass(frozen=True)
class Compared:
    """One variable of an experiment: the largest difference, when it is, what was allowed, and a likely cause."""

    name: str
    passed: bool
    largest: float
    at: float
    allowed: float
    rms: float
    cause: str = ""
    said: str = ""
    """What differs, for variables that are no numbers."""

    @property
    def ratio(self) -> float:
        """The largest difference over what was allowed; above 1 the variable fails."""
        return self.largest / self.allowed if self.allowed > 0 else (0.0 if self.passed else np.inf)


def compare_numbers(name: str, times: Array, reference: Array, simulated: Array, rtol: float, exact: bool) -> Compared:
    """Compare a variable that is a number, arrays of shape (rows,).

    Args:
        name: of the variable.
        times: of the rows [s]; two of one time are both sides of an event, of which one must be met.
        reference: as its maker has it.
        simulated: as it is here.
        rtol: allowed difference relative to the range.
        exact: whether it is of a type whose values are exact: integers, booleans, enumerations.
    """
    gap = np.abs(simulated - reference)
    gap = np.where(np.isnan(simulated) & np.isnan(reference), 0.0, np.where(np.isnan(gap), np.inf, gap))
    for k in np.flatnonzero(np.diff(times) == 0):
        gap[k : k + 2] = gap[k : k + 2].min()
    finite = reference[np.isfinite(reference)]
    height = float(np.abs(finite).max(initial=0.0))
    spread = float(np.abs(finite - finite.mean()).max()) if len(finite) else 0.0
    allowed = 0.0 if exact else rtol * (spread or height) + ROUNDING * height
    most = int(np.argmax(gap))
    passed = bool(gap[most] <= allowed)
    rms = float(np.sqrt(np.mean(np.minimum(gap, 1e300) ** 2))) if np.isfinite(gap).all() else np.inf
    cause = "" if passed else _cause(times, reference, simulated)
    return Compared(name, passed, float(gap[most]), float(times[most]), allowed, rms, cause)


def compare_texts(name: str, times: Array, reference: tuple[str, ...], simulated: list[str]) -> Compared:
    """Compare a variable that is text or binary: each row must be the same."""
    wrong = [k for k, (one, other) in enumerate(zip(reference, simulated, strict=True)) if one != other]
    if not wrong:
        return Compared(name, True, 0.0, float(times[0]), 0.0, 0.0)
    k = wrong[0]
    said = f'"{simulated[k][:40]}" and not "{reference[k][:40]}"'
    return Compared(name, False, np.inf, float(times[k]), 0.0, np.inf, said=said)


def _cause(times: Array, reference: Array, simulated: Array) -> str:
    """Name what explains a difference; empty where nothing of these does."""
    good = np.isfinite(reference) & np.isfinite(simulated)
    if not good.all():
        first = float(times[np.flatnonzero(~good)[0]])
        return f"it is no number from {first:.6g} s on" if np.isfinite(reference).all() else ""
    left = float(np.linalg.norm(simulated - reference))
    tries: list[tuple[float, str]] = []
    tries.append((float(np.linalg.norm(simulated + reference)), "the sign is the other one"))
    power = float(reference @ reference)
    gain = float(simulated @ reference) / power if power > 0 else 1.0
    tries.append((float(np.linalg.norm(simulated - gain * reference)), f"a gain of {gain:.4g}"))
    offset = float(np.mean(simulated - reference))
    tries.append((float(np.linalg.norm(simulated - reference - offset)), f"an offset of {offset:.4g}"))
    tries += _shifts(times, reference, simulated)
    best = min(tries, key=lambda one: one[0])
    if best[0] <= EXPLAINED * left:
        return best[1]
    return _from_when(times, np.abs(simulated - reference), reference)


def _shifts(times: Array, reference: Array, simulated: Array) -> list[tuple[float, str]]:
    """Shifts by whole rows, each with the norm that is left, scaled to all rows."""
    found = []
    for lag in range(1, min(LAGS, len(times) // 4) + 1):
        step = float(np.median(np.diff(times))) * lag
        words = f"{lag} row{'s' * (lag > 1)} ({step:.4g} s)"
        found.append((_scaled_norm(simulated[lag:], reference[:-lag], len(times)), f"it is {words} late"))
        found.append((_scaled_norm(simulated[:-lag], reference[lag:], len(times)), f"it is {words} early"))
    return found


def _scaled_norm(one: Array, other: Array, count: int) -> float:
    """Norm of a difference, scaled to `count` rows."""
    return float(np.linalg.norm(one - other) * sqrt(count / len(one)))


def _from_when(times: Array, gap: Array, reference: Array) -> str:
    """Say from when on a difference is there, where there was none before: an event may be missed."""
    small = gap <= RTOL * float(np.abs(reference - reference.mean()).max() or 1.0)
    first = int(np.argmin(small))
    return f"it is right up to {times[first - 1]:.6g} s and wrong from {times[first]:.6g} s on" if first > 1 else ""
