"""Faults: from a time on a wire or a signal no longer gives what it should.

    [[faults]]
    on = "controller.q"     an input, so the wire that feeds it, or a signal: "reference.position", "reference"
    kind = "override" (value) | "scale" (factor) | "offset" (value) | "freeze" | "noise" (rms, seed)
    from = 5.0, until = 6.0 [s]; without `until` it stays

Values are in the unit of what the fault is on. It acts after quantiser and noise of a wire: it is what the component
reads. Several faults on one wire act in the order in which they are written. Chance is seeded.
"""

from abc import abstractmethod
from math import ceil
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from cosim.data.signals import Noise, Stream
from cosim.support.numbers import LONGEST
from cosim.system import plan

FOR_EVER = 1 << 62


class _Fault(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True)

    on: str
    start: float = Field(alias="from", ge=0, le=LONGEST)
    until: float | None = Field(default=None, le=LONGEST)

    @model_validator(mode="after")
    def _lasts(self) -> "_Fault":
        if self.until is not None and self.until <= self.start:
            raise ValueError(f"until = {self.until} must lie after from = {self.start}")
        return self

    def ticks(self, step: float) -> tuple[int, int]:
        """Return the first tick and the first after the last, from the first at or after each time (as in `steps`)."""
        times = (self.start, LONGEST if self.until is None else self.until)
        first, last = (min(ceil(time / step - 1e-3), FOR_EVER) for time in times)
        return first, FOR_EVER if self.until is None else last

    def noise(self) -> Noise | None:
        """Return the noise that the fault adds, if it does."""
        return None

    @abstractmethod
    def form(self) -> tuple[float, float, bool]:
        """Return gain, offset and whether the value is frozen."""

    def of_wire(self, step: float, noise: int) -> plan.Fault:
        """Return what the loop does; `noise` is the place of the noise on the bus, -1 for none."""
        gain, offset, freeze = self.form()
        return plan.Fault(*self.ticks(step), gain, offset, noise, freeze)


class Override(_Fault):
    """A fixed value."""

    kind: Literal["override"]
    value: float

    def form(self) -> tuple[float, float, bool]:
        """0 x + value."""
        return 0.0, self.value, False


class Scale(_Fault):
    """Too much or too little."""

    kind: Literal["scale"]
    factor: float

    def form(self) -> tuple[float, float, bool]:
        """Factor times x."""
        return self.factor, 0.0, False


class Offset(_Fault):
    """Shifted."""

    kind: Literal["offset"]
    value: float

    def form(self) -> tuple[float, float, bool]:
        """X + value."""
        return 1.0, self.value, False


class Freeze(_Fault):
    """Stuck at the value of the first tick."""

    kind: Literal["freeze"]

    def form(self) -> tuple[float, float, bool]:
        """Hold x."""
        return 1.0, 0.0, True


class NoiseFault(_Fault):
    """White Gaussian noise on top."""

    kind: Literal["noise"]
    rms: float = Field(ge=0)
    seed: int = Field(ge=0)

    def noise(self) -> Noise:
        """Return the noise."""
        return Noise(kind="noise", rms=self.rms, seed=self.seed)

    def form(self) -> tuple[float, float, bool]:
        """X, with the noise added by the loop."""
        return 1.0, 0.0, False


Fault = Annotated[Override | Scale | Offset | Freeze | NoiseFault, Field(discriminator="kind")]


def broken(stream: Stream, fault: _Fault, output: int, step: float) -> Stream:
    """Return the stream of a signal with a fault on one of its outputs."""
    first, last = fault.ticks(step)
    gain, offset, freeze = fault.form()
    made = fault.noise()
    noise = made.stream(step) if made else None
    held: list[float] = []

    def give(ticks: np.ndarray) -> np.ndarray:
        values = np.array(stream(ticks))
        drawn = noise(ticks)[0] if noise else 0.0
        active = (ticks >= first) & (ticks < last)
        if freeze and active.any():
            held[:] = held or [values[output, active][0]]
        wrong = np.full(len(ticks), held[0] if held else 0.0) if freeze else gain * values[output] + offset + drawn
        values[output] = np.where(active, wrong, values[output])
        return values

    return give
