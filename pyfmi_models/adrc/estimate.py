"""The contract of a torque estimate: what a controller expects to resist before the observer has seen it."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from pyfmi_models.model import Chapter, Scalar, Variable


class Seen(NamedTuple):
    """What an estimate may look at in a tick: speeds [rad/s] and the torque that nothing has explained yet [N m].

    `residual` is -J zeta3, so it resists; it lags behind the true torque as the observer does.
    """

    observed: Scalar
    reference: Scalar
    residual: Scalar


def within(limit: Scalar, value: Scalar) -> Scalar:
    """The value, held between -limit and limit."""
    return ca.fmax(-limit, ca.fmin(limit, value))


def cut(state: Iterable[Any], *sizes: int) -> list[list[Any]]:
    """Parts of a list of states, of these sizes."""
    rest = iter(state)
    return [[next(rest) for _ in range(size)] for size in sizes]


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A part of the controller that predicts a resisting torque; several add up."""

    def parameters(self) -> tuple[Variable, ...]:
        """List the tunable numbers, with full names."""
        return ()

    def states(self) -> tuple[Variable, ...]:
        """List what is remembered from tick to tick, with full names."""
        return ()

    def chapter(self, onto: str) -> Chapter:
        """Say what it is; `onto` is the place that it works on."""
        raise TypeError(f"{type(self).__name__} has no chapter")

    def advance(
        self, symbols: dict[str, Scalar], state: list[Any], seen: Seen, period: float
    ) -> tuple[list[Any], Scalar]:
        """Return the states after this tick and the torque expected now [N m]; `symbols` are the parameters."""
        raise TypeError(f"{type(self).__name__} predicts no torque")
