"""What the signals of a system give, tick by tick, for the places of a plan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cosim.data.signals import Signal, Stream
from cosim.master.planning import make_streams
from cosim.support.errors import SignalError
from cosim.system.plan import Plan
from cosim.system.wiring import Wiring


@dataclass(frozen=True)
class Given:
    """The signals of a wiring, begun anew; ticks are asked for in their order."""

    wiring: Wiring
    plan: Plan

    def at(self, ticks: np.ndarray) -> np.ndarray:
        """Return what the signals give in these ticks, shape (signals, ticks).

        Raises:
            SignalError: one of them is no finite number.
        """
        with np.errstate(all="ignore"):  # what is no number any more is named below, with its time
            columns = [self._computed(number, stream, ticks) for number, stream in enumerate(self._streams)]
        given = np.concatenate(columns) if columns else np.empty((0, len(ticks)))
        self._check(given, int(ticks[0]))
        return given

    @cached_property
    def _streams(self) -> Sequence[Stream]:
        with np.errstate(all="ignore"):
            return make_streams(self.wiring, self.plan.step)

    @cached_property
    def _sources(self) -> Mapping[str, Signal]:
        return self.wiring.sources()

    def _computed(self, number: int, stream: Stream, ticks: np.ndarray) -> np.ndarray:
        try:
            return stream(ticks)
        except ArithmeticError as error:
            name = list(self._sources)[number]
            message = f'The signal "{name}" cannot be computed: its numbers lead beyond what arithmetic has.'
            raise SignalError(message, culprit=name) from error

    def _check(self, given: np.ndarray, first: int) -> None:
        """Refuse signals that are no numbers before a component meets them."""
        if np.isfinite(given).all():
            return
        row, column = np.argwhere(~np.isfinite(given))[0]
        names = [f"{name}.{output}" for name, one in self._sources.items() for output in one.outputs]
        when = f"at tick {first + column:,} ({self.plan.start + (first + column) * self.plan.step:.9g} s)"
        message = f'The signal "{names[row]}" is {given[row, column]} {when}; it must be a finite number.'
        raise SignalError(message, culprit=names[row], value=float(given[row, column]))
