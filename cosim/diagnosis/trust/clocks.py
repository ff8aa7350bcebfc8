"""Do torque and position share one clock? Their torque balance is best at the lag between them.

    tau(t - lag) = J a(t) + F dir(v) + B v + c + gravity,     J, F, B >= 0

is solved for each lag. Without the bounds a late position would only look like a negative viscosity: on a sine, lag and
viscosity are one thing. Recordings are fitted each with numbers of its own; their log-likelihoods are added.

Turns tell nothing of it: friction that turns round over a distance is late there, and so is an axis that sticks within
a step of its encoder. So only rows away from turns count. Read there, recordings of one clock of 211 machines have no
lag but a few milliseconds of their drives; before, 38 of them had 14 ms and more.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cosim.diagnosis.answer.doubt_entry import Alternative, Sanity
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.trust.balance import ROWS_A_COLUMN, Balance
from cosim.estimation.filters import between
from cosim.estimation.least_squares import squares_left
from cosim.estimation.prepare import Array
from cosim.estimation.row_weights import far_from_turns

REACH, STEP = 0.060, 0.002
"""Lags that are tried [s]."""
LAGS = np.arange(-REACH, REACH + STEP / 2, STEP)
LATE = 0.010
"""A lag of so many seconds, certainly more than one step less, is more than delays and lags of most servo drives."""
TOO_LATE = 0.018
"""One of so many is no drive's: no effect may be named beside it. Field buses and slow loops have 20 ms."""
EXPLAINED = 0.8
"""Share of the torque's energy that a balance must explain to say anything of milliseconds."""
MOST_OF_IT = 0.7
"""Share of what the balance leaves that a lag must remove in one recording at least to be too late: what is missing
from a balance may look late, and leaves most of itself. Of 35 machines whose position was shifted by 20 ms 29 lose .79
and more, of six with another fault and one clock none more than .63. Unit: 1."""
NOT_NOTHING = 0.2
"""The same for a lag to be said at all. All 62 machines whose position was shifted by 12 and 20 ms, and that are told,
lose .23 and more; three of one clock, whose friction creeps or has a place of its own, .06 to .15. Unit: 1."""
WORSE = -0.25
"""The same of the recording in which it is least: one clock is that of all, and a lag that leaves this much more of one
is no clock's. 92 machines whose position was shifted by 20 and 40 ms have -.07 and more, two eccentric encoders, whose
ripple looks late at one speed, -1.2 and -1.5. Unit: 1."""
CLOCKS, CLOCKS_TOO_LATE = 0.6, 0.85
"""Share of either kind that comes from clocks and late read-outs; the others are dead times of drives. Unit: 1."""


@dataclass(frozen=True)
class ClockOffset:
    """How much later than the torque the position is [s], and the range that is not excluded."""

    lag: float
    low: float
    high: float
    removed: float = 1.0
    """Share of what the balance leaves that the lag removes, in the recording in which that is most."""
    least_removed: float = 1.0
    """The same in the recording in which it is least."""

    @property
    def is_late(self) -> bool:
        """Whether the lag is more than that of most drives, as far as it is known, and matters, and nothing denies it.

        Where what is not excluded reaches the end of what was tried, lag and viscosity were one thing.
        """
        return self.removed >= NOT_NOTHING and self._is_beyond(LATE)

    @property
    def is_too_late(self) -> bool:
        """Whether the lag is no drive's, and most of what the balance leaves."""
        return self.removed >= MOST_OF_IT and self._is_beyond(TOO_LATE)

    def _is_beyond(self, lag: float) -> bool:
        nearest, furthest = sorted((abs(self.low), abs(self.high)))
        certain = nearest if self.low * self.high > 0 else 0.0
        large = abs(self.lag) > lag - STEP / 2 and certain > lag - 3 * STEP / 2
        return large and furthest < REACH - STEP / 2 and self.least_removed > WORSE


NO_OFFSET = ClockOffset(0.0, 0.0, 0.0)


class _Left(NamedTuple):
    """What the balance leaves away from turns."""

    energy: Array
    """At each lag."""
    share: float = 0.0
    """Of all rows, those that it is of; 0 for too few."""
    explained: float = 0.0
    """Share of their energy that the balance explains at its best lag."""


def clock_offset(balances: Sequence[Balance]) -> ClockOffset:
    """Find the lag of the position behind the torque that balances recordings best, with any friction."""
    lefts = [_misfit(one) for one in balances]
    likelihoods = []
    for one, left in zip(balances, lefts, strict=True):
        rows = left.share * one.solution(one.own_order).independent * left.explained
        likelihoods.append(-0.5 * rows * np.log(left.energy + left.share * one.overlooked))
    likelihood = np.sum(likelihoods, axis=0)
    near = LAGS[likelihood >= likelihood.max() - POLICY.fair]
    best, none = int(likelihood.argmax()), len(LAGS) // 2
    removed = [float(1 - one.energy[best] / one.energy[none]) for one in lefts if one.share] or [0.0]
    return ClockOffset(float(LAGS[best]), float(near.min()), float(near.max()), max(removed), min(removed))


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


def _misfit(balance: Balance) -> _Left:
    pieces, columns = balance.prepared.pieces, balance.columns(balance.own_order)
    # The torque at each lag before the kept rows, (rows, lags); NaN beyond the ends of a piece.
    torque = np.concatenate([between(one.t, one.tau, one.t[one.kept][:, None] - LAGS) for one in pieces])
    inside = (far_from_turns(balance.prepared) > 0) & np.all(np.isfinite(torque), axis=1)
    if inside.sum() < ROWS_A_COLUMN * columns.shape[1]:
        return _Left(np.ones(len(LAGS)))
    columns, torque = columns[inside], torque[inside]
    basis, triangle = np.linalg.qr(columns)
    seen, energy = basis.T @ torque, (torque**2).sum(0)
    unseen = energy - (seen**2).sum(0)
    left = squares_left(triangle, seen, (0, 1, 2)) + unseen  # inertia, friction, viscosity
    return _Left(left, float(np.mean(inside)), max(0.0, 1 - float((left / energy).min())))
