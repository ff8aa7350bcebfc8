"""Strongest cycles of a signal over angle, and strongest tones over time."""

from itertools import pairwise
from math import ceil, log, pi

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.candidates import Span
from cosim.estimation.prepare import Array
from cosim.estimation.tonal_disturbance import LEAST_WAVES
from cosim.support.statistics import hann

PEAKS = 3
"""Peaks that become candidates, for each periodic effect."""
LEAST_ROWS = 50
MOST = 20_000
"""Cycles that are tried at most, .35 of what a stroke tells apart: half a second of processor. With 3,000 the cycles of
a motor that turned sixteen times ended at 64 a turn; its ripple of 72 was out of reach."""
LEAST_TURNS = 8
"""Periods of a motion that show that it repeats itself, where harmonics hold nearly all of its speed's energy."""
NEIGHBOURS = 10
"""Tones that a piece tells apart, on either side of one, whose mean power is the level there."""
CAUSED = 3.0
"""Amplitude of a line of the torque that the motion needs, in units of the tone, from which the motion makes the tone.
A disturbance moves the axis too, but by no more torque than its own, or twice that where the loop amplifies it."""
LINE = 20.0
"""Power of a line, in units of the level of its neighbours: noise comes to that once in 5e8."""
BAND, FINE = 1.15, 16
"""Ratio of cycles that share one choice of rows, and bins of angle in the shortest wave of such a band."""


def peaks(span: Span, signal: Array, lowest: float = 1.0) -> list[float]:
    """Strongest cycles per turn of a signal over angle, from a periodogram; at most `PEAKS`, well apart."""
    reach = float(np.ptp(span.angle))
    if reach <= 0:
        return []
    step, speed = 0.35 * 2 * pi / reach, float(np.median(np.abs(span.v)[np.abs(span.v) > 0.02 * span.top]))
    ratio = float(np.ptp(span.angle) / max(np.ptp(span.q), 1e-300))
    top = min(2 * pi * span.cutoff / max(speed * ratio, 1e-12), MOST * step)
    first = max(1, ceil(max(2 * pi / reach * lowest, step) / step))
    numbers = np.arange(first, max(ceil(top / step), first + 10))
    cycles, power = numbers * step, _powers(span, signal, numbers, step, ratio)
    found: list[float] = []
    for index in np.argsort(power)[::-1]:
        if all(abs(cycles[index] - other) > 6 * step for other in found):
            found.append(_sharpened(span, signal, float(cycles[index]), step, ratio))
        if len(found) == PEAKS:
            break
    return found


def tones(span: Span, signal: Array) -> list[float]:
    """Frequencies [Hz] of the tones that stand out most from their neighbours, at most `PEAKS`, well apart.

    Each piece has its own phase, so powers are added, each in units of the level of its neighbours. Where the motion
    repeats itself or turns steadily, what depends on it is a tone as well: such tones are no sign of a disturbance.
    Neither is what lies at a line of the torque that the motion itself needs.
    """
    pieces = [np.flatnonzero(span.piece == number) for number in np.unique(span.piece)]
    pieces = [own for own in pieces if len(own) >= LEAST_ROWS]
    seconds = LEAST_WAVES / span.detectable[0]
    fine = np.arange(*span.detectable, 0.25 / seconds)
    if not pieces or len(fine) < NEIGHBOURS:
        return []
    needed = span.tau - span.residual
    powers = [_without_lines(span.t[own], signal[own], needed[own], fine) for own in pieces]
    standing = np.sum(powers, axis=0)
    turned = [_turned(span.t[own], span.angle[own], fine) for own in pieces]
    repeated = [_repeated(span.t[own], span.v[own], fine) for own in pieces]
    standing[np.all(np.logical_or(turned, repeated), axis=0)] = 0.0
    found: list[float] = []
    for index in np.argsort(standing)[::-1]:
        if all(abs(fine[index] - other) > 3 / seconds for other in found) and standing[index] > 0:
            found.append(float(fine[index]))
        if len(found) == PEAKS:
            break
    return found


def _turned(t: Array, angle: Array, hertz: Array) -> npt.NDArray[np.bool_]:
    """Which tones are waves of angle as well: those in phase with a steady turn, within a radian RMS."""
    speed, start = np.polyfit(t - t[0], angle, 1)
    return np.asarray(2 * pi * hertz * np.std(angle - start - speed * (t - t[0])) < abs(speed))


def _repeated(t: Array, v: Array, hertz: Array) -> npt.NDArray[np.bool_]:
    """Which frequencies are harmonics of a motion that repeats itself: none, if its speed is not a line spectrum."""
    width = 1 / float(np.ptp(t))
    fine = np.arange(width, 0.5 / float(t[1] - t[0]), 0.125 * width)
    power = _spectrum(t, v, fine)
    pitch = float(fine[np.argmax(power)])
    harmonic = [np.abs(f - pitch * np.maximum(np.round(f / pitch), 1)) < 2 * width for f in (fine, hertz)]
    repeats = pitch > LEAST_TURNS * width and power[harmonic[0]].sum() > POLICY.nearly_all * power.sum()
    return np.asarray(harmonic[1] & repeats)


def _without_lines(t: Array, signal: Array, needed: Array, hertz: Array) -> Array:
    """How far a piece's tones stand out; 0 at lines of the torque that the motion needs, if those are much larger.

    A line of the motion makes one in whatever the model misses: a torque that is half a row late, a friction law that
    is not quite the machine's.
    """
    power, own = _spectrum(t, signal, hertz), _spectrum(t, needed, hertz)
    is_line = (own > CAUSED**2 * power) & (_standing(t, needed, hertz) > LINE)
    return np.where(is_line, 0.0, _standing(t, signal, hertz))


def _standing(t: Array, signal: Array, hertz: Array) -> Array:
    """Power of a signal in even rows at many frequencies, in units of the mean power of the neighbours."""
    power, own = _spectrum(t, signal, hertz), 1 / float(np.ptp(t))
    step = float(hertz[1] - hertz[0])
    gap, reach = (max(1, round(count * own / step)) for count in (2, NEIGHBOURS))
    beside = np.r_[np.ones(reach), np.zeros(2 * gap + 1), np.ones(reach)]
    padded = np.pad(np.log(power + 1e-300), reach + gap, mode="reflect")
    return np.asarray(power / np.exp(np.convolve(padded, beside / beside.sum(), "valid") + np.euler_gamma))


def _spectrum(t: Array, signal: Array, hertz: Array) -> Array:
    """Power per row at many frequencies, also above half the rate of the rows, where it is that of the mirror image."""
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    length = 1 << int(np.ceil(np.log2(len(t) * 16)))
    window = hann(len(t))
    power = np.abs(np.fft.fft((signal - signal.mean()) * window, length)) ** 2 / np.sum(window**2)
    return np.asarray(power[np.round(hertz * dt * length).astype(np.int64) % length])


def _powers(span: Span, signal: Array, numbers: npt.NDArray[np.int64], step: float, ratio: float) -> Array:
    """Power at whole multiples of a step, roughly: band by band, gathered in bins of angle and transformed at once."""
    # From the lowest angle on: where the encoder has its zero must not move what is gathered in a bin.
    powers, angle = np.zeros(len(numbers)), span.angle - span.angle.min()
    edges = [0, *np.flatnonzero(np.diff(np.floor(np.log(numbers) / log(BAND)))) + 1, len(numbers)]
    for low, high in pairwise(edges):
        passed = _passed(span, float(numbers[high - 1]) * step, ratio)
        if passed.sum() >= LEAST_ROWS:
            bins = FINE * int(numbers[high - 1])
            place = np.floor(angle[passed] * (step * bins / (2 * pi))).astype(np.int64) % bins
            gathered = np.bincount(place, signal[passed] - signal[passed].mean(), bins)
            powers[low:high] = np.abs(np.fft.rfft(gathered)[numbers[low:high]]) ** 2 / passed.sum()
    return powers


def _passed(span: Span, cycles: float, ratio: float) -> npt.NDArray[np.bool_]:
    """Rows slow enough for the filter to pass so many cycles per turn."""
    return np.asarray(np.abs(span.v) * ratio * cycles < 2 * pi * span.cutoff * 0.8)


def _power(span: Span, signal: Array, cycles: float, ratio: float) -> float:
    """Power of a signal at a number of cycles per turn, over the rows slow enough for the filter to pass them."""
    passed = _passed(span, cycles, ratio)
    if passed.sum() < LEAST_ROWS:
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
