"""The band of a diagnosis: as wide as the encoder's noise allows, wider where a ripple over position lies above it.

Differentiated noise of the reading ends the band (`choose_cutoff`). Where waves over position that were fitted in other
recordings predict what lies above it, that is no noise: then the band goes on to where the noise is `NOISE_LIMIT` of
the torque. Else a motor's cogging, which comes at its cycles times the turns a second, is not seen, and what of it
gets through the filter is taken for something else.

The motion that goes into the models may be read in a wider band than that of the torque (`Band.motion`): what a filter
smears of a turn no law has, and what noise it lets pass makes a bristle creep at rest. Between the two lies a band in
which the base explains most of what was recorded.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.effects.periodogram import peaks
from cosim.estimation.filters import lowpass
from cosim.estimation.prepare import Array, Band, Piece, Prepared, choose_cutoff, prepare
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import weights
from pyfmi_models.mount import Mount

NOISE_LIMIT = 0.1
"""Share of the torque that differentiated noise may reach in the wider band: it is seen, and is weighted. Unit: 1."""


MOTION = (1.4, 2.0, 2.8, 4.0)
"""Bands that are tried for the motion, relative to that of the torque: half an octave apart, as what is smeared goes
with the square of the band."""
LESS = 0.97
"""What the base must leave in a wider band of the motion, relative to the best narrower one. Unit: 1. Of 130 machines
of two generators 69 have a wider one; with .94 the band is the same in 117, with .99 in 107."""
LOOK = 12
"""Evaluations of the base in each of them."""


def in_band(train: Sequence[Recording], mount: Mount) -> Prepared:
    """Prepare recordings of training in their band, the motion in that in which the refitted base leaves least."""
    inertia = float(mount.axis.inertia)
    narrow, wide = choose_cutoff(train, inertia), choose_cutoff(train, inertia, NOISE_LIMIT)
    prepared = prepare(train, wide)
    shown = wide > narrow and prepared.has_position and predicted(prepared, mount, narrow) > POLICY.considerable
    prepared = prepared if shown else prepare(train, narrow)
    best, (base, least) = prepared, _left_by_base(mount, mount, prepared)
    for times in MOTION:
        wider = prepare(train, Band(prepared.cutoff, times * prepared.cutoff))
        base, left = _left_by_base(mount, base, wider)
        if not left < LESS * least:
            break
        best, least = wider, left
    return best


def _left_by_base(card: Mount, start: Mount, prepared: Prepared) -> tuple[Mount, float]:
    """The refitted base, and the RMS of what it leaves."""
    problem = Problem(card, prepared, weights(card.friction, prepared), max(piece.dt for piece in prepared.pieces))
    found = problem.fit(start, LOOK)
    return found.mount, problem.error(found)


def predicted(prepared: Prepared, mount: Mount, narrow: float) -> float:
    """Share of the energy above `narrow` [Hz] that waves over position predict in parts they were not fitted to.

    Parts are recordings, or the halves of one; what inertia makes of the reading is taken off before.
    """
    pieces, rows = prepared.pieces, np.concatenate([np.full(len(p.kept), p.recording) for p in prepared.pieces])
    parts = rows if np.ptp(rows) else (np.arange(len(rows)) > len(rows) / 2).astype(np.int64)
    torque = _above(pieces, narrow, [piece.tau for piece in pieces])
    span = span_of(mount, prepared, torque, np.ones_like(torque))
    angles = [np.asarray(mount.at(0.0, piece.q, piece.v).angle) for piece in pieces]
    waves = [[shape(cycles * one) for one in angles] for cycles in peaks(span, torque) for shape in (np.cos, np.sin)]
    model = [[piece.a for piece in pieces], *waves]
    filtered = [[piece.lowpass(one) for piece, one in zip(pieces, own, strict=True)] for own in model]
    columns = np.column_stack([_above(pieces, narrow, own) for own in filtered])
    plain, whole = (_cross_validated(torque, columns[:, :many], parts) for many in (1, len(model)))
    return 1 - float(whole @ whole) / max(float(plain @ plain), 1e-300)


def _above(pieces: Sequence[Piece], narrow: float, signals: Sequence[Array]) -> Array:
    """What a signal of each piece holds above `narrow`, at the kept rows."""
    high = [(one - lowpass(one, piece.dt, narrow))[piece.kept] for piece, one in zip(pieces, signals, strict=True)]
    return np.concatenate(high)


def _cross_validated(torque: Array, columns: Array, parts: npt.NDArray[np.int64]) -> Array:
    left = torque.copy()
    for part in np.unique(parts):
        own = parts == part
        left[own] -= columns[own] @ np.linalg.lstsq(columns[~own], torque[~own], rcond=None)[0]
    return left
