"""What a guide log can say of a mount without any torque: how well it was guided, its drift, its strongest period.

What was corrected is added back: without corrections the star would have been at

    u_k = r_k + sum of g_j over j < k

r being how far it was seen from its lock position and g what was corrected. A straight line, the drift, and one sine,
the periodic error, are fitted to it together by least squares at the times as they are (Lomb 1976).
"""

import numpy as np

from cosim.data.recording import Recording
from cosim.support.statistics import rms

ARCSEC = 648_000 / np.pi
AXES = {"RA": ("RARawDistance", "RAGuideDistance"), "Dec": ("DECRawDistance", "DECGuideDistance")}
STEPS, PERIODS, LONGEST = 20, 600, 0.8
"""Guide steps that are needed, periods that are tried, and the longest of them in parts of the log."""


def guiding(recording: Recording) -> dict[str, str]:
    """Return sentences on both axes of a guide log, by a name for each."""
    told: dict[str, str] = {}
    for axis, (seen, corrected) in AXES.items():
        if seen in recording and corrected in recording and len(recording) >= STEPS:
            told |= _of_axis(axis, recording.t, recording[seen], recording[corrected], recording.units.get(seen, ""))
    return told


def _of_axis(axis: str, t: np.ndarray, seen: np.ndarray, corrected: np.ndarray, unit: str) -> dict[str, str]:
    scale, named = (ARCSEC, "arcsec") if unit == "rad" else (1.0, "px")
    free = scale * (seen + np.concatenate([[0.0], np.cumsum(corrected)[:-1]]))
    if np.ptp(free) <= 1e-9 * np.abs(free).max():
        return {f"{axis} without corrections": "it stayed where it was"}
    drift, period, amplitude, rest = strongest(t - t[0], free)
    return {
        f"{axis} guided": f"{scale * rms(seen):.3g} {named} rms",
        f"{axis} without corrections": f"drift {60 * drift:.3g} {named}/min, strongest period {period:.3g} s with "
        f"+-{amplitude:.3g} {named}; the rest is {rest:.3g} {named} rms",
    }


def strongest(t: np.ndarray, free: np.ndarray) -> tuple[float, float, float, float]:
    """Fit a line and one sine, of the period that leaves least.

    Returns:
        Drift [1/s], period [s], amplitude, and RMS of what is left, in the unit of `free`.
    """
    span, step = float(t[-1]), float(np.median(np.diff(t)))
    best = (np.inf, 0.0, np.zeros(4))
    for period in np.geomspace(4 * step, LONGEST * span, PERIODS):
        columns = np.stack(
            [np.ones_like(t), t / span, np.sin(2 * np.pi * t / period), np.cos(2 * np.pi * t / period)], 1
        )
        fitted, *_ = np.linalg.lstsq(columns, free, rcond=None)
        left = rms(free - columns @ fitted)
        best = min(best, (left, period, fitted), key=lambda one: one[0])
    left, period, fitted = best
    return float(fitted[1] / span), float(period), float(np.hypot(*fitted[2:])), left
