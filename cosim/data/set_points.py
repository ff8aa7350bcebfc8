"""Set points: motions whose position, velocity and acceleration belong together exactly."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from math import pi
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from cosim.data.profile import Motion, envelope, slews
from cosim.data.star import SIDEREAL_RATE, path
from cosim.support.elementary import sine_and_cosine
from cosim.support.numbers import LONGEST

Stream = Callable[[np.ndarray], np.ndarray]
Positive = Annotated[float, Field(gt=0)]
Dwell = Annotated[float, Field(ge=0)]
PIECE = 12_288
"""Ticks computed at a time: arrays of 96 KiB stay in the cache, and malloc keeps them instead of giving them back."""
ZENITH = 1 / 3600
"""Stars that pass the zenith closer than this [deg] are refused: there is no azimuth to go to."""


def in_pieces(motion: Callable[[np.ndarray], np.ndarray], step: float) -> Stream:
    """Make a stream of a motion over time [s]; a tick lasts `step` seconds."""

    def give(ticks: np.ndarray) -> np.ndarray:
        starts = range(0, max(len(ticks), 1), PIECE)
        return np.concatenate([motion(ticks[k : k + PIECE] * step) for k in starts], axis=1)

    return give


class SignalSection(BaseModel):
    """A signal as a section of a scenario: unknown keys and numbers that are none are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    unit: str = ""

    @property
    def outputs(self) -> Mapping[str, str]:
        """A single value, unless a kind says otherwise."""
        return {"value": self.unit}


class SetPoint(SignalSection):
    """A motion with an optional smooth start: the motion times a quintic rise over `smooth_start` seconds."""

    unit: str = "rad"
    smooth_start: float = Field(default=0.0, ge=0, le=LONGEST)

    @property
    def outputs(self) -> Mapping[str, str]:
        """Position and its two derivatives."""
        return {"position": self.unit, "velocity": f"{self.unit}/s", "acceleration": f"{self.unit}/s2"}

    @abstractmethod
    def motion(self, t: np.ndarray) -> Motion:
        """Return position, velocity and acceleration, each of the shape of t [s]."""

    def stream(self, step: float) -> Stream:
        """Make a stream of the motion."""
        return in_pieces(lambda t: np.stack(envelope(self.motion(t), t, self.smooth_start)), step)


class Sine(SetPoint):
    """A sin(2 pi f t + phase); its size is given as amplitude or as greatest velocity (A = v / (2 pi f))."""

    kind: Literal["sine"]
    frequency: Positive
    amplitude: float | None = None
    max_velocity: float | None = None
    phase: float = 0.0

    @model_validator(mode="after")
    def _one_size(self) -> "Sine":
        if (self.amplitude is None) == (self.max_velocity is None):
            raise ValueError("give either amplitude or max_velocity")
        return self

    @property
    def frequencies(self) -> list[float]:
        """Its frequency [Hz]."""
        return [self.frequency]

    def motion(self, t: np.ndarray) -> Motion:
        """Return the sine and its derivatives."""
        rate = 2 * pi * self.frequency
        size = self.amplitude if self.amplitude is not None else (self.max_velocity or 0.0) / rate
        return _sum_of_sines(t, [rate], [size], [self.phase])


class Ramp(SetPoint):
    """A constant velocity: position = start + velocity t; a smooth start begins at rest at `start`."""

    kind: Literal["ramp"]
    velocity: float
    start: float = 0.0

    def motion(self, t: np.ndarray) -> Motion:
        """Return the way from `start`; its acceleration is zero."""
        return self.velocity * t, np.full_like(t, self.velocity), np.zeros_like(t)

    def stream(self, step: float) -> Stream:
        """Make a stream of the motion."""
        way = super().stream(step)
        return lambda ticks: way(ticks) + np.array([[self.start], [0.0], [0.0]])


class Sidereal(Ramp):
    """The stars' own speed, or that of another object where `velocity` says so."""

    kind: Literal["sidereal"]  # type: ignore[assignment]
    velocity: float = SIDEREAL_RATE


class Star(SignalSection):
    """The path of a star over an observer at a latitude: azimuth and altitude [rad] with their derivatives.

    The hour angle [h] is that at the start; -0.5 is half an hour before the star culminates. See `star` for the
    equations and what they leave out. Near the zenith the azimuth rate grows like the sidereal rate times
    cos(declination) over the distance from the zenith: there is a blind spot in which no such mount can follow.
    """

    kind: Literal["star"]
    latitude_deg: float = Field(ge=-90, le=90)
    declination_deg: float = Field(ge=-90, le=90)
    hour_angle_h: float = 0.0

    @model_validator(mode="after")
    def _misses_the_zenith(self) -> "Star":
        if abs(self.latitude_deg - self.declination_deg) < ZENITH:
            rule = "the star passes through the zenith, where there is no azimuth that a mount could follow"
            raise ValueError(f"declination_deg = {self.declination_deg} is the latitude: {rule}")
        return self

    @property
    def outputs(self) -> Mapping[str, str]:
        """Both angles and their derivatives."""
        kinds = {"": "rad", "_velocity": "rad/s", "_acceleration": "rad/s2"}
        return {f"{angle}{kind}": unit for angle in ("azimuth", "altitude") for kind, unit in kinds.items()}

    def stream(self, step: float) -> Stream:
        """Make a stream of the path."""
        place = np.deg2rad([self.latitude_deg, self.declination_deg, 15 * self.hour_angle_h]).tolist()
        return in_pieces(lambda t: np.concatenate(path(t, *place)), step)


class Multisine(SetPoint):
    """A sum of sines with random phases from `seed`: many frequencies in one run."""

    kind: Literal["multisine"]
    frequencies: list[Positive] = Field(min_length=1)
    amplitudes: list[float] | float
    seed: int = Field(default=0, ge=0)

    @model_validator(mode="after")
    def _as_many(self) -> "Multisine":
        if isinstance(self.amplitudes, list) and len(self.amplitudes) != len(self.frequencies):
            raise ValueError(f"{len(self.amplitudes)} amplitudes for {len(self.frequencies)} frequencies")
        return self

    def motion(self, t: np.ndarray) -> Motion:
        """Return the sum and its derivatives."""
        count = len(self.frequencies)
        sizes = self.amplitudes if isinstance(self.amplitudes, list) else [self.amplitudes] * count
        phases = np.random.default_rng(self.seed).uniform(0, 2 * pi, count)
        return _sum_of_sines(t, [2 * pi * f for f in self.frequencies], sizes, phases.tolist())


class Chirp(SetPoint):
    """A sine whose frequency grows linearly from `start` to `stop` [Hz] over `duration`, and stays there."""

    kind: Literal["chirp"]
    start: Positive
    stop: Positive
    duration: Positive
    amplitude: float

    @property
    def frequencies(self) -> list[float]:
        """Those at both ends [Hz]."""
        return [self.start, self.stop]

    def motion(self, t: np.ndarray) -> Motion:
        """Return the chirp and its derivatives; the frequency has a kink at `duration`."""
        slope = 2 * pi * (self.stop - self.start) / self.duration
        rising = np.minimum(t, self.duration)
        rate = 2 * pi * self.start + slope * rising
        angle = 2 * pi * self.start * t + slope * rising * (t - rising / 2)
        bend = np.where(t < self.duration, slope, 0.0)
        sine, cosine = (self.amplitude * one for one in sine_and_cosine(angle))
        return sine, rate * cosine, bend * cosine - rate * rate * sine


class Slews(SetPoint):
    """From position to position with limited velocity, acceleration and jerk, resting `dwell` seconds at each.

    A list of dwells, one a position, makes a programme in which friction rests for different times.
    """

    kind: Literal["slews"]
    positions: list[float] = Field(min_length=2)
    dwell: Dwell | list[Dwell] = 0.0
    max_velocity: Positive
    max_acceleration: Positive
    max_jerk: Positive

    @model_validator(mode="after")
    def _as_many(self) -> "Slews":
        if isinstance(self.dwell, list) and len(self.dwell) != len(self.positions):
            raise ValueError(f"{len(self.dwell)} dwells for {len(self.positions)} positions")
        way = max(self.positions) - min(self.positions)
        longest = way / self.max_velocity + self.max_velocity / self.max_acceleration
        if not longest + self.max_acceleration / self.max_jerk <= LONGEST:
            raise ValueError(f"a move would take more than {LONGEST:g} s")
        return self

    def motion(self, t: np.ndarray) -> Motion:
        """Return the programme at t; it rests at the last position."""
        dwells = self.dwell if isinstance(self.dwell, list) else [self.dwell] * len(self.positions)
        return slews(t, self.positions, dwells, (self.max_velocity, self.max_acceleration, self.max_jerk))


def _sum_of_sines(t: np.ndarray, rates: list[float], sizes: list[float], phases: list[float]) -> Motion:
    """Add sines one after the other, which fixes the bits; as many at a time as make an array of `PIECE` numbers."""
    rate, size, phase = (np.array(one)[:, np.newaxis] for one in (rates, sizes, phases))
    position, velocity, acceleration = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    at_once = max(1, PIECE // max(len(t), 1))
    for first in range(0, len(rates), at_once):
        some = slice(first, first + at_once)
        sine, cosine = sine_and_cosine(rate[some] * t + phase[some])
        sine *= size[some]
        cosine *= rate[some] * size[some]
        acceleration = _added(acceleration, -(rate[some] * rate[some]) * sine)
        velocity = _added(velocity, cosine)
        position = _added(position, sine)
    return position, velocity, acceleration


def _added(total: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Add rows to a total in their order, in place; numpy's sum takes another order where a row is short."""
    rows[0] += total
    np.add.accumulate(rows, axis=0, out=rows)
    last: np.ndarray = rows[-1]
    return last
