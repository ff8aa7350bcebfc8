"""Play in the drive."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from cosim.diagnosis.candidates import Candidate, Span, has, of_both_ways
from cosim.diagnosis.hypotheses.base import Evidence, Hypothesis, Reach, Seen, with_numbers
from cosim.diagnosis.result import Where
from cosim.diagnosis.tuning import refound
from cosim.estimation.fit import Fit, with_values
from cosim.estimation.play import far_torques
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.visible import least_way
from cosim.support.statistics import rms
from pyfmi_models.effects import Effect
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.model import Variable
from pyfmi_models.mount import Mount

SHARE = 0.3
"""Share of the inertia that is behind the play of a middling candidate."""
LEAST_SHARE = 0.03
"""Share of the inertia below which nothing is driven through the play. In nulls it was .02 at most, true ones .2."""
GAPS = np.geomspace(1e-4, 1e-2, 10)
"""Gaps that are looked at, relative to the motion ..."""
COASTING = np.geomspace(0.03, 1.0, 11)
"""... and decelerations by its own friction of what is behind them, relative to the RMS of the acceleration: a far side
that slows down more than the near one never leaves its flank."""
PROPORTIONAL = ("load_share", "load_friction", "load_viscous")
"""Numbers of a play that its torque is proportional to: the motion of the far side stays."""
AROUND = (0.5, 1.0, 2.0)
"""Gaps from which a fit goes on, relative to the one that it found."""
MOST = 0.7
"""Share of the inertia behind the play from which it goes on too: a play of a half was found as one of a third, at a
quarter of its evidence, from smaller shares."""
HALF, SHARED_GAPS = 0.5, np.geomspace(1e-4, 2e-3, 5)
"""Share of the card's friction behind the play, and gaps relative to the motion, from which all is fitted anew. The law
refitted without a play has long taken over what the far side does: from there no step leads to two halves. Of four
plays that were missed this finds all; from .3 of the friction two."""
BEST = 4
"""Plays on that grid that become candidates."""

CONCEALED = 6
"""Gaps that are concealed."""


class Play(Hypothesis[Backlash]):
    """Plays of a grid that look most like the residual; it is fine, as what happens in a gap happens or does not."""

    forms = (Backlash,)
    tables = ("distance since reversal", "hysteresis over a long stroke")
    finds_its_way: ClassVar[bool] = True
    is_common_misfit: ClassVar[bool] = True
    easiest: ClassVar[int] = 1
    rank: ClassVar[float] = 21
    view = "since reversal"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """The best of the grid."""
        if has(mount, Backlash):
            return
        law = _law(mount)
        level = max(law["Fc"], law["Fs"])  # a refitted law may put all of it in the break-away level
        ratio = float(f"{law['sigma2'] / level:.1g}") if level else 0.0
        bent = {"load_deflection": float(f"{level / law['sigma0']:.1g}")} if law["sigma0"] and level else {}
        size = rms(span.prepared.stacked("a"))
        numbers = [(float(gap) * span.reach, float(slowing) * size) for gap in GAPS for slowing in COASTING]
        columns = far_torques(span.prepared, tuple(numbers), ratio)
        for index in np.argsort(_alike(columns, span))[: -BEST - 1 : -1]:
            gap, slowing = numbers[index]
            far = SHARE * float(mount.axis.inertia)
            middling = Backlash(
                gap_rad=gap, load_share=SHARE, load_friction=far * slowing, load_viscous=far * slowing * ratio, **bent
            )

            def start(c: Array, middling: Backlash = middling) -> Effect:
                times = float(np.clip(c[0], 0.1, 0.8 / SHARE))
                return replace(middling, **{name: times * getattr(middling, name) for name in PROPORTIONAL})

            yield Candidate("backlash", (middling,), (), start)

    def tuned(self, problem: Problem, found: Fit, start: Backlash, evidence: Evidence) -> Fit:
        """Go on from gaps around the one that was found (whether a flank is met jumps with the gap), then from more."""
        found = max((found, _shared(problem, found, evidence)), key=evidence)
        if evidence(found) <= 0:
            return found
        play: Any = found.mount.effects[-1]
        around = [replace(play, gap_rad=times * play.gap_rad) for times in AROUND]
        found = refound(problem, found, evidence, around, 25)
        play = found.mount.effects[-1]
        return refound(problem, found, evidence, [replace(play, load_share=MOST)])

    def is_degenerate(self, problem: Problem, effect: Backlash) -> bool:
        """With hardly anything behind it the play is one more bristle of the friction."""
        return bool(effect.load_share < LEAST_SHARE)

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """Gaps all over the range, with what stops the far side as the likeliest candidate has it."""
        for first in tried[:1]:
            for gap in (np.geomspace(GAPS[0], GAPS[-1], CONCEALED) * span.reach).tolist():
                yield with_numbers(first, gap_rad=gap)

    def shows(self, effect: Backlash, mount: Mount, prepared: Prepared) -> bool:
        """A gap that recordings do not show is rounding, or the filter."""
        return float(effect.gap_rad) >= least_way(prepared)

    def way_back(self, effect: Backlash, mount: Mount) -> float:
        """The gap and what the contact bends: where motion goes one way, the far side lies on one flank."""
        return float(effect.gap_rad) + float(effect.load_deflection)

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Wider gaps."""
        return f"wider than {seen.low:.2g} {'m' if mount.motion == 'linear' else 'rad'}"

    def where(self, effect: Backlash, reach: Reach) -> Where:
        """After each reversal."""
        return Where(axis="time since reversal", description="after each reversal, until the play is crossed")


def _law(mount: Mount) -> dict[str, float]:
    """Numbers of a friction law, the mean of both directions; 0 where it has none."""
    return {name: of_both_ways(getattr(mount.friction, name, None)) for name in ("Fc", "Fs", "sigma2", "sigma0")}


def _shared(problem: Problem, found: Fit, evidence: Evidence) -> Fit:
    """The best fit from the card's friction, half of it behind a play, at several gaps."""
    law, reach = _law(problem.mount), float(np.ptp(problem.prepared.stacked("q")))
    torques = {v.name: HALF * v.start for v in problem.mount.parameters() if _is_friction(v)}
    halved = with_values(
        replace(found.mount, friction=problem.mount.friction), [*torques], np.array([*torques.values()])
    )
    bent = {"load_deflection": law["Fc"] / law["sigma0"]} if law["sigma0"] else {}
    behind = Backlash(
        gap_rad=1.0, load_share=SHARE, load_friction=HALF * law["Fc"], load_viscous=HALF * law["sigma2"], **bent
    )
    fits = [
        problem.fit(replace(halved, effects=(*halved.effects[:-1], replace(behind, gap_rad=gap))), 24)
        for gap in (SHARED_GAPS * reach).tolist()
    ]
    return max(fits, key=evidence)


def _is_friction(variable: Variable) -> bool:
    """Whether it is a torque of the friction law, or one for a speed or a way."""
    return variable.name.startswith("friction.") and variable.unit.startswith("N")


def _alike(columns: Array, span: Span) -> Array:
    """Share of the residual that each column explains, beyond what inertia and friction may."""
    v, a = span.v, span.prepared.stacked("a")
    base = np.column_stack([a, v, np.tanh(v / (0.01 * span.top)), np.ones_like(v)])
    own = columns - base @ np.linalg.lstsq(base, columns, rcond=None)[0]
    return np.asarray((own.T @ span.residual) ** 2 / np.maximum((own**2).sum(0), 1e-300))
