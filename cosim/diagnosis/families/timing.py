"""Timing: between command and torque, and between two clocks."""

from collections.abc import Iterator

import numpy as np

from cosim.diagnosis.candidates import Candidate, Span, has
from cosim.diagnosis.prepare import Array
from pyfmi_models.effects import ActuatorLag, Delay, Effect
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.mount import Mount


def late(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Delays and lags of several sizes."""
    if not span.asked:
        return
    for ms in (0.3, 1.0, 3.0, 8.0):
        for effect in (Delay(delay_ms=ms), ActuatorLag(time_constant_ms=ms)):
            if not has(mount, type(effect)):

                def start(c: Array, effect: Effect = effect, ms: float = ms) -> Effect:
                    return _timed(effect, ms * float(c[0]))

                yield Candidate(effect.id, (effect,), (), start)


def _timed(effect: Effect, ms: float) -> Effect:
    ms = float(np.clip(ms, 0.03, 40))
    return Delay(delay_ms=ms) if isinstance(effect, Delay) else ActuatorLag(time_constant_ms=ms)


def clocks(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Readings that are newer or older than the torque beside them, or that drift either way."""
    if has(mount, ClockSkew) or not span.asked:
        return
    ways = [ClockSkew(offset_ms=ms) for ms in (1.0, 4.0)]
    # One drifts from nothing, one through nothing in the middle of a recording: together with an offset, any drift.
    ways += [ClockSkew(drift_ppm=4e3 / span.seconds, offset_ms=middle) for middle in (0.0, -2.0)]
    for way in ways:

        def start(c: Array, way: ClockSkew = way) -> Effect:
            size = float(np.copysign(np.clip(abs(c[0]), 0.03, 10), c[0]))
            return ClockSkew(offset_ms=size * way.offset_ms + 1e-3, drift_ppm=size * way.drift_ppm + 1e-3)

        yield Candidate("clock_skew", (way,), (), start)
