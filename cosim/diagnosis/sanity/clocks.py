"""Do torque and position share one clock? Their torque balance is best at the lag between them.

    tau(t - lag) = J a(t) + F dir(v) + B v + c + gravity,     J, F, B >= 0

is solved for each lag. Without the bounds a late position would only look like a negative viscosity: on a sine, lag and
viscosity are one thing. Recordings are fitted each with numbers of its own; their log-likelihoods are added.

Turns tell nothing of it: friction that turns round over a distance is late there, and so is an axis that sticks within
a step of its encoder. So only rows away from turns count. Read there, recordings of one clock of 211 machines have no
lag but a few milliseconds of their drives; before, 38 of them had 14 ms and more.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear

from cosim.diagnosis.sanity.balance import Balance
from cosim.diagnosis.sanity.entry import Alternative, Sanity
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.row_weights import far_from_turns

Columns = Callable[[Balance], Array]
Rows = Callable[[Prepared], Array]
REACH, STEP = 0.060, 0.002
"""Lags that are tried [s]."""
LAGS = np.arange(-REACH, REACH + STEP / 2, STEP)
ALIKE = 3.0
"""Lags less likely than the best by no more than so many nats are not excluded (95 % of normal errors: 1.9)."""
LATE, CERTAINLY = 0.010, 0.008
"""A lag of so many seconds, certainly more than the latter, is more than delays and lags of most servo drives."""
TOO_LATE, CERTAINLY_TOO_LATE = 0.018, 0.016
"""One of so many, certainly more than the latter, is no drive's: no effect may be named beside it. Field buses and slow
loops have 20 ms."""
EXPLAINED = 0.8
"""Share of the torque's energy that a balance must explain to say anything of milliseconds."""
LEAST_ROWS = 10
"""Rows for each column below which a lag is not looked for."""
CLOCKS, CLOCKS_TOO_LATE = 0.6, 0.85
"""Share of either kind that comes from clocks and late read-outs; the others are dead times of drives."""


@dataclass(frozen=True)
class ClockOffset:
    """How much later than the torque the position is [s], and the range that is not excluded."""

    lag: float
    low: float
    high: float

    @property
    def is_late(self) -> bool:
        """Whether the lag is more than that of most drives, and all that is not excluded lies inside of what was tried.

        Where it reaches the end, lag and viscosity were one thing in these recordings.
        """
        return self._is_beyond(LATE, CERTAINLY)

    @property
    def is_too_late(self) -> bool:
        """Whether the lag is no drive's."""
        return self._is_beyond(TOO_LATE, CERTAINLY_TOO_LATE)

    def _is_beyond(self, lag: float, least: float) -> bool:
        nearest, furthest = sorted((abs(self.low), abs(self.high)))
        certain = nearest if self.low * self.high > 0 else 0.0
        return furthest < REACH - STEP / 2 and abs(self.lag) > lag - STEP / 2 and certain > least - STEP / 2


NO_OFFSET = ClockOffset(0.0, 0.0, 0.0)


def clock_offset(balances: Sequence[Balance]) -> ClockOffset:
    """Find the lag of the position behind the torque that balances recordings best, with any friction."""
    return _clock_offset(balances, lambda one: one.columns(one.own_order), far_from_turns)


def _every_row(prepared: Prepared) -> Array:
    return np.ones(len(prepared.recording_of))


def _clock_offset(balances: Sequence[Balance], columns: Columns, rows: Rows = _every_row) -> ClockOffset:
    likelihood = np.sum([_likelihood(one, columns(one), rows(one.prepared)) for one in balances], axis=0)
    near = LAGS[likelihood >= likelihood.max() - ALIKE]
    return ClockOffset(float(LAGS[int(likelihood.argmax())]), float(near.min()), float(near.max()))


def clocks(balances: Sequence[Balance], names: str) -> tuple[Sanity, ...]:
    """Say that torque and position are not of one time, where no drive explains it."""
    told = [one for one in balances if not one.one_way and one.solution(one.own_order).explained > EXPLAINED]
    found = clock_offset(told) if told else NO_OFFSET
    if not found.is_late:
        return ()
    size, ends = 1e3 * abs(found.lag), sorted(1e3 * abs(end) for end in (found.low, found.high))
    span = f"{size:.0f} ms ({ends[0]:.0f} to {ends[1]:.0f})"
    if found.lag > 0:
        how, other = "later than the torque", f"a dead time of {size:.0f} ms in the drive"
    else:
        how, other = "earlier than the torque", "a torque that is measured, and filtered on its way"
    beyond = "any drive's delay" if found.is_too_late else "the delay of most drives"
    text = (
        f"{names}: the position comes {span} {how}. That is more than {beyond}: check that one clock stamps both when "
        "they are sampled, or shift one of them."
    )
    share = CLOCKS_TOO_LATE if found.is_too_late else CLOCKS
    clock = Alternative(what="two clocks, or a late read-out of one signal", likelihood=share)
    causes = (clock, Alternative(what=other, likelihood=1 - share))
    return (Sanity(finding="clocks", statement=text, alternatives=causes, blocks_naming=found.is_too_late),)


def _likelihood(balance: Balance, columns: Array, counts: Array) -> Array:
    """Log-likelihood of each lag beside columns, the first of which are inertia, friction and viscosity."""
    torque = _shifted(balance)
    inside = (counts > 0) & np.all(np.isfinite(torque), axis=1)
    if inside.sum() < LEAST_ROWS * columns.shape[1]:
        return np.zeros(len(LAGS))
    share = float(np.mean(inside))
    columns, torque = columns[inside], torque[inside]
    basis, triangle = np.linalg.qr(columns)
    seen, energy = basis.T @ torque, (torque**2).sum(0)
    least = np.full(columns.shape[1], -np.inf)
    least[[0, 1, 2]] = 0.0
    unseen = energy - (seen**2).sum(0)
    left = np.array([2 * lsq_linear(triangle, one, (least, np.inf), "bvls").cost for one in seen.T]) + unseen
    solution = balance.solution(balance.own_order)
    rows = share * solution.independent * max(0.0, 1 - float((left / energy).min()))
    return np.asarray(-0.5 * rows * np.log(left + share * balance.overlooked))


def _shifted(balance: Balance) -> Array:
    """The torque at each lag before the kept rows, (rows, lags); NaN beyond the ends of a piece."""
    parts = []
    for piece in balance.prepared.pieces:
        spline = CubicSpline(piece.t, piece.tau, extrapolate=False)
        parts.append(spline(piece.t[piece.kept][:, None] - LAGS))
    return np.concatenate(parts)
