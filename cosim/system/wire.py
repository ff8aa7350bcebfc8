"""A wire and a record: what is connected with what, and what becomes a column of the recording."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from cosim.system.ports import PortField


@dataclass(frozen=True)
class Wire:
    """y = quantise(gain * x + offset) + noise, from an output or signal to an input.

    `quantum` is the step of the quantiser (0: none), `noise` a signal that is added, `unit` that of gain * x + offset
    (the source's where not given). `breaks_loop` accepts that the wire's delay breaks an algebraic loop. `table` puts
    values in the place of others, numbers or names of items; what it does not name stays. `cast` takes the nearest
    value of the target's type where that does not hold what arrives.
    """

    source: PortField = PortField()
    target: PortField = PortField()
    gain: float = 1.0
    offset: float = 0.0
    quantum: float = 0.0
    noise: str = ""
    unit: str = ""
    breaks_loop: bool = False
    cast: bool = False
    table: Mapping[str, float | bool | str] = field(default_factory=dict)

    @property
    def straight(self) -> bool:
        """Whether values arrive as they are."""
        return (self.gain, self.offset, self.quantum, self.noise, dict(self.table)) == (1.0, 0.0, 0.0, "", {})


@dataclass(frozen=True)
class Record:
    """A column of the recording: the sample at the row's time, or the mean over the sample interval around it."""

    signal: PortField = PortField()
    mode: Literal["sample", "mean"] = "sample"
