"""What is kept of a run: one number for each statistic.

    rms_error = { signal = "reference.position", minus = "mount.q", kind = "rms", from = 3.0, unit = "arcsec" }

`signal` is a column of the scenario's recording or any `component.variable` or `signal.output`; `minus`, where given,
is taken off it. It is looked at from `from` to `to` [s] (the whole run where not given), in `unit`. Kinds, over the
rows x_k in that window, which are dt apart:

    mean, std, min, max, rms     as usual; std is about the mean
    peak                         max |x_k|
    ise, iae                     dt sum x_k^2, dt sum |x_k|
    final                        the last row
"""

from collections.abc import Callable, Mapping
from math import inf
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from cosim.data.recording import Recording
from cosim.support.errors import SweepError, UnitError
from cosim.support.statistics import rms
from cosim.support.units import conversion

KINDS: Mapping[str, Callable[[np.ndarray, float], float]] = {
    "mean": lambda x, dt: float(np.mean(x)),
    "std": lambda x, dt: float(np.std(x)),
    "min": lambda x, dt: float(np.min(x)),
    "max": lambda x, dt: float(np.max(x)),
    "rms": lambda x, dt: rms(x),
    "peak": lambda x, dt: float(np.max(np.abs(x))),
    "ise": lambda x, dt: float(np.sum(x * x) * dt),
    "iae": lambda x, dt: float(np.sum(np.abs(x)) * dt),
    "final": lambda x, dt: float(x[-1]),
}
POWERS = {"ise": "2.s", "iae": ".s"}
"""What the units of integrals over time end with."""


class Statistic(BaseModel):
    """One number made of a signal of a run."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True)

    signal: str
    kind: Literal["mean", "std", "min", "max", "rms", "peak", "ise", "iae", "final"]
    minus: str = ""
    begin: float = Field(default=0.0, ge=0, alias="from")
    end: float = Field(default=inf, gt=0, alias="to", allow_inf_nan=True)
    unit: str = ""

    @model_validator(mode="after")
    def _window(self) -> "Statistic":
        if self.begin >= self.end:
            raise ValueError(f"from = {self.begin:g} must be before to = {self.end:g}")
        return self

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of what it is made of."""
        return (self.signal, self.minus) if self.minus else (self.signal,)

    def of(self, recording: Recording) -> float:
        """Compute it.

        Raises:
            SweepError: no row lies in the window, or the units do not fit.
        """
        t = recording.t
        dt = float(t[1] - t[0]) if len(t) > 1 else 0.0
        inside = slice(*np.searchsorted(t, (self.begin - 1e-3 * dt, self.end + 1e-3 * dt)).tolist())
        if not len(t[inside]):
            window = f"from = {self.begin:g} and to = {self.end:g} s"
            message = f"No row of the run lies between {window}; it ends at {t[-1]:g} s."
            raise SweepError(message, culprit=self.signal, value=self.begin)
        x = recording[self.signal][inside]
        if self.minus:
            ours, shift = self._conversion(recording, self.minus, recording.units.get(self.signal, ""))
            x = x - (ours * recording[self.minus][inside] + shift)
        gain, offset = self._conversion(recording, self.signal, self.unit)
        # A difference has no offset: 3 K more are 3 degC more.
        return KINDS[self.kind](gain * x + (0.0 if self.minus else offset), dt)

    def checked_unit(self, recording: Recording, stop: float) -> str:
        """Return the unit of the number, empty where it is not known; a run ends at `stop` [s].

        Raises:
            SweepError: the units do not fit, or the window begins after the end.
        """
        if self.begin > stop:
            message = f'The statistic of "{self.signal}" begins at {self.begin:g} s, but the run ends at {stop:g} s.'
            raise SweepError(message, culprit=self.signal, value=self.begin)
        self.model_copy(update={"begin": 0.0, "end": inf}).of(recording)
        unit = self.unit or recording.units.get(self.signal, "")
        power = POWERS.get(self.kind, "")
        return f"({unit}){power}" if power and not unit.isalpha() else f"{unit}{power}"

    def _conversion(self, recording: Recording, name: str, unit: str) -> tuple[float, float]:
        try:
            return conversion(recording.units.get(name, ""), unit)
        except UnitError as error:
            message = f'The statistic of "{self.signal}" in {unit}: {error}'
            raise SweepError(message, culprit=name, value=unit) from error
