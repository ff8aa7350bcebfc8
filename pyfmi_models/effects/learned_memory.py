"""Learned terms that remember the motion: hysteresis over long strokes, friction that changes after a reversal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from pyfmi_models.effects.base import FrictionEffect, LoadEffect, Motion, MotionEffect, higher
from pyfmi_models.effects.learned_base import LearnedEffect
from pyfmi_models.effects.learned_table import LearnedTable
from pyfmi_models.model import Scalar, Variable, parameter, structure

MOST = 12
"""Elements of one memory: each is a state."""
SHORTEST = 1e-9


@dataclass(frozen=True, kw_only=True)
class _Memory(LearnedEffect, MotionEffect):
    """Elements that follow the direction of motion, each over a way or a time of its own, from -1 to 1."""

    id: ClassVar[str] = "learned"
    equation: ClassVar[str] = "Σ c y"
    told_apart_by: ClassVar[str] = "it says what the remaining error remembers, not its cause"
    action: ClassVar[str] = "Look for what is elastic or magnetic and is carried along: belts, seals, cables, iron."
    share: Scalar = parameter("1", "Share of the term that acts", default=1.0, low=0, high=1, fitted=False)

    def spans(self) -> Sequence[float]:
        """Way or time of each element."""
        raise TypeError(f"{type(self).__name__} has no elements")

    def states(self) -> tuple[Variable, ...]:
        """One state an element, at 0 to begin with: nothing is remembered."""
        return tuple(
            Variable(name=f"memory{k}", unit="1", description=f"Direction remembered by element {k}", low=-1, high=1)
            for k, _ in enumerate(self.spans(), 1)
        )

    def _held(self, motion: Motion) -> list[Scalar]:
        """The states, between -1 and 1."""
        return [ca.fmax(-1.0, ca.fmin(1.0, motion.state[k])) for k in range(len(self.spans()))]

    def broken_rule(self) -> str:
        """As many coefficients as elements, and every way or time above zero."""
        many, needed = len(self.coefficients()), len(self.spans())
        if not 1 <= needed <= MOST or many != needed:
            return f"it has {many} coefficients for {needed} ways or times; it needs one for each of 1 to {MOST}"
        return "" if min(self.spans()) >= SHORTEST else f"{min(self.spans()):g} is no way or time; it must be above 0"


@dataclass(frozen=True, kw_only=True)
class LearnedHysteresis(_Memory, LoadEffect):
    """Torque that follows the motion over long strokes, and goes round a loop: a sum of Dahl elements.

        torque = share sum_k c_k y_k,   y_k' = (v - |v| y_k) / stroke_k,   c_k >= 0

    Each element takes energy over a round trip, none gives any.
    Reference: Dahl, AIAA Journal 14 (1976) 1675.
    """

    kind: ClassVar[str] = "hysteresis"
    filled: ClassVar[str] = "torque"
    never_negative: ClassVar[bool] = True
    strokes: tuple[float, ...] = structure("rad", "Ways over which the elements turn round", low=SHORTEST, high=1e9)
    torque: tuple[float, ...] = structure("N.m", "Torque of each element", low=0, high=1e9)

    def spans(self) -> Sequence[float]:
        """`strokes`."""
        return self.strokes

    def for_reader(self, unit: str) -> LearnedTable:
        """The elements."""
        return {"kind": self.kind, "strokes": list(self.strokes), "torque": list(self.torque), "unit": unit}

    def rate(self, motion: Motion) -> Any:
        """`(v - |v| y) / stroke`."""
        return ca.vertcat(
            *((motion.v - ca.fabs(motion.v) * motion.state[k]) / way for k, way in enumerate(self.strokes))
        )

    def load(self, motion: Motion) -> Scalar:
        """`share sum c_k y_k`."""
        return self.share * sum(c * y for c, y in zip(self.coefficients(), self._held(motion), strict=True))

    def learned_in(self, linear: bool = False) -> str:
        """Say the strokes."""
        return f"over strokes of {min(self.strokes):.3g} to {max(self.strokes):.3g} {'m' if linear else 'rad'}"

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"Something goes round a loop of {sum(self.torque):.2g} {unit} either way; learned from data."


@dataclass(frozen=True, kw_only=True)
class LearnedAfterReversal(_Memory, FrictionEffect):
    """Friction level that is another for a while after a reversal, over a way or a time.

        level exp(share sum_k c_k m_k),   m_k = (1 - s y_k) / 2,   s = tanh(v / creep)
        y_k' = (v - |v| y_k) / way_k     or     y_k' = (s - y_k) / time_k

    m_k is 1 right after a reversal and falls to 0. The level stays above zero, so friction never drives.
    """

    kind: ClassVar[str] = "friction after a reversal"
    filled: ClassVar[str] = "level_change"
    in_torque: ClassVar[bool] = False
    ways: tuple[float, ...] = structure("rad", "Ways over which the elements forget", low=SHORTEST, high=1e9)
    times: tuple[float, ...] = structure("s", "Times in which the elements forget", low=SHORTEST, high=1e9)
    level_change: tuple[float, ...] = structure("1", "Coefficient of each element", low=-5, high=5)
    creep: Scalar = parameter(
        "rad/s", "Speed below which the direction is not told", default=1e-4, low=1e-9, nominal=1e-4, tunable=False
    )

    def spans(self) -> Sequence[float]:
        """`ways`, then `times`."""
        return (*self.ways, *self.times)

    def since(self) -> str:
        """The time or the way since the last reversal."""
        both = self.ways and self.times
        return "" if both else "distance since reversal" if self.ways else "time since reversal"

    def for_reader(self, unit: str) -> LearnedTable:
        """The elements, of the level."""
        ways, times, change = (list(one) for one in (self.ways, self.times, self.level_change))
        return {"kind": self.kind, "ways": ways, "times": times, "level_change": change, "unit": "1"}

    def rate(self, motion: Motion) -> Any:
        """The equations above."""
        direction = ca.tanh(motion.v / self.creep)
        by_way = [(motion.v - ca.fabs(motion.v) * motion.state[k]) / way for k, way in enumerate(self.ways)]
        by_time = [(direction - motion.state[k]) / time for k, time in enumerate(self.times, len(self.ways))]
        return ca.vertcat(*by_way, *by_time)

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """`level exp(share sum c_k m_k)`."""
        direction = ca.tanh(motion.v / self.creep)
        terms = (c * (1 - direction * y) / 2 for c, y in zip(self.coefficients(), self._held(motion), strict=True))
        return level * ca.exp(self.share * sum(terms))

    def learned_in(self, linear: bool = False) -> str:
        """Say what it forgets over."""
        return f"over {'the way' if self.ways else 'the time'} since a reversal"

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        change = 100 * float(ca.exp(sum(self.level_change)) - 1)
        return f"After a reversal friction is {higher(change / 100)} for a while; learned from data."
