"""What all learned terms declare, and the tables of most of them: sums of waves over quantities, as data.

A table is a sum of waves over one quantity, or of products of waves over two (see `pyfmi_models/waves.py`):

    table(s) = share sum_k c_k cos(pi k x(s)),   table(s, r) = share sum_kl c_kl cos(pi k x(s)) cos(pi l x(r))

with x from 0 to 1 over the range that was seen; over "turn" c_0 + sum_k [c_(2k-1) cos(k angle) + c_2k sin(k angle)].
Beyond the range a table keeps its last value. Several effects of this kind add up; nothing here is code. Acceleration
and way travelled are followed by a state each, so that no torque depends on the acceleration that it makes:

    acceleration = (v - y) / T,  y' = acceleration;    way' = |v|, from 0 where a recording or a run begins
Waves that are level at both ends are the basis of smoothing splines: Solin and Sarkka, Stat. Comput. 30 (2020) 419.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, make_dataclass, replace
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np
import numpy.typing as npt

from pyfmi_models.effects.base import Effect, Main, Motion, MotionEffect
from pyfmi_models.effects.learned_table import LearnedTable
from pyfmi_models.model import Scalar, Variable, parameter, structure, word
from pyfmi_models.waves import INPUT, broken_range, input_of, span, spoken, waves

Array = npt.NDArray[np.float64]
MOST_WAVES = 40
"""Of one quantity; more is noise, and costs time in every step."""
ROWS = 41
"""Values of a table for a reader, over one quantity; a table of products has `COLUMNS` in each row."""
COLUMNS = 5
SEEN_WITHIN = 0.02
"""T of the module [s]: a bandwidth of 8 Hz is above that of what moves an axis. Of half and twice it a drag by
acceleration removes .97 and .94 of an error, of this .96."""
SINCE = {"time since reversal": "s", "distance since reversal": "rad"}
"""Quantities that a fading memory is a function of, with their units."""
FOLLOWED = ("acceleration", "way")
"""Quantities that a state follows."""


@dataclass(frozen=True, kw_only=True)
class LearnedEffect(Effect):
    """What a learned term declares beside its equation."""

    title: ClassVar[str] = "Learned term"
    main: ClassVar[Main] = Main("share", unit="1", is_size=False)
    kind: ClassVar[str]
    """What its values are: torque, friction, drive, ..."""
    filled: ClassVar[str]
    """Field that holds the coefficients."""
    unit_value: ClassVar[float] = 1.0
    """First coefficient of a table that is one everywhere: of a relative change, one that doubles."""
    in_torque: ClassVar[bool] = True
    """Whether the coefficients are torques; else they are shares of the friction level."""
    never_negative: ClassVar[bool] = False
    """Whether a negative coefficient would give energy."""

    def coefficients(self) -> Sequence[Scalar]:
        """Coefficients of the waves or elements; those of a second quantity fastest."""
        found: Sequence[Scalar] = getattr(self, self.filled)
        return found

    def quantities(self) -> tuple[str, ...]:
        """What it goes over, as a card names it; nothing where it remembers the motion."""
        return ()

    def admitted(self) -> Self:
        """The same, changed a little where it breaks a rule by a little."""
        return self

    def since(self) -> str:
        """What it fades with, if it is one quantity that a formula may go over: `SINCE`."""
        return ""

    def of_one(self) -> Self | None:
        """The same effect with the value one everywhere; None where it remembers."""
        if not self.quantities():
            return None
        changed: Self = replace(self, **{self.filled: (self.unit_value, *[0.0] * (len(self.coefficients()) - 1))})
        return changed

    def for_reader(self, unit: str) -> LearnedTable:
        """The term as a table of plain numbers: quantity, values, their unit; `unit` is that of a torque."""
        raise TypeError(f"{type(self).__name__} has no table")


_FREE: dict[tuple[type[LearnedEffect], int], Any] = {}


def with_free_coefficients(form: type[LearnedEffect], count: int) -> Any:
    """The form with `count` coefficients as parameters, zero to begin with: the same class each time."""
    if (form, count) not in _FREE:
        _FREE[form, count] = _free(form, count)
    return _FREE[form, count]


def _free(form: type[LearnedEffect], count: int) -> Any:
    names = [f"c{k}" for k in range(count)]
    free = [(name, Any, parameter("1", "A coefficient of a candidate term", default=0.0)) for name in names]
    own = {"coefficients": lambda self: tuple(getattr(self, name) for name in names), "__module__": form.__module__}
    options: dict[str, Any] = {"bases": (form,), "frozen": True, "kw_only": True, "namespace": own}
    return make_dataclass(f"Free{form.__name__}{count}", free, **options)


@dataclass(frozen=True, kw_only=True)
class TableEffect(LearnedEffect):
    """Where a table goes over, what was seen of it, and its waves at a motion."""

    equation: ClassVar[str] = "Σ c cos(k π x)"
    told_apart_by: ClassVar[str] = "it says what the remaining error correlates with, not its cause"
    action: ClassVar[str] = "Look at the machine where the table is large; trust it only in the range it was seen in."
    over: str = word("Quantity that the table goes over")
    seen: tuple[float, ...] = structure("1", "Lowest and highest value seen", low=-1e9, high=1e9)
    by: str = word("Second quantity, of a table of products", default="")
    by_seen: tuple[float, ...] = structure("1", "Lowest and highest value seen of it", low=-1e9, high=1e9)
    waves: tuple[float, ...] = structure("1", "Highest wave over each quantity", low=0, high=MOST_WAVES)
    share: Scalar = parameter("1", "Share of the table that acts", default=1.0, low=0, high=1, fitted=False)

    def quantities(self) -> tuple[str, ...]:
        """`over`, and `by` of a table of products."""
        return tuple(filter(None, (self.over, self.by)))

    def inputs(self) -> tuple[Variable, ...]:
        """What is not the axis's own business."""
        pairs = ((self.over, self.seen), (self.by, self.by_seen))
        return tuple({one.name: one for name, seen in pairs for one in input_of(name, seen)}.values())

    def table(self, motion: Motion) -> Scalar:
        """The sum above, times `share`."""
        counts = [int(count) for count in self.waves] or [self._only()]
        first = waves(self._value(self.over, motion), self.over, self.seen, counts[0])
        second = waves(self._value(self.by, motion), self.by, self.by_seen, counts[1]) if self.by else [1.0]
        products = (one * other for one in first for other in second)
        return self.share * sum(c * shape for c, shape in zip(self.coefficients(), products, strict=True))

    def _value(self, name: str, motion: Motion) -> Scalar:
        """Where a motion is on a quantity."""
        if name in FOLLOWED:
            state = motion.state[self._followed().index(name)]
            return state if name == "way" else (motion.v - state) / SEEN_WITHIN
        known: Mapping[str, Scalar] = {"position": motion.q, "turn": motion.angle, "speed": motion.v}
        if name in known:
            return known[name]
        return ca.fabs(motion.payload) if name == "payload" else motion.inputs[name.removeprefix(INPUT)]

    def _followed(self) -> list[str]:
        """Quantities that a state follows, in the order of the states."""
        return [name for name in self.quantities() if name in FOLLOWED]

    def _only(self) -> int:
        many = len(self.coefficients()) - 1
        return many // 2 if self.over == "turn" else many

    def broken_rule(self) -> str:
        """Quantities are known, ranges are ranges, and there is a coefficient for each wave."""
        if "command" in (self.over, self.by):
            return "what goes over the command is the drive's: its keys are command_seen and missing"
        second = broken_range(self.by, "by_seen", self.by_seen) if self.by else ""
        return broken_range(self.over, "seen", self.seen) or second or self._broken_size()

    def _broken_size(self) -> str:
        many, counts = len(self.coefficients()), list(self.waves)
        if not self.by and (self.by_seen or counts):
            return "by_seen and waves belong to a table of products, which names a second quantity in `by`"
        if self.by and (len(counts) != 2 or any(count != int(count) for count in counts)):
            return "waves must be two whole numbers, the highest wave over each quantity"
        if (self.by and self.over == "turn") or self.by == "turn":
            return "a table over the turn has no second quantity"
        needed = int((counts[0] + 1) * (counts[1] + 1)) if self.by else many
        if not many or many != needed or many > 4 * MOST_WAVES:
            return f"the table has {many} coefficients; it needs {needed if self.by else f'1 to {4 * MOST_WAVES}'}"
        odd = self.over == "turn" and many % 2 == 0
        return "a table over the turn has a constant and pairs: an odd number of coefficients" if odd else ""

    def follows(self) -> str:
        """Say over what the table goes."""
        return " and ".join(map(spoken, self.quantities()))

    def values(self, count: int = 201, other: float | None = None) -> tuple[Array, Array]:
        """Values of the quantity over its range, and of the table there.

        A table of products is told at one value of the second quantity, by default the middle of its range.
        """
        edges = self.seen or (-np.pi, np.pi)
        at = np.linspace(edges[0], edges[1], count)
        return at, np.array([float(self.table(self._there(one, other))) for one in at])

    def _there(self, value: float, other: float | None) -> Motion:
        given = {self.over.removeprefix(INPUT): value}
        if self.by:
            given |= {self.by.removeprefix(INPUT): sum(self.by_seen) / 2 if other is None else other}
        own = [given.get(name, 0.0) for name in ("position", "speed", "turn", "payload")]
        held = {"way": given.get("way", 0.0), "acceleration": own[1] - SEEN_WITHIN * given.get("acceleration", 0.0)}
        return Motion(0.0, own[0], own[1], own[2], given, own[3], [held[name] for name in self._followed()])

    def learned_in(self, linear: bool = False) -> str:
        """Say the range, as `over position -1 to 1 rad`."""
        pairs = ((self.over, self.seen), (self.by, self.by_seen))
        return f"over {' and '.join(span(name, seen, linear) for name, seen in pairs if name)}"

    def size(self) -> float:
        """Half the range of the table's values where it was seen."""
        others = self.by_seen or (None,)
        return max(float(np.ptp(self.values(201, one)[1])) for one in others) / 2

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"Something that depends on {self.follows()}, {self._sized(unit)}; a table learned from data."

    def _sized(self, unit: str) -> str:
        return f"{self.size():.2g} {unit}"

    def for_reader(self, unit: str) -> LearnedTable:
        """A torque, or a share of the friction level, over the range seen of one quantity or of two."""
        unit = unit if self.in_torque else "1"
        at, values = self.values(ROWS)
        named: LearnedTable = {"kind": self.kind, "unit": unit, "over": spoken(self.over), "at": at.tolist()}
        if not self.by:
            return {**named, "value": self._acts(values).tolist()}
        others = np.linspace(self.by_seen[0], self.by_seen[1], COLUMNS)
        grid = np.array([self.values(ROWS, float(other))[1] for other in others])
        return {**named, "by": spoken(self.by), "by_at": others.tolist(), "value": self._acts(grid).T.tolist()}

    def _acts(self, table: Array) -> Array:
        """What a table does: it is a torque, or the logarithm of a factor."""
        return table if self.in_torque else np.asarray(np.expm1(table))


@dataclass(frozen=True, kw_only=True)
class MotionTable(TableEffect, MotionEffect):
    """A table that knows the motion, and follows what a motion does not tell of a moment."""

    def states(self) -> tuple[Variable, ...]:
        """One for each quantity that is followed."""
        known = {
            "acceleration": Variable(name="followed_speed", unit="rad/s", description="Speed a moment ago"),
            "way": Variable(name="way", unit="rad", description="Way travelled, there and back"),
        }
        return tuple(known[name] for name in self._followed())

    def rate(self, motion: Motion) -> Any:
        """The equations of the module."""
        rates = {"acceleration": self._value, "way": lambda *_: ca.fabs(motion.v)}
        return ca.vertcat(ca.SX(0, 1), *(rates[name](name, motion) for name in self._followed()))
