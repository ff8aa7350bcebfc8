"""Friction that depends on where the axis is: periodic, or a rough spot."""

from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar

import numpy as np

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.base import Hypothesis, Reach, Rippled, turn
from cosim.diagnosis.effects.candidates import Candidate, Span, sized, wave
from cosim.diagnosis.effects.periodogram import peaks
from cosim.estimation.prepare import Prepared
from cosim.estimation.row_weights import bend, least_way
from pyfmi_models.effects import LocalFriction, PeriodicFriction
from pyfmi_models.mount import Mount


class FrictionRipple(Rippled[PeriodicFriction]):
    """Friction that rises and falls so many times a turn."""

    forms = (PeriodicFriction,)
    tables = ("friction level over position",)
    rank: ClassVar[float] = 3

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Strongest cycles of what changes its sign with the speed."""
        for cycles in peaks(span, span.residual * np.sign(span.v), lowest=0.3):
            yield self.wave(cycles)

    def way_back(self, effect: PeriodicFriction, mount: Mount) -> float:
        """Half a wave: where motion goes one way, friction over position is a torque over position."""
        return turn(mount) / (2 * float(effect.cycles_per_rev)) if effect.cycles_per_rev > 0 else 0.0

    def is_plausible(self, effect: PeriodicFriction, mount: Mount) -> bool:
        """The largest of its waves is more than any machine is uneven by."""
        waves = [one for one in (effect, *mount.effects) if type(one) is type(effect)]
        return max(float(getattr(one, "relative_amplitude", 0.0)) for one in waves) >= POLICY.least_uneven

    def least(self, sample_time: float) -> float:
        """What any machine is uneven by."""
        return POLICY.least_uneven

    def wave(self, cycles: float) -> Candidate:
        """Friction with so many cycles."""
        return wave(PeriodicFriction(cycles_per_rev=cycles, relative_amplitude=0.0), -1, high=0.9)


class RoughSpot(Hypothesis[LocalFriction]):
    """Friction that is off around one place."""

    forms = (LocalFriction,)
    tables = ("friction level over position",)
    rank: ClassVar[float] = 4

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Two widths, places all over the range."""
        low, high = np.quantile(span.q, [0.01, 0.99])
        for share in (0.03, 0.08):
            width = share * (high - low)
            for center in np.arange(low + width, high - width / 2, 1.7 * width):
                spot = LocalFriction(q_center=float(center), width=float(width), relative_amplitude=0.0)
                yield sized(spot, -0.9, 15)

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """None: where a spot is, is one of too many places; the bound is that of a ripple."""
        return ()

    def shows(self, effect: LocalFriction, mount: Mount, prepared: Prepared) -> bool:
        """A spot that the contact bends across, or that no recording resolves, is a place where the axis rested."""
        return float(effect.width) >= max(bend(mount.friction), least_way(prepared))

    def is_plausible(self, effect: LocalFriction, mount: Mount) -> bool:
        """It is more than any machine is uneven by."""
        return abs(float(effect.relative_amplitude)) >= POLICY.least_uneven

    def where(self, effect: LocalFriction, reach: Reach) -> Where:
        """Two widths to each side of its centre."""
        span = (effect.q_center - 2 * effect.width, effect.q_center + 2 * effect.width)
        return Where(axis="position", description=f"around {effect.q_center:.4g}", regions=(span,))
