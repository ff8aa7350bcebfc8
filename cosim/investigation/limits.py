"""What a motion may not leave: position, speed, acceleration, torque, frequency; planned, and in what was recorded.

Without other numbers they are what the scenario's own set point asks for: nothing moves farther or faster than it would
have without an investigation. rad, rad/s, rad/s2, N m (m, N on a linear axis), Hz.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import ceil, floor, log10

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.filters import derivative, lowpass
from cosim.estimation.prepare import Array
from cosim.support.errors import InputError

KEPT = 0.9
"""Share of a limit that a planned motion uses: the rest is for a loop that overshoots. Unit: 1."""
SLACK = 1e-9
"""Relative excess that is rounding. Unit: 1."""
SMOOTH_HZ = 30.0
"""Cutoff in front of the speed that is judged in a recording [Hz], as in the proof's protocol."""
NAMES = ("position", "speed", "acceleration", "torque", "frequency", "forbidden")


@dataclass(frozen=True)
class Limits:
    """Lowest and highest position, most speed, acceleration, torque, highest frequency of a tone, band without any."""

    low: float
    high: float
    speed: float
    acceleration: float
    torque: float
    frequency: float
    forbidden_from: float = 0.0
    forbidden_to: float = 0.0
    """Band [Hz] in which no tone may lie, such as about a resonance; from 0 to 0 there is none."""

    @classmethod
    def visited(cls, motion: tuple[Array, Array, Array], torque: float, bandwidth: float | None) -> "Limits":
        """What a set point (position, speed, acceleration) asks for; `bandwidth` of its loop [Hz], if it is known."""
        q, v, a = motion
        speed, acceleration = (float(np.abs(one).max()) / KEPT for one in (v, a))
        middle, half = (q.max() + q.min()) / 2, (q.max() - q.min()) / 2 / KEPT
        own = acceleration / (2 * np.pi * max(speed, 1e-300))
        return cls(float(middle - half), float(middle + half), speed, acceleration, torque, bandwidth or 10 * own)

    def with_given(self, given: Mapping[str, str]) -> "Limits":
        """The same with numbers in the place of some: {"position": "-0.5:0.5", "speed": "0.2", "forbidden": "12:15"}.

        Raises:
            InputError: a name is unknown, or what is given for it is no limit.
        """
        found = self
        for name, text in given.items():
            found = replace(found, **_numbers(name, text))
        return found

    def tightened(self, speed: float, torque: float) -> "Limits":
        """The same with a speed and a torque that are no larger than these."""
        return replace(self, speed=min(self.speed, speed), torque=min(self.torque, torque))

    def less(self, way: float, speed: float) -> "Limits":
        """The same, narrower by a way at both ends and by a speed."""
        return replace(self, low=self.low + way, high=self.high - way, speed=self.speed - speed)

    def left_by(self, q: Array, v: Array, a: Array) -> str:
        """The first limit that a planned motion would leave, in words; "" where it leaves none."""
        within = (_high("position", self.high, q), _low("position", self.low, q))
        moving = (_high("speed", self.speed, np.abs(v)), _high("acceleration", self.acceleration, np.abs(a)))
        return next(filter(None, (*within, *moving)), "")

    def left_in(self, recording: Recording) -> str:
        """The first limit that a recorded motion has left, in words; "" where it has left none."""
        tau, q, speed = recording["tau"], recording["q"], np.abs(_speed(recording))
        within = (_high("position", self.high, q), _low("position", self.low, q))
        return next(filter(None, (*within, _high("speed", self.speed, speed), self.torque_left(tau))), "")

    def that_allow(self, recording: Recording) -> str:
        """Limits that allow what was recorded, as `--limits` takes them, in two digits: "speed=0.25 torque=12"."""
        most = {"speed": np.abs(_speed(recording)).max(), "torque": np.abs(recording["tau"]).max()}
        found = [f"{name}={_up(value / KEPT):g}" for name, value in most.items() if value > getattr(self, name)]
        low, high = float(recording["q"].min()), float(recording["q"].max())
        if low < self.low or high > self.high:
            middle, half = (low + high) / 2, (high - low) / 2 / KEPT
            found.append(f"position={-_up(half - middle):g}:{_up(half + middle):g}")
        return " ".join(found)

    def torque_left(self, torque: Array) -> str:
        """Whether a torque is beyond its limit, in words; "" where it is not."""
        return _high("torque", self.torque, np.abs(torque))

    def as_json(self) -> dict[str, float]:
        """All limits by name."""
        return asdict(self)


def _speed(recording: Recording) -> Array:
    """Smoothed speed, over even steps: late cycles leave gaps."""
    dt = recording.sample_time
    even = np.interp(np.arange(recording.t[0], recording.t[-1], dt), recording.t, recording["q"])
    return derivative(lowpass(even, dt, SMOOTH_HZ), dt)


def _up(value: float) -> float:
    """A number rounded up to two digits."""
    step = 10.0 ** (floor(log10(abs(value))) - 1) if value else 1.0
    return ceil(value / step) * step


def _high(name: str, limit: float, values: Array) -> str:
    most = float(values.max())
    return f"{name} {most:.4g} beyond {limit:.4g}" if most > limit + SLACK * abs(limit) else ""


def _low(name: str, limit: float, values: Array) -> str:
    least = float(values.min())
    return f"{name} {least:.4g} beyond {limit:.4g}" if least < limit - SLACK * abs(limit) else ""


def _numbers(name: str, text: str) -> dict[str, float]:
    rule = "a limit is position=LOW:HIGH, forbidden=FROM:TO (Hz), or a number above 0 for " + ", ".join(NAMES[1:-1])
    try:
        if name in ("position", "forbidden"):
            low, high = (float(one) for one in text.split(":"))
            if name == "position" and low < high:
                return {"low": low, "high": high}
            if name == "forbidden" and 0 < low < high:
                return {"forbidden_from": low, "forbidden_to": high}
        elif name in NAMES and float(text) > 0:
            return {name: float(text)}
    except ValueError:
        pass
    raise InputError(f"--limits {name}={text}: {rule}.", culprit=name, value=text, choices=NAMES)
