"""Play in the drive."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice, product
from typing import Any, ClassVar, cast

import numpy as np

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.base import Evidence, Hypothesis, Seen, with_numbers
from cosim.diagnosis.effects.candidates import SHARE, Candidate, Span, columns_of, of_both_ways, span_of
from cosim.diagnosis.effects.tuning import in_most_turns, refound, restarted, with_last
from cosim.estimation.fit import Fit, with_values
from cosim.estimation.play import Columns, far_torques, torques_of_grid
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import least_way
from cosim.support.statistics import rms
from pyfmi_models.effects import Effect
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.mount import Mount

LEAST_SHARE = 0.09
"""Share of the inertia below which nothing is driven through the play. In nulls of two generators it was .077 at most
in four of five, true ones were found at .11 and more (seeds 1494289175, 560194608)."""
GAPS = np.geomspace(1e-4, 1e-2, 10)
"""Gaps that are looked at, relative to the motion ..."""
COASTING = np.geomspace(0.03, 1.0, 11)
"""... and decelerations by its own friction of what is behind them, relative to the RMS of the acceleration: a far side
that slows down more than the near one never leaves its flank."""
PROPORTIONAL = ("load_share", "load_friction", "load_viscous")
"""Numbers of a play that its torque is proportional to: the motion of the far side stays."""
AROUND = (0.5, 1.0, 2.0)
"""Gaps from which a fit goes on, relative to the one that it found."""
TWO, ALIKE = 2, 0.05
"""So many ends of fits go on, of those whose gaps differ by more than this share: the better one is not always the one
from which a step leads on (107 nats that stayed, where 91 became 649)."""
MOST = 0.7
"""Share of the inertia behind the play from which it goes on too: a play of a half was found as one of a third, at a
quarter of its evidence, from smaller shares."""
HALF, SHARED_GAPS = 0.5, np.geomspace(1e-4, 2e-3, 5)
"""Share of the card's friction behind the play, and gaps relative to the motion, from which all is fitted anew. The law
refitted without a play has long taken over what the far side does: from there no step leads to two halves. Of four
plays that were missed this finds all; from .3 of the friction two."""
FEW = 10
"""Evaluations of each of several starts, in the recording that turns most, of which the best go on in all of them."""
ROUGH = 6
"""Evaluations of a fit without the play: what it leaves only tells where to begin."""
BEST = 4
"""Plays on that grid that become candidates."""
WINDOWS = (0.1, 0.03, 0.0)
"""Seconds over which play and residual are averaged while grids get finer. A stiff contact that closes a hundredth of a
second late fits worse than no play, so without it the neighbours of the true play on the grid look like any other."""
LITTLE = 0.1
"""Share of the base's viscous friction behind the play, by its own level: the other one that is looked for."""


class Play(Hypothesis[Backlash]):
    """Plays of a grid that look most like the residual; it is fine, as what happens in a gap happens or does not."""

    forms = (Backlash,)
    tables = ("distance since reversal", "hysteresis over a long stroke")
    finds_its_way: ClassVar[bool] = True
    easiest: ClassVar[int] = 1
    rank: ClassVar[float] = 21
    view = "since reversal"
    acts = Where(axis="time since reversal", description="after each reversal, until the play is crossed")

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """The nearest play, and the best of the grid."""
        law = _law(mount)
        level = max(law["Fc"], law["Fs"])  # a refitted law may put all of it in the break-away level
        ratio = float(f"{law['sigma2'] / level:.1g}") if level else 0.0
        bent = {"load_deflection": float(f"{level / law['sigma0']:.1g}")} if law["sigma0"] and level else {}
        gaps, slowings = GAPS * span.reach, COASTING * rms(span.prepared.stacked("a"))
        grid = tuple(product(gaps.tolist(), slowings.tolist()))
        alike = _alike(torques_of_grid(span.prepared, grid, ratio), span)
        likely = [(*grid[index], ratio) for index in np.argsort(alike)[: -BEST - 1 : -1]]
        for gap, slowing, drag in [_nearest(span, gaps, slowings, (LITTLE * ratio, ratio)), *likely]:
            far = SHARE * float(mount.axis.inertia)
            middling = Backlash(
                gap_rad=gap, load_share=SHARE, load_friction=far * slowing, load_viscous=far * slowing * drag, **bent
            )

            def start(c: Array, middling: Backlash = middling) -> Effect:
                times = float(np.clip(c[0], 0.1, 0.8 / SHARE))
                return replace(middling, **{name: times * getattr(middling, name) for name in PROPORTIONAL})

            yield Candidate("backlash", (middling,), (), start)

    def tuned(self, problem: Problem, found: Fit, start: Backlash, evidence: Evidence) -> Fit:
        """Go on from gaps around the one that was found (whether a flank is met jumps with the gap), then from more.

        Where there is clear evidence already: of true plays the first fits have some hundred nats.
        """
        others = [one for one in self._first(problem, found) if one.gap_rad != start.gap_rad]
        rough = in_most_turns(problem)
        ends = [found, _shared(problem, found, evidence), *(restarted(rough, found, one, FEW) for one in others)]
        found = max(ends, key=evidence)
        if evidence(found) <= POLICY.clear:
            return found
        for end in _apart([one for one in ends if evidence(one) > 0], evidence)[:TWO]:
            play: Any = end.mount.effects[-1]
            around = [replace(play, gap_rad=times * play.gap_rad) for times in AROUND]
            found = max(found, refound(problem, end, evidence, around, 25), key=evidence)
        play = found.mount.effects[-1]
        return refound(problem, found, evidence, [replace(play, load_share=MOST)])

    def _first(self, problem: Problem, found: Fit) -> Iterator[Any]:
        """Where the first two candidates start: the nearest play, and the one that is most alike on the grid."""
        base = problem.fit(replace(found.mount, effects=found.mount.effects[:-1]), ROUGH)
        span = span_of(base.mount, problem.prepared, base.residual, np.zeros_like(base.residual))
        first = list(islice(self.candidates(base.mount, span), 2))
        columns = columns_of(base.mount, first, problem.prepared, base.values)
        for candidate, column in zip(first, columns, strict=True):
            plain = np.column_stack([column, _plain(span)])
            yield candidate.start(np.asarray(np.linalg.lstsq(plain, span.residual, rcond=None)[0]))

    def is_degenerate(self, problem: Problem, effect: Backlash) -> bool:
        """With hardly anything behind it the play is one more bristle of the friction."""
        return bool(effect.load_share < LEAST_SHARE)

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """Gaps all over the range, with what stops the far side as the likeliest candidate has it."""
        for first in tried[:1]:
            for gap in (np.geomspace(GAPS[0], GAPS[-1], 6) * span.reach).tolist():
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


def _law(mount: Mount) -> dict[str, float]:
    """Numbers of a friction law, the mean of both directions; 0 where it has none."""
    return {name: of_both_ways(getattr(mount.friction, name, None)) for name in ("Fc", "Fs", "sigma2", "sigma0")}


def _shared(problem: Problem, found: Fit, evidence: Evidence) -> Fit:
    """The best fit from the card's friction, half of it behind a play, at several gaps."""
    law, reach = _law(problem.mount), float(np.ptp(problem.prepared.stacked("q")))
    rubbing = [one for one in problem.mount.parameters() if one.name.startswith("friction.")]
    torques = {one.name: HALF * one.start for one in rubbing if one.unit.startswith("N")}  # for a speed or a way too
    whole = replace(found.mount, friction=problem.mount.friction)
    halved = with_values(whole, [*torques], np.array([*torques.values()]))
    bent = {"load_deflection": law["Fc"] / law["sigma0"]} if law["sigma0"] else {}
    behind = Backlash(
        gap_rad=1.0, load_share=SHARE, load_friction=HALF * law["Fc"], load_viscous=HALF * law["sigma2"], **bent
    )
    rough = in_most_turns(problem)
    gaps = (SHARED_GAPS * reach).tolist()
    fits = [rough.fit(with_last(halved, replace(behind, gap_rad=gap)), FEW) for gap in gaps]
    return problem.fit(max(fits, key=evidence).mount, 24)


def _apart(ends: Sequence[Fit], evidence: Evidence) -> list[Fit]:
    found: list[Fit] = []
    for one in sorted(ends, key=evidence, reverse=True):
        gap, *others = (float(cast(Any, fit.mount.effects[-1]).gap_rad) for fit in (one, *found))
        if all(abs(other - gap) > ALIKE * gap for other in others):
            found.append(one)
    return found


def _nearest(span: Span, gaps: Array, slowings: Array, ratios: Sequence[float]) -> tuple[float, float, float]:
    """Gap, deceleration, viscous over dry friction of the play that looks most like the residual, on finer grids."""
    look: Callable[..., Columns] = torques_of_grid
    for window in WINDOWS:
        grid = tuple(product(gaps.tolist(), slowings.tolist()))
        alike = {ratio: _alike(look(span.prepared, grid, ratio), span, window) for ratio in dict.fromkeys(ratios)}
        look = far_torques
        ratio = max(alike, key=lambda one: float(alike[one].max()))
        gap, slowing = grid[int(np.argmax(alike[ratio]))]
        gaps, slowings, ratios = _around(gaps, gap), _around(slowings, slowing), (ratio,)
    return gap, slowing, ratio


def _around(values: Array, middle: float) -> Array:
    """From one neighbour of a value on a geometric grid to the other."""
    step = float(values[1] / values[0])
    return np.geomspace(middle / step, middle * step, 7)


def _alike(columns: Columns, span: Span, window: float = 0.0) -> Array:
    """Share of the residual that each column explains beyond what inertia and friction may, averaged over a window."""
    from scipy.ndimage import uniform_filter1d  # a tenth of a second that nothing before the search needs

    rows = max(1, round(window / float(np.median(np.diff(span.t)))))
    columns, base, residual = (uniform_filter1d(one, rows, axis=0) for one in (columns, _plain(span), span.residual))
    even = np.linalg.qr(base)[0]
    own = columns - even @ (even.T @ columns)
    return np.asarray((own.T @ residual) ** 2 / np.maximum((own**2).sum(0), 1e-300))


def _plain(span: Span) -> Array:
    """What inertia and friction may be, at all rows."""
    v = span.v
    return np.column_stack([span.prepared.stacked("a"), v, np.tanh(v / (0.01 * span.top)), np.ones_like(v)])
