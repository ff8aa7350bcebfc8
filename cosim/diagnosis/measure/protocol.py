"""The proof: torque residuals on recordings, the one that was never fitted first of all.

Protocol: low-pass of 30 Hz on both sides (lower for slow recordings; the band of the analysis where 30 Hz is mostly
noise, or where most of what the base leaves lies above 30 Hz inside that band), five-point differences, RMS over 3 s ..
end - 0.5 s (shorter recordings: 5 % off each end).
Beside it the same over clear motion only, in the band of the analysis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import HeldOut, Trace
from cosim.diagnosis.evidence.predictive import interval_of, is_noise
from cosim.diagnosis.measure.flagged import Residual, Spans, flagged, noise_at
from cosim.estimation.discrepancy_basis import discrepancy_basis
from cosim.estimation.fit import free_parameters
from cosim.estimation.inverse import Inverse
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import PROTOCOL_HZ, Band, Prepared, prepare
from cosim.estimation.residuals import inside, kept, residuals
from cosim.estimation.row_weights import least_speed
from cosim.support.statistics import Z95, rms
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Structures:
    """The three models that are compared: as delivered, refitted, with the missing physics."""

    nominal: Mount
    before: Mount
    after: Mount

    def base_parameters(self) -> dict[str, tuple[float, float, float]]:
        """Each number of the base, by its full name, in the three models."""
        tables = [{v.name: v.start for v in one.parameters()} for one in (self.nominal, self.before, self.after)]
        names = [name for name in tables[0] if name.startswith(("axis.", "friction.")) and name in tables[2]]
        kept = [name for name in names if not name.endswith(("torque_limit", "smoothing"))]
        return {name: (tables[0][name], tables[1][name], tables[2][name]) for name in kept}


def judge(recordings: Sequence[Recording], models: Structures, band: Band) -> HeldOut:
    """Compare the three models on recordings that none of them was fitted to.

    Where the protocol's band is mostly noise, the `band` of the analysis is what is judged.
    """
    prepared, own = _judged(recordings, models, band)
    nominal, before, after = (inside(prepared, one) for one in (models.nominal, models.before, models.after))
    return HeldOut(
        name=", ".join(recording.name for recording in recordings),
        nominal_rms=rms(nominal),
        before_rms=rms(before),
        after_rms=rms(after),
        floor_rms=_floor(prepared, models.after),
        confidence_interval=interval_of(before, after, prepared.pieces[0].dt),
        sliding=_sliding(own, models),
        cutoff_hz=prepared.cutoff,
        motion_hz=max(prepared.band),
    )


def judged_band(recordings: Sequence[Recording], models: Structures, band: Band) -> Prepared:
    """Recordings in the band in which `judge` compares models on them."""
    return _judged(recordings, models, band)[0]


def _judged(recordings: Sequence[Recording], models: Structures, band: Band) -> tuple[Prepared, Prepared]:
    """Recordings in the band that is judged, and in that of the analysis."""
    both = prepare(recordings, band), prepare(recordings, PROTOCOL_HZ)
    own, protocol = ([rms(inside(one, mount)) ** 2 for mount in (models.before, models.after)] for one in both)
    is_above = band.cutoff > PROTOCOL_HZ and own[0] > 2 * protocol[0]
    return both[0] if is_above or is_noise(own, protocol) else both[1], both[0]


def band_of(held: HeldOut) -> Band:
    """Band in which the held-out errors are given: pictures and parts beside them are of the same."""
    return Band(held.cutoff_hz, held.motion_hz)


def heldout_rms(recordings: Sequence[Recording], mount: Mount, band: float | Band = PROTOCOL_HZ) -> float:
    """RMS of the torque residual of one model by the protocol, in its band or another [Hz]."""
    return rms(inside(prepare(recordings, band), mount))


def _sliding(prepared: Prepared, models: Structures) -> dict[str, float]:
    v = np.concatenate([piece.v[piece.inside] for piece in prepared.pieces])
    least = least_speed(v)
    moving = np.abs(v) > least
    return {
        "before_rms": rms(inside(prepared, models.before)[moving]),
        "after_rms": rms(inside(prepared, models.after)[moving]),
        "cutoff_hz": prepared.cutoff,
        "motion_hz": max(prepared.band),
        "least_speed": least,
    }


def _floor(prepared: Prepared, mount: Mount) -> float:
    """RMS that a general friction model and slow drifts, fitted to this very recording, would leave: noise, roughly."""
    drifts = []
    for piece in prepared.pieces:
        x = (piece.t - piece.t[0]) / (piece.t[-1] - piece.t[0])
        sign = np.tanh(piece.v / (0.01 * np.abs(piece.v).max() + 1e-300))
        waves = [np.cos(np.pi * k * x) for k in range(6)]
        drifts.append(piece.lowpass(np.column_stack([*waves, *(sign * wave for wave in waves)]))[piece.kept])
    shapes = np.column_stack([*discrepancy_basis(prepared), np.concatenate(drifts)])
    return rms(projected(kept(prepared, mount), shapes))


def of_the_best(interval: tuple[float, float], value: float, many: int) -> tuple[float, float]:
    """Widen the 95 % range of a value that was the best of `many`: each must hold at 5 % / many (Bonferroni)."""
    wider = float(ndtri(0.025 / many) / ndtri(0.025))
    low, high = (value + wider * (end - value) for end in interval)
    return low, high


def traces(
    train: Sequence[Recording], heldout: Sequence[Recording], models: Structures, band: float | Band = PROTOCOL_HZ
) -> tuple[Trace, ...]:
    """Signals of all recordings for pictures and for the file of missing torque, in the band that was judged."""
    prepared = [prepare([recording], band) for recording in (*train, *heldout)]
    pieces = [_residuals(one, models, number < len(train)) for number, one in enumerate(prepared)]
    spans = iter(flagged([one for parts in pieces for one in parts]))
    intervals = [tuple(span for _ in parts for span in next(spans)) for parts in pieces]
    found = zip(prepared, pieces, intervals, strict=True)
    return tuple(_trace(one, parts, when) for one, parts, when in found)


def _residuals(prepared: Prepared, models: Structures, fitted: bool) -> list[Residual]:
    """What the refitted base and the better model leave of each piece, away from its edges."""
    inverse = Inverse(models.before, free_parameters(models.before))
    pieces = []
    for piece, after in zip(prepared.pieces, residuals(prepared, models.after), strict=True):
        torque, slopes = inverse.torque(piece, inverse.present)
        rows = piece.inside
        left = (piece.tau - torque)[rows]
        pieces.append(Residual(piece.t[rows], piece.v[rows], left, after[rows], slopes[rows], fitted))
    return pieces


def _trace(prepared: Prepared, pieces: Sequence[Residual], intervals: Spans) -> Trace:
    (name,) = prepared.names
    more = set.intersection(*(set(piece.extras) for piece in prepared.pieces)) - {"q_d", "v"}
    q, tau = (np.concatenate([getattr(p, signal)[p.inside] for p in prepared.pieces]) for signal in ("q", "tau"))
    t, v, before, after = (
        np.concatenate([getattr(one, signal) for one in pieces]) for signal in ("t", "v", "residual", "after")
    )
    return Trace(
        name=name,
        heldout=not pieces[0].fitted,
        t=t,
        q=q,
        v=v,
        tau=tau,
        before=tau - before,
        after=tau - after,
        missing=before,
        band=Z95 * noise_at(v, after, v),
        intervals=intervals,
        extras={name: np.concatenate([p.extras[name][p.inside] for p in prepared.pieces]) for name in more},
    )
