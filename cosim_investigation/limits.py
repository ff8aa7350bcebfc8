"""What a motion may not leave: position, speed, acceleration, torque, frequency; planned, and in what was recorded.

Without other numbers they are what the scenario's own set point asks for: nothing moves farther or faster than it would
have without an investigation. rad, rad/s, rad/s2, N m (m, N on a linear axis), Hz.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import ceil, floor, isfinite, log10

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
SMALLEST, LARGEST = 1e-12, 1e12
"""What a limit that is given may be, in SI: no axis is beyond, and numbers far beyond overflow."""
TONAL = 0.01
"""Share of the energy of an acceleration that lies above a frequency, or in a band, before it counts. Unit: 1."""
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
    def visited(
        cls, motion: tuple[Array, Array, Array], torque: float, bandwidth: float | None, frequency: float = 0.0
    ) -> "Limits":
        """What a set point (position, speed, acceleration) asks for.

        `bandwidth` of its loop [Hz], if it is known; `frequency` of the set point itself [Hz], by `frequency_of`.
        """
        q, v, a = motion
        speed, acceleration = (float(np.abs(one).max()) / KEPT for one in (v, a))
        middle, half = (q.max() + q.min()) / 2, (q.max() - q.min()) / 2 / KEPT
        own = acceleration / (2 * np.pi * max(speed, 1e-300))
        highest = max(bandwidth or 10 * own, frequency / KEPT)
        return cls(float(middle - half), float(middle + half), speed, acceleration, torque, highest)

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

    def left_by_tones(self, v: Array, a: Array, dt: float) -> str:
        """Whether a motion that was not designed is faster than tones may be, or has one in the forbidden band."""
        fastest = frequency_of(v, a, dt)
        if fastest > self.frequency * (1 + SLACK):
            return f"frequency {fastest:.4g} beyond {self.frequency:.4g}"
        hertz, energy = _spectrum(a, dt)
        inside = (hertz >= self.forbidden_from) & (hertz <= self.forbidden_to) & (self.forbidden_to > 0)
        if energy[inside].sum() > TONAL * energy.sum():
            return f"forbidden band of {self.forbidden_from:g} to {self.forbidden_to:g} Hz, in which a part of it lies"
        return ""

    def left_in(self, recording: Recording) -> str:
        """The first limit that a recorded motion has left, in words; "" where it has left none."""
        tau, q, speed = recording["tau"], recording["q"], np.abs(_speed(recording))
        within = (_high("position", self.high, q), _low("position", self.low, q))
        return next(filter(None, (*within, _high("speed", self.speed, speed), self.torque_left(tau))), "")

    def that_allow(self, recording: Recording) -> str:
        """Limits that allow what was recorded, as `--limits` takes them, in two digits: "speed=0.25 torque=12"."""
        most = {"speed": np.abs(_speed(recording)).max(), "torque": np.abs(recording["tau"]).max()}
        return self.allowing(recording["q"], most)

    def allowing(self, q: Array, most: Mapping[str, float]) -> str:
        """Limits that allow positions, and the most of what is limited otherwise by name, as `--limits` takes them."""
        found = [f"{name}={_up(value / KEPT):g}" for name, value in most.items() if value > getattr(self, name)]
        low, high = float(q.min()), float(q.max())
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


def frequency_of(v: Array, a: Array, dt: float) -> float:
    """The frequency of a motion [Hz]: of a tone its own, of other motions where nearly all of its acceleration ends.

    That of the sine with its top speed and acceleration, or the one above which a hundredth of the energy of the
    acceleration lies, less what the length of the motion blurs it by.
    """
    top = float(np.abs(a).max()) / (2 * np.pi * max(float(np.abs(v).max()), 1e-300))
    hertz, energy = _spectrum(a, dt)
    total = np.cumsum(energy)
    ends = float(hertz[np.searchsorted(total, (1 - TONAL) * total[-1])]) if total[-1] > 0 else 0.0
    return max(top, ends - 1.5 / (dt * len(a)))


def _spectrum(a: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and the energy of an acceleration at each, between a rise and a fall."""
    energy = np.abs(np.fft.rfft(a * np.hanning(len(a)))) ** 2
    return np.arange(len(energy)) / (dt * len(a)), np.asarray(energy, float)


def _numbers(name: str, text: str) -> dict[str, float]:
    rule = "a limit is position=LOW:HIGH, forbidden=FROM:TO (Hz), or a number above 0 for " + ", ".join(NAMES[1:-1])
    try:
        numbers = [float(one) for one in str(text).split(":")]
        if not all(map(isfinite, numbers)):
            rule = f"a limit is a finite number, from {SMALLEST:g} to {LARGEST:g}"
        elif name in ("position", "forbidden"):
            low, high = numbers
            if low < high and not (high - low >= SMALLEST and max(abs(low), abs(high)) <= LARGEST):
                rule = f"its ends are at most {LARGEST:g} and at least {SMALLEST:g} apart"
            elif name == "position" and low < high:
                return {"low": low, "high": high}
            elif name == "forbidden" and 0 < low < high:
                return {"forbidden_from": low, "forbidden_to": high}
        elif name in NAMES and len(numbers) == 1 and numbers[0] > 0:
            if SMALLEST <= numbers[0] <= LARGEST:
                return {name: numbers[0]}
            rule = f"a limit is a finite number, from {SMALLEST:g} to {LARGEST:g}"
    except ValueError:
        pass
    raise InputError(f"--limits {name}={text}: {rule}.", culprit=name, value=text, choices=NAMES)
