"""Iterative learning for a path that repeats: what was missing in one pass is known in the next."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pyfmi_models.adrc.estimate import Estimate, Seen, within
from pyfmi_models.model import Chapter, Scalar, Variable, chapter_of, parameter, parameters_of, with_symbols

PREFIX = "learning"


@dataclass(frozen=True, kw_only=True)
class Learning(Estimate):
    """A resisting torque learned over the path, as a curve through `knots` points of one pass.

        torque = sum_j theta_j hat_j(phase),      theta_j += gain knots/ticks hat_j(phase - lead) residual

    hat_j is 1 at knot j and falls to 0 at its neighbours, phase counts the ticks of a pass from the start of the
    controller. The residual, -J zeta3, is late by the observer's lag, so it belongs to the phase `lead` seconds ago;
    3 / bandwidth is the lag of an observer of third order. One pass removes the share `gain` of what repeats, and keeps
    about gain/2 of what does not. Only for paths whose period is a whole number of ticks, to the tick.
    Reference: Bristow, Tharayil, Alleyne, IEEE Control Systems 26 (2006) no. 3, 96.
    """

    ticks: int
    knots: int = 100
    gain: Scalar = parameter("1", "Share of the residual torque that one pass learns", default=0.5, low=0, high=1)
    lead: Scalar = parameter("s", "Lag of the residual behind the torque", default=0.0136, low=0, high=1)
    limit: Scalar = parameter("N.m", "Largest learned torque, either way", default=1e6, low=0)

    def parameters(self) -> tuple[Variable, ...]:
        """Gain, lead and limit."""
        return parameters_of(self, PREFIX)

    def states(self) -> tuple[Variable, ...]:
        """The clock of the path, and the curve's points."""
        clock = Variable(name=f"{PREFIX}.clock", unit="1", description="Ticks since the pass began")
        points = (
            Variable(name=f"{PREFIX}.torque{k}", unit="N.m", description=f"Learned torque at knot {k}")
            for k in range(self.knots)
        )
        return (clock, *points)

    def chapter(self, onto: str) -> Chapter:
        """Say what is learned."""
        return chapter_of(self, PREFIX, "Torque of the pass before", onto, "Iterative learning")

    def advance(
        self, symbols: dict[str, Scalar], state: list[Any], seen: Seen, period: float
    ) -> tuple[list[Any], Scalar]:
        """Return the states after this tick and the torque learned for this phase."""
        this = with_symbols(self, symbols, seen.reference, PREFIX)
        clock, *points = state
        learned = gain = this.gain * self.knots / self.ticks * seen.residual
        weights = self._hats(clock - this.lead / period)
        learned = [within(this.limit, p + gain * w) for p, w in zip(points, weights, strict=True)]
        torque = sum(p * w for p, w in zip(points, self._hats(clock), strict=True))
        return [ca.if_else(clock + 1 >= self.ticks, 0, clock + 1), *learned], torque

    def _hats(self, clock: Scalar) -> list[Scalar]:
        """Value of each hat function at a clock that may be up to a pass early."""
        place = clock * self.knots / self.ticks
        place = ca.if_else(place < 0, place + self.knots, place)
        first = ca.fmax(0, 1 - place) + ca.fmax(0, place - (self.knots - 1))
        return [first, *(ca.fmax(0, 1 - ca.fabs(place - k)) for k in range(1, self.knots))]
