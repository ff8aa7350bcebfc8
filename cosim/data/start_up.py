"""The start of a recording in which a loop is switched on: a torque that alternates and moves nothing.

In the first `SECONDS` the torque is several times as large as ever after, its squares have either sign, and hardly
anything of them is left of a mean over `FOLLOWED`: the command chatters faster than a drive follows. Such rows are left
out before anything is filtered, which would spread them over the motion that follows. A start that speeds the axis up
has one sign, however short it is, and a quick move there and back lasts longer.
"""

from dataclasses import replace

import numpy as np

from cosim.data.recording import Recording

SECONDS, FOLLOWED = 0.1, 0.02
"""How long a loop takes to settle after it is switched on, and how long a torque lasts that moves an axis. Unit: s."""
STRONG = 3.0
"""Limit of the torque, in the largest one of the rest: friction at a start is no more than half above that. Unit: 1."""
ONE_WAY = 0.7
"""Share of the torque's squares, those of either sign set off, from which it moves the axis: 1 of a push; .27 of a kick
that alternates and falls by a quarter each time, .55 of one beside the torque that then sets in. Unit: 1."""
LASTING = 0.5
"""Share of the torque's squares that the mean leaves, from which it moves the axis: .9 of a move within `SECONDS`, .02
of the kick. Unit: 1."""
LEAST_ROWS = 8
"""Rows in the window from which signs say something."""


def settled(recording: Recording) -> Recording:
    """Return a recording without the rows of its start in which a loop is switched on; `notes` say it."""
    rows = int(np.searchsorted(recording.t, recording.t[0] + SECONDS))
    if not LEAST_ROWS <= rows < len(recording) / 2:
        return recording
    start, rest = np.split(recording["tau"], [rows])
    largest, usual = float(np.abs(start).max()), float(np.abs(rest).max())
    if largest <= STRONG * usual or _moves(start, max(1, round(rows * FOLLOWED / SECONDS))):
        return recording
    note = (
        f"{recording.name}: in the first {SECONDS:g} s the torque alternates up to {largest:.3g}, "
        f"{largest / usual:.2g} times the largest one after, and moves nothing: a loop that is switched on. These rows "
        "are left out."
    )
    table = {name: column[rows:] for name, column in recording.table.items()}
    others = {name: column[rows:] for name, column in recording.others.items()}
    return replace(recording, table=table, others=others, notes=(*recording.notes, note))


def _moves(torque: np.ndarray, around: int) -> bool:
    """Whether a torque at even rows moves an axis that follows a mean over so many of them."""
    energy, lasting = torque @ torque, np.convolve(torque, np.full(around, 1 / around), "same")
    return bool(abs(torque @ np.abs(torque)) >= ONE_WAY * energy or lasting @ lasting >= LASTING * energy)
