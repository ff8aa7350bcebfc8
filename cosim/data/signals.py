"""Signals: set points, noise and replayed recordings, computed chunk by chunk from integer ticks.

A signal says what it gives (`outputs`: name to unit) and makes a stream: ticks of shape (n,) to values of shape
(outputs, n). A stream is asked for every tick once, in order, so noise may draw as it goes; the chunks do not matter.
A moving set point gives position, velocity and acceleration that belong together exactly.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from pydantic import Field, model_validator

from cosim.data.set_points import Chirp, Multisine, Ramp, Sidereal, SignalSection, Sine, Slews, Star, Stream
from cosim.support.errors import SignalError

FEW_SINES = 100
"""Sines of a signal that take no longer than the step for which they are added, some us: a run may be endless."""
MOST_SINES = 2e9
"""Sines that a signal may add in a run: a minute or two of a processor."""


class Signal(Protocol):
    """What the master feeds from outside."""

    @property
    def outputs(self) -> Mapping[str, str]:
        """Names of the outputs with their units."""

    def stream(self, step: float) -> Stream:
        """Make a stream that starts at tick 0; a tick lasts `step` seconds."""


def check_signal(name: str, signal: Signal, step: float, ticks: int) -> None:
    """Refuse a signal that its samples could not show, or that takes minutes to compute.

    Raises:
        SignalError: a frequency is half of that of the ticks, or above; or it adds too many sines in a run of `ticks`.
    """
    frequencies, limit = getattr(signal, "frequencies", ()), 0.5 / step
    fastest, tones = max(frequencies, default=0.0), len(frequencies)
    if fastest >= limit:
        rule = f"at a step of {step:g} s it must stay below {limit:g} Hz"
        raise SignalError(f'The signal "{name}" has {fastest:g} Hz; {rule}.', culprit=name, value=fastest)
    if tones * ticks > MOST_SINES and tones > FEW_SINES:
        rule = f"in {ticks:,} steps that is {tones * ticks:.3g} sines, and {MOST_SINES:.3g} are the most"
        way = 'Take fewer, a shorter run, or replay the sum from a recording (kind = "recorded")'
        raise SignalError(f'The signal "{name}" has {tones:,} frequencies; {rule}. {way}.', culprit=name, value=tones)


class Constant(SignalSection):
    """One value for ever."""

    kind: Literal["constant"]
    value: float

    def stream(self, step: float) -> Stream:
        """Make a stream of the value."""
        return lambda ticks: np.full((1, len(ticks)), self.value)


class Steps(SignalSection):
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


class Noise(SignalSection):
    """White Gaussian noise, a fresh sample each tick, the same for the same seed."""

    kind: Literal["noise"]
    rms: float = Field(ge=0)
    seed: int = Field(ge=0)

    def stream(self, step: float) -> Stream:
        """Make a stream that draws from its own generator."""
        random = np.random.default_rng(self.seed)
        return lambda ticks: self.rms * random.standard_normal((1, len(ticks)))


class Recorded(SignalSection):
    """A column of a recording, replayed: `hold` keeps a sample until the next, `linear` joins them; ends are held."""

    kind: Literal["recorded"]
    file: Path
    column: str
    interpolation: Literal["hold", "linear"] = "linear"

    def stream(self, step: float) -> Stream:
        """Read the file and make a stream; its first sample is at tick 0."""
        from cosim.data.recording import Recording

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
            rule = "it must be one value a tick, or a number"
            message = f'The signal "{name}" has the shape {self._values.shape}; {rule}.'
            raise SignalError(message, culprit=name, value=self._values.shape)

    @property
    def constant(self) -> bool:
        """Whether it is a number, the same in every tick."""
        return self._values.ndim == 0

    def stream(self, step: float) -> Stream:
        """Make a stream of the array."""
        if self.constant:
            return lambda ticks: np.full((1, len(ticks)), float(self._values))
        return lambda ticks: self._values[ticks[0] : ticks[-1] + 1][np.newaxis]

    def check(self, ticks: int) -> None:
        """Refuse a run that is longer than the array.

        Raises:
            SignalError: there are fewer values than ticks.
        """
        if not self.constant and len(self._values) < ticks:
            message = f'The signal "{self._name}" has {len(self._values):,} samples; the run needs {ticks:,}.'
            raise SignalError(message, culprit=self._name, value=len(self._values))


Generator = Annotated[
    Constant | Sine | Ramp | Sidereal | Star | Multisine | Chirp | Slews | Steps | Noise | Recorded,
    Field(discriminator="kind"),
]

__all__ = [
    "Chirp",
    "Constant",
    "Generator",
    "Multisine",
    "Noise",
    "Ramp",
    "Recorded",
    "Samples",
    "Sidereal",
    "Signal",
    "Sine",
    "Slews",
    "Star",
    "Steps",
    "Stream",
    "check_signal",
]
