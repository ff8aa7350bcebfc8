"""Strongest cycles of a signal over angle."""

from math import pi

import numpy as np

from cosim.diagnosis.candidates import Span
from cosim.diagnosis.prepare import Array

PEAKS = 3
"""Peaks that become candidates, for each periodic effect."""


def peaks(span: Span, signal: Array, lowest: float = 1.0) -> list[float]:
    """Strongest cycles per turn of a signal over angle, from a periodogram; at most `PEAKS`, well apart."""
    reach = float(np.ptp(span.angle))
    if reach <= 0:
        return []
    step, speed = 0.35 * 2 * pi / reach, float(np.median(np.abs(span.v)[np.abs(span.v) > 0.02 * span.top]))
    ratio = float(np.ptp(span.angle) / max(np.ptp(span.q), 1e-300))
    top = min(2 * pi * span.cutoff / max(speed * ratio, 1e-12), 3000 * step)
    cycles = np.arange(max(2 * pi / reach * lowest, step), max(top, 10 * step), step)
    power = np.array([_power(span, signal, float(n), ratio) for n in cycles])
    found: list[float] = []
    for index in np.argsort(power)[::-1]:
        if all(abs(cycles[index] - other) > 6 * step for other in found):
            found.append(_sharpened(span, signal, float(cycles[index]), step, ratio))
        if len(found) == PEAKS:
            break
    return found


def _power(span: Span, signal: Array, cycles: float, ratio: float) -> float:
    """Power of a signal at a number of cycles per turn, over the rows slow enough for the filter to pass them."""
    passed = np.abs(span.v) * ratio * cycles < 2 * pi * span.cutoff * 0.8
    if passed.sum() < 50:
        return 0.0
    part = signal[passed] - signal[passed].mean()
    return float(np.abs(np.exp(-1j * cycles * span.angle[passed]) @ part) ** 2 / passed.sum())


def _sharpened(span: Span, signal: Array, cycles: float, step: float, ratio: float) -> float:
    fine = cycles + step * np.linspace(-1, 1, 21)
    best = float(fine[np.argmax([_power(span, signal, float(n), ratio) for n in fine])])
    near = float(round(best))
    # Slots, teeth and rolling elements come in whole numbers: prefer one that the data cannot tell from the best.
    close = near > 0 and abs(near - best) < 0.6 * step
    return near if close and _power(span, signal, near, ratio) > 0.9 * _power(span, signal, best, ratio) else best
