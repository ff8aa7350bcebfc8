"""What a drive does not give of its command: a table over the command, or a torque constant that is none."""

from dataclasses import dataclass, replace
from math import log
from typing import ClassVar, Self

import casadi as ca
import numpy as np

from pyfmi_models.effects.base import DriveEffect, Motion, percent
from pyfmi_models.effects.learned_base import FOLLOWED, MOST_WAVES, ROWS, Array, LearnedEffect, TableEffect
from pyfmi_models.effects.learned_table import LearnedTable
from pyfmi_models.model import Scalar, parameter, structure
from pyfmi_models.waves import broken_range, span, spoken, waves

LEAST_RISE = 0.01
"""Torque per command that is left of a table that was made smaller: with less a motion hardly tells the command."""
OVERSHOT = 1.3
"""Largest rise of what is missing per command of a table that is only made smaller; a steeper one is flattened."""
STEPS, CLOSER = 401, (1.0, 0.2, 0.04)
"""Commands at which a table is flattened, and shares of the range in which they lie closer, as its waves do."""


@dataclass(frozen=True, kw_only=True)
class LearnedDrive(LearnedEffect, DriveEffect):
    """What a drive does not give of its command: applied = command - table(command).

        table = share sum_k c_k cos(pi k x),   x over `command_seen` as for a speed

    A dead band, a bent torque constant or a limit that nobody wrote down. Constant outside the range seen.
    """

    id: ClassVar[str] = "learned"
    equation: ClassVar[str] = "Σ c cos(k π x)"
    told_apart_by: ClassVar[str] = TableEffect.told_apart_by
    action: ClassVar[str] = "Measure what the drive gives at small and at large commands."
    kind: ClassVar[str] = "drive"
    filled: ClassVar[str] = "missing"
    command_seen: tuple[float, ...] = structure("N.m", "Lowest and highest command seen", low=-1e9, high=1e9)
    missing: tuple[float, ...] = structure("N.m", "Coefficients of the waves", low=-1e9, high=1e9)
    share: Scalar = parameter("1", "Share of the table that acts", default=1.0, low=0, high=1, fitted=False)

    def applied(self, state: object, command: Scalar) -> Scalar:
        """`command - table(command)`."""
        shapes = waves(command, "command", self.command_seen, len(self.coefficients()) - 1)
        table = sum(c * shape for c, shape in zip(self.coefficients(), shapes, strict=True))
        return command - self.share * table

    def broken_rule(self) -> str:
        """More command gives more torque, everywhere."""
        if not self.missing or len(self.missing) > MOST_WAVES:
            return f"missing has {len(self.missing)} coefficients; it needs 1 to {MOST_WAVES}"
        if rule := broken_range("command", "command_seen", self.command_seen):
            return rule
        return "the drive gives less where it is asked for more" if self._steepest() >= 1 else ""

    def learned_in(self, linear: bool = False) -> str:
        """Say the range."""
        return f"over {span('command', self.command_seen, linear)}"

    def size(self) -> float:
        """Half the range of what is missing."""
        return float(np.ptp(self.curve(2001)[1])) / 2

    def curve(self, count: int) -> tuple[Array, Array]:
        """Commands over the range seen, and what is missing of each."""
        command = np.linspace(self.command_seen[0], self.command_seen[1], count)
        return command, command - np.asarray(ca.DM(self.applied((), ca.DM(command))).full().ravel())

    def quantities(self) -> tuple[str, ...]:
        """The command."""
        return ("command",)

    def for_reader(self, unit: str) -> LearnedTable:
        """What is missing of commands over the range seen."""
        command, missing = self.curve(ROWS)
        return {"kind": self.kind, "command": command.tolist(), "missing": missing.tolist(), "unit": unit}

    def _steepest(self) -> float:
        """Largest rise of what is missing per command."""
        command, missing = self.curve(2001)
        return float((np.diff(missing) / np.diff(command)).max())

    def admitted(self) -> Self:
        """A table that overshoots made flatter: more command gives more torque, at least `LEAST_RISE`."""
        steepest = self._steepest()
        flat = self if steepest < OVERSHOT else self._flattened()
        steepest = flat._steepest()
        if not 1 <= steepest < OVERSHOT:
            return flat if steepest < 1 else self
        return replace(flat, missing=tuple((1 - LEAST_RISE) / steepest * one for one in flat.missing))

    def _flattened(self) -> Self:
        """A table that rises from no command to what it was no faster than it may: a series overshoots about a kink."""
        whole = np.linspace(self.command_seen[0], self.command_seen[1], STEPS)
        command = np.unique(np.concatenate([share * whole for share in CLOSER]))
        shapes = waves(ca.DM(command), "command", self.command_seen, len(self.missing) - 1)
        table = np.column_stack([np.broadcast_to(np.ravel(ca.DM(one).full()), len(command)) for one in shapes])
        cut = _rising(command, table @ np.array(self.missing))
        return replace(self, missing=tuple(np.linalg.lstsq(table, cut, rcond=None)[0].tolist()))

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return (
            f"The drive gives up to {self.size():.2g} {unit} less or more than its command; a table learned from data."
        )


def _rising(command: Array, missing: Array) -> Array:
    """Values that rise, from no command outwards, by at most `1 - LEAST_RISE` a command."""
    found, steps = missing.copy(), (1 - LEAST_RISE) * np.diff(command)
    middle = int(np.argmin(np.abs(command)))
    for k in range(middle, len(command) - 1):
        found[k + 1] = min(found[k + 1], found[k] + steps[k])
    for k in range(middle, 0, -1):
        found[k - 1] = max(found[k - 1], found[k] - steps[k - 1])
    return found


@dataclass(frozen=True, kw_only=True)
class LearnedGain(TableEffect, DriveEffect):
    """A torque constant that depends on something, as on position or temperature: applied = command / exp(table).

        applied = command exp(-share sum_k c_k cos(pi k x))

    To first order the table is the share of the command that is needed beside it. More command always gives more
    torque. Constant outside the range `seen`.
    """

    id: ClassVar[str] = "learned"
    at_once: ClassVar[bool] = True
    kind: ClassVar[str] = "gain"
    filled: ClassVar[str] = "more_command"
    unit_value: ClassVar[float] = log(2.0)
    in_torque: ClassVar[bool] = False
    action: ClassVar[str] = LearnedDrive.action
    more_command: tuple[float, ...] = structure("1", "Coefficients of the waves", low=-5, high=5)
    now: Scalar = 0.0
    """The table at the motion of the moment, see `given`; no key of a card."""

    def given(self, motion: Motion) -> Self:
        """At this motion."""
        return replace(self, now=self.table(motion))

    def applied(self, state: object, command: Scalar) -> Scalar:
        """`command / exp(table)`."""
        return command * ca.exp(-self.now)

    def broken_rule(self) -> str:
        """As of every table, and what it goes over is known where the drive is."""
        if unknown := {*FOLLOWED, "payload"} & {*self.quantities()}:
            return f"a drive does not know the {spoken(min(unknown))}"
        return super().broken_rule()

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        size = percent(float(np.expm1(self.size())))
        return f"The drive's torque per command depends on {self.follows()}, {size}; a table learned from data."
