"""Figures of findings that show in time or frequency: lag, clock, ripple in time, rest and reversal."""

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.answer.result import Array, Finding
from cosim.diagnosis.effects import named
from cosim.diagnosis.effects.base import View
from cosim.diagnosis.measure.breakdown import Samples, slow
from cosim.plots.style import AFTER, BEFORE, GREY, MEASURED
from cosim.report.figures_effect import (
    Draw,
    blank,
    elapsed,
    error_over,
    folded,
    keep_turning,
    load,
    plain_decades,
    position,
    rest_and_motion,
)
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture, heading
from cosim.support.statistics import hann

TOP_HZ = 30.0
"""The residual protocol's filter: nothing above it is left to see."""


def rate(chosen: Samples) -> float:
    """Return samples a second."""
    return 1.0 / float(np.median(np.diff(chosen.t))) if chosen.t.size > 2 else 1.0


def spectra(chosen: Samples, *signals: Array) -> tuple[Array, list[Array]]:
    """Return frequencies and windowed transforms of each signal, one row a segment of 4 s."""
    size = min(int(4 * rate(chosen)), len(chosen.t))
    starts = range(0, len(chosen.t) - size + 1, max(size // 2, 1))
    window = hann(size)
    out = [np.fft.rfft([window * (y[s : s + size] - y[s : s + size].mean()) for s in starts]) for y in signals]
    return np.asarray(np.fft.rfftfreq(size, 1 / rate(chosen)), dtype=float), [
        np.asarray(rows) / (0.5 * window.sum()) for rows in out
    ]


def phase(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw how far the model runs ahead of the measured torque over frequency, with the line of a pure delay."""
    f, (tau, before, after) = spectra(chosen, chosen.tau, chosen.tau - chosen.before, chosen.tau - chosen.after)
    power = np.sum(np.abs(tau) ** 2, axis=0)
    use = (f > 0.3) & (f < TOP_HZ) & (power > 1e-4 * power.max())
    if use.sum() < 4:
        return None
    sheet, axes = blank(finding)
    for model, colour, mark in ((before, BEFORE, "s"), (after, AFTER, "o")):
        angle = np.degrees(np.angle(np.sum(tau * np.conj(model), axis=0)))[use]
        axes.plot(f[use], angle, mark, ms=4, mfc="white" if mark == "s" else colour, mec=colour)
    delay = finding.parameters.get("delay_ms", finding.parameters.get("time_constant_ms", 0.0))
    axes.plot(f[use], 0.36 * delay * f[use], color=MEASURED, dashes=(4, 2), lw=1.2)
    heading(axes, "phase error [°]", below="frequency [Hz]")
    caption = "Squares before, dots after. Dashed: a pure delay of the size found."
    return sheet.picture(f"{finding.title}. {caption}", caption)


def spectrum(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the amplitude of the error over frequency, before and after."""
    f, errors = spectra(chosen, chosen.before, chosen.after)
    use = (f > 0.2) & (f < TOP_HZ)
    sheet, axes = blank(finding)
    for rows, colour, dashes in zip(errors, (BEFORE, AFTER), ((4, 2), (None, None)), strict=True):
        level = np.sqrt(np.mean(np.abs(rows) ** 2, axis=0)) * scales.torque.factor
        axes.plot(f[use], level[use], color=colour, dashes=dashes, lw=1.3)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylim(0)
    heading(axes, f"amplitude of the error [{scales.torque.unit}]")
    caption = "Dashed before, solid after; a line that vanishes was the disturbance."
    return sheet.picture(f"{finding.title}, spectrum of the error. {caption}", caption)


def clock(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the lag between torque and motion over elapsed time: a slope is a clock, a level is a delay."""
    size = int(5 * rate(chosen))
    slope = np.gradient(chosen.tau) * rate(chosen)
    starts = np.arange(0, len(chosen.t) - size, size)
    if len(starts) < 3:
        return None
    sheet, axes = blank(finding)
    for error, colour, mark in ((chosen.before, BEFORE, "s"), (chosen.after, AFTER, "o")):
        lag = [1e3 * _lag(error[s : s + size], slope[s : s + size]) for s in starts]
        axes.plot(chosen.t[starts + size // 2], lag, mark, ms=6, mfc="white" if mark == "s" else colour, mec=colour)
    axes.axhline(0, color=GREY, lw=0.8)
    heading(axes, "lag of motion behind torque [ms]", below="time in the recording [s]")
    caption = "One mark every 5 s. Squares before, dots after. A slope is a clock, a level is a delay."
    return sheet.picture(f"{finding.title}. {caption}", caption)


def _lag(error: Array, slope: Array) -> float:
    energy = float(np.sum(slope**2))
    return float(np.sum(error * slope)) / energy if energy else 0.0


def since_reversal(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the error along the motion over the distance since the last reversal."""
    sign = np.where(np.abs(chosen.v) > 0.2 * slow(chosen.v), np.sign(chosen.v), 0.0)
    index = np.where(sign != 0, np.arange(len(sign)), 0)
    held = sign[np.maximum.accumulate(index)]
    turns = np.flatnonzero(np.diff(held)) + 1
    if len(turns) < 3:
        return None
    start = np.zeros(len(sign), dtype=int)
    start[turns] = turns
    travel = np.abs(chosen.q - chosen.q[np.maximum.accumulate(start)]) * scales.position.factor
    far = max(float(np.quantile(travel, 0.3)), 1e-12)
    axis = f"travel since reversal [{scales.position.unit}]"
    sheet, axes = error_over(
        finding, travel, (chosen.before * held, chosen.after * held), np.linspace(0, far, 31), axis, scales
    )
    axes.set_xlim(0, far)
    caption = f"Mean of {len(turns)} reversals with its 95 % band; dashed before, solid after."
    return sheet.picture(f"{finding.title}. {caption}", caption)


def breakaway(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Draw the torque above the model at each start over the rest before it; each start is a mark."""
    starts, rest = _starts(chosen)
    if len(starts) < 3:
        return None
    sheet, axes = blank(finding)
    window = max(3, int(0.3 * rate(chosen)))
    for error, colour, mark in ((chosen.before, BEFORE, "s"), (chosen.after, AFTER, "o")):
        peak = [float(np.max(np.abs(error[s : s + window]))) * scales.torque.factor for s in starts]
        axes.plot(rest, peak, mark, ms=6, mfc="white" if mark == "s" else colour, mec=colour)
    plain_decades(axes)
    heading(axes, f"error at break-away [{scales.torque.unit}]", below="rest before the start [s]")
    caption = f"{len(starts)} starts, one mark each. Squares before, dots after."
    return sheet.picture(f"{finding.title}. {caption}", caption)


def _starts(chosen: Samples) -> tuple[npt.NDArray[np.intp], Array]:
    still = np.r_[0, (np.abs(chosen.v) <= slow(chosen.v)).astype(int), 0]
    low, high = np.flatnonzero(np.diff(still) == 1), np.flatnonzero(np.diff(still) == -1)
    rest = (high - low) / rate(chosen)
    keep = (rest > 0.05) & (high < len(chosen.t) - 3)
    return high[keep], rest[keep]


VIEWS: dict[View, Draw] = {
    "position": position,
    "one pitch": folded,
    "slow and fast": rest_and_motion,
    "keep turning": keep_turning,
    "since reversal": since_reversal,
    "rest before a start": breakaway,
    "time": elapsed,
    "spectrum": spectrum,
    "phase": phase,
    "clock": clock,
    "load": load,
}
"""How each view of a hypothesis is drawn."""


def effect(finding: Finding, chosen: Samples, scales: Scales) -> Picture | None:
    """Return the figure of a finding, or None where the recordings hold too little for it."""
    if chosen.t.size < 200:
        return None
    return VIEWS[named(finding.effect).view](finding, chosen, scales)
