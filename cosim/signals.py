"""Signals: set points, noise and replayed recordings, computed chunk by chunk from integer ticks.

A signal says what it gives (`outputs`: name to unit) and makes a stream: ticks of shape (n,) to values of shape
(outputs, n). A stream is asked for every tick once, in order, so noise may draw as it goes; the chunks do not matter.
A moving set point gives position, velocity and acceleration that belong together exactly.
"""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from math import pi
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from cosim.errors import SignalError
from cosim.profile import Motion, envelope, slews
from cosim.star import SIDEREAL_RATE, path

Stream = Callable[[np.ndarray], np.ndarray]
Positive = Annotated[float, Field(gt=0)]
Dwell = Annotated[float, Field(ge=0)]
ZENITH = 1 / 3600
"""Stars that pass the zenith closer than this [deg] are refused: there is no azimuth to go to."""


class Signal(Protocol):
    """What the master feeds from outside."""

    @property
    def outputs(self) -> Mapping[str, str]:
        """Names of the outputs with their units."""

    def stream(self, step: float) -> Stream:
        """Make a stream that starts at tick 0; a tick lasts `step` seconds."""


class _Generator(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    unit: str = ""

    @property
    def outputs(self) -> Mapping[str, str]:
        """A single value, unless a kind says otherwise."""
        return {"value": self.unit}


class _SetPoint(_Generator):
    """A motion with an optional smooth start: the motion times a quintic rise over `smooth_start` seconds."""

    unit: str = "rad"
    smooth_start: float = Field(default=0.0, ge=0)

    @property
    def outputs(self) -> Mapping[str, str]:
        """Position and its two derivatives."""
        return {"position": self.unit, "velocity": f"{self.unit}/s", "acceleration": f"{self.unit}/s2"}

    @abstractmethod
    def motion(self, t: np.ndarray) -> Motion:
        """Return position, velocity and acceleration, each of the shape of t [s]."""

    def stream(self, step: float) -> Stream:
        """Make a stream of the motion."""
        return lambda ticks: np.stack(envelope(self.motion(ticks * step), ticks * step, self.smooth_start))


class Constant(_Generator):
    """One value for ever."""

    kind: Literal["constant"]
    value: float

    def stream(self, step: float) -> Stream:
        """Make a stream of the value."""
        return lambda ticks: np.full((1, len(ticks)), self.value)


class Sine(_SetPoint):
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

    def motion(self, t: np.ndarray) -> Motion:
        """Return the sine and its derivatives."""
        rate = 2 * pi * self.frequency
        size = self.amplitude if self.amplitude is not None else (self.max_velocity or 0.0) / rate
        return _sum_of_sines(t, [rate], [size], [self.phase])


class Ramp(_SetPoint):
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


class Star(_Generator):
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
        return lambda ticks: np.concatenate(path(ticks * step, *place))


class Multisine(_SetPoint):
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


class Chirp(_SetPoint):
    """A sine whose frequency grows linearly from `start` to `stop` [Hz] over `duration`, and stays there."""

    kind: Literal["chirp"]
    start: Positive
    stop: Positive
    duration: Positive
    amplitude: float

    def motion(self, t: np.ndarray) -> Motion:
        """Return the chirp and its derivatives; the frequency has a kink at `duration`."""
        slope = 2 * pi * (self.stop - self.start) / self.duration
        rising = np.minimum(t, self.duration)
        rate = 2 * pi * self.start + slope * rising
        angle = 2 * pi * self.start * t + slope * rising * (t - rising / 2)
        bend = np.where(t < self.duration, slope, 0.0)
        sine, cosine = self.amplitude * np.sin(angle), self.amplitude * np.cos(angle)
        return sine, rate * cosine, bend * cosine - rate * rate * sine


class Slews(_SetPoint):
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
        return self

    def motion(self, t: np.ndarray) -> Motion:
        """Return the programme at t; it rests at the last position."""
        dwells = self.dwell if isinstance(self.dwell, list) else [self.dwell] * len(self.positions)
        return slews(t, self.positions, dwells, (self.max_velocity, self.max_acceleration, self.max_jerk))


class Steps(_Generator):
    """Holds values[i] from times[i] on, and `initial` before."""

    kind: Literal["steps"]
    times: list[float] = Field(min_length=1)
    values: list[float]
    initial: float = 0.0

    @model_validator(mode="after")
    def _fit(self) -> "Steps":
        if len(self.times) != len(self.values) or sorted(set(self.times)) != self.times:
            raise ValueError("times must grow and be as many as values")
        return self

    def stream(self, step: float) -> Stream:
        """Make a stream; a step acts from the first tick at or after its time (to a thousandth of a tick)."""
        first = np.ceil(np.array(self.times) / step - 1e-3)
        levels = np.array([self.initial, *self.values])
        return lambda ticks: levels[np.searchsorted(first, ticks, side="right")][np.newaxis]


class Noise(_Generator):
    """White Gaussian noise, a fresh sample each tick, the same for the same seed."""

    kind: Literal["noise"]
    rms: float = Field(ge=0)
    seed: int = Field(ge=0)

    def stream(self, step: float) -> Stream:
        """Make a stream that draws from its own generator."""
        random = np.random.default_rng(self.seed)
        return lambda ticks: self.rms * random.standard_normal((1, len(ticks)))


class Recorded(_Generator):
    """A column of a recording, replayed: `hold` keeps a sample until the next, `linear` joins them; ends are held."""

    kind: Literal["recorded"]
    file: Path
    column: str
    interpolation: Literal["hold", "linear"] = "linear"

    def stream(self, step: float) -> Stream:
        """Read the file and make a stream; its first sample is at tick 0."""
        from cosim.recording import Recording

        recording = Recording.read(self.file, required=())
        if self.column not in recording:
            have = ", ".join(recording.columns)
            message = f'{self.file} has no column "{self.column}" to replay; it has: {have}.'
            raise SignalError(message, culprit=self.column, choices=recording.columns)
        t, values = recording.t - recording.t[0], recording[self.column]
        if self.interpolation == "linear":
            return lambda ticks: np.interp(ticks * step, t, values)[np.newaxis]
        first = np.ceil(t / step - 1e-3)
        return lambda ticks: values[np.searchsorted(first, ticks, side="right") - 1][np.newaxis]


class Samples:
    """An array with one value for each tick."""

    def __init__(self, values: Any, unit: str = "", name: str = "signal") -> None:
        self._values, self._name = np.asarray(values, dtype=np.float64), name
        self.outputs: Mapping[str, str] = {"value": unit}
        if self._values.ndim > 1:
            message = (
                f'The signal "{name}" has the shape {self._values.shape}; it must be one value a tick, or a number.'
            )
            raise SignalError(message, culprit=name, value=self._values.shape)

    def stream(self, step: float) -> Stream:
        """Make a stream of the array."""
        return self._take

    def check(self, ticks: int) -> None:
        """Refuse a run that is longer than the array.

        Raises:
            SignalError: there are fewer values than ticks.
        """
        if self._values.ndim and len(self._values) < ticks:
            message = f'The signal "{self._name}" has {len(self._values):,} samples; the run needs {ticks:,}.'
            raise SignalError(message, culprit=self._name, value=len(self._values))

    def _take(self, ticks: np.ndarray) -> np.ndarray:
        if self._values.ndim == 0:
            return np.full((1, len(ticks)), float(self._values))
        return self._values[ticks[0] : ticks[-1] + 1][np.newaxis]


Generator = Annotated[
    Constant | Sine | Ramp | Sidereal | Star | Multisine | Chirp | Slews | Steps | Noise | Recorded,
    Field(discriminator="kind"),
]


def _sum_of_sines(t: np.ndarray, rates: list[float], sizes: list[float], phases: list[float]) -> Motion:
    position, velocity, acceleration = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for rate, size, phase in zip(rates, sizes, phases, strict=True):
        sine, cosine = size * np.sin(rate * t + phase), size * np.cos(rate * t + phase)
        position, velocity, acceleration = position + sine, velocity + rate * cosine, acceleration - rate * rate * sine
    return position, velocity, acceleration
