"""The proof: torque residuals on recordings, the one that was never fitted first of all.

Protocol: low-pass of 30 Hz (lower for slow recordings) on both sides, five-point differences, RMS over 3 s .. end -
0.5 s (shorter recordings: 5 % off each end). Beside it the same over clear motion only, in the band of the analysis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.bank import bank
from cosim.diagnosis.claim import claimed, least_speed
from cosim.diagnosis.evidence import t_value
from cosim.diagnosis.fit import free_parameters
from cosim.diagnosis.flagged import Rest, Spans, flagged, noise_at
from cosim.diagnosis.inverse import Inverse
from cosim.diagnosis.prepare import Array, Piece, Prepared, prepare
from cosim.diagnosis.result import HeldOut, Trace
from cosim.diagnosis.structure import projected
from cosim.diagnosis.trial import LEAST_PLAIN_GAIN
from cosim.recording import Recording
from pyfmi_models.mount import Mount

CUTOFF = 30.0
NOISY = 3.0
"""Growth of the base's error beyond the band of the analysis from which that is noise of the encoder."""
BLOCK_SECONDS = 1.0
SURE = 1.0
"""Standard errors by which the held-out error must be lowered where the share is small: what helps by chance alone
passes once in six. On 211 sealed cases the one false effect helped by 0.3, the true ones by 1.3 and more."""
RESAMPLES = 400
Z95 = 1.96


@dataclass(frozen=True)
class Structures:
    """The three models that are compared: as delivered, refitted, with the missing physics."""

    nominal: Mount
    before: Mount
    after: Mount


def residuals(prepared: Prepared, mount: Mount) -> list[Array]:
    """Measured minus model torque at all rows of each piece."""
    inverse = Inverse(mount, ())
    return [piece.tau - inverse.torque(piece, np.zeros(0))[0] for piece in prepared.pieces]


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def judge(recordings: Sequence[Recording], models: Structures, cutoff: float) -> HeldOut:
    """Compare the three models on recordings that none of them was fitted to."""
    prepared = prepare(recordings, CUTOFF)
    inside = np.concatenate([piece.inside for piece in prepared.pieces])
    left = {
        name: np.concatenate(residuals(prepared, mount))[inside]
        for name, mount in (("nominal", models.nominal), ("before", models.before), ("after", models.after))
    }
    return HeldOut(
        name=", ".join(recording.name for recording in recordings),
        nominal_rms=rms(left["nominal"]),
        before_rms=rms(left["before"]),
        after_rms=rms(left["after"]),
        floor_rms=_floor(prepared, models.after),
        confidence_interval=_interval(left["before"], left["after"], prepared.pieces[0].dt),
        sliding=_sliding(recordings, models, cutoff),
    )


def heldout_rms(recordings: Sequence[Recording], mount: Mount) -> float:
    """RMS of the torque residual of one model by the protocol."""
    prepared = prepare(recordings, CUTOFF)
    inside = np.concatenate([piece.inside for piece in prepared.pieces])
    return rms(np.concatenate(residuals(prepared, mount))[inside])


def veto_band(recordings: Sequence[Recording], base: Mount, cutoff: float) -> float:
    """Band [Hz] in which held-out recordings may refute an effect: the protocol's, or that of the analysis, `cutoff`.

    The latter where the base's error grows so much between the two that the encoder's noise is all there is.
    """
    narrow = min(CUTOFF, cutoff)
    wide_error, narrow_error = (veto_rms(recordings, base, band) for band in (CUTOFF, narrow))
    return narrow if wide_error > NOISY * narrow_error else CUTOFF


def veto_rms(recordings: Sequence[Recording], mount: Mount, cutoff: float) -> float:
    """RMS of the torque residual over what the model claims: of rest a law without memory says nothing."""
    return rms(np.concatenate(_vetoing(recordings, mount, cutoff)))


def is_proven(recordings: Sequence[Recording], without: Mount, mount: Mount, cutoff: float) -> bool:
    """Whether a model lowers the held-out error of the one without an effect by a share that counts, or surely.

    The former lets an effect count that acts in few blocks, the latter one that is small beside the noise.
    """
    before, after = ([np.sum(x**2) for x in _vetoing(recordings, one, cutoff)] for one in (without, mount))
    better = np.subtract(before, after)
    share = float(better.sum() / (np.sum(before) + 1e-300))
    return share > LEAST_PLAIN_GAIN or (share > 0 and t_value(better) > SURE)


def is_misleading(recordings: Sequence[Recording], base: Mount, mount: Mount, cutoff: float) -> bool:
    """Whether a model is worse than the base on held-out recordings, in the band of the veto and in the protocol's.

    Effects can each help beside the others, or beside a base that was bent to them, and still do so together.
    """
    bands = sorted({cutoff, CUTOFF})
    return all(veto_rms(recordings, mount, band) > veto_rms(recordings, base, band) for band in bands)


def _vetoing(recordings: Sequence[Recording], mount: Mount, cutoff: float) -> list[Array]:
    """Torque residual over what the model claims, in blocks of `BLOCK_SECONDS`."""
    prepared = prepare(recordings, cutoff)
    t, v, inside = (np.concatenate([getattr(p, name) for p in prepared.pieces]) for name in ("t", "v", "inside"))
    number = np.repeat(np.arange(len(prepared.pieces)), [len(piece.t) for piece in prepared.pieces])
    rows = np.flatnonzero(inside)[claimed(mount.friction, v[inside])]
    cells = np.column_stack([number, np.floor(t / BLOCK_SECONDS)])[rows]
    ends = np.flatnonzero(np.any(np.diff(cells, axis=0) != 0, axis=1)) + 1
    return np.split(np.concatenate(residuals(prepared, mount))[rows], ends)


def _sliding(recordings: Sequence[Recording], models: Structures, cutoff: float) -> dict[str, float]:
    prepared = prepare(recordings, cutoff)
    v, inside = (np.concatenate([getattr(piece, name) for piece in prepared.pieces]) for name in ("v", "inside"))
    least = least_speed(v[inside])
    moving = inside & (np.abs(v) > least)
    return {
        "before_rms": rms(np.concatenate(residuals(prepared, models.before))[moving]),
        "after_rms": rms(np.concatenate(residuals(prepared, models.after))[moving]),
        "cutoff_hz": prepared.cutoff,
        "least_speed": least,
    }


def _floor(prepared: Prepared, mount: Mount) -> float:
    """RMS that a general friction model and slow drifts, fitted to this very recording, would leave: noise, roughly."""
    kept = [piece.kept for piece in prepared.pieces]
    left = [rest[rows] for rest, rows in zip(residuals(prepared, mount), kept, strict=True)]
    drift = np.concatenate([_drifts(piece)[piece.kept] for piece in prepared.pieces])
    return rms(projected(np.concatenate(left), np.column_stack([*bank(prepared), drift])))


def _drifts(piece: Piece) -> Array:
    x = (piece.t - piece.t[0]) / (piece.t[-1] - piece.t[0])
    sign = np.tanh(piece.v / (0.01 * np.abs(piece.v).max() + 1e-300))
    waves = [np.cos(np.pi * k * x) for k in range(6)]
    return piece.lowpass(np.column_stack([*waves, *(sign * wave for wave in waves)]))


def _interval(before: Array, after: Array, dt: float) -> tuple[float, float]:
    """95 % range of the difference of RMS values, from a bootstrap of blocks of `BLOCK_SECONDS`."""
    count = max(2, int(len(before) * dt / BLOCK_SECONDS))
    squares = np.array([[np.mean(x**2) for x in np.array_split(one, count)] for one in (before, after)])
    draws = np.random.default_rng(0).integers(0, count, (RESAMPLES, count))
    differences = np.sqrt(squares[0][draws].mean(1)) - np.sqrt(squares[1][draws].mean(1))
    low, high = np.quantile(differences, [0.025, 0.975])
    return float(low), float(high)


def traces(train: Sequence[Recording], heldout: Sequence[Recording], models: Structures) -> tuple[Trace, ...]:
    """Signals of all recordings for pictures and for the file of missing torque."""
    prepared = [prepare([recording], CUTOFF) for recording in (*train, *heldout)]
    rests = [_rests(one, models, number < len(train)) for number, one in enumerate(prepared)]
    spans = iter(flagged([rest for parts in rests for rest in parts]))
    intervals = [tuple(span for _ in parts for span in next(spans)) for parts in rests]
    found = zip(prepared, rests, intervals, strict=True)
    return tuple(_trace(one, parts, when) for one, parts, when in found)


def _rests(prepared: Prepared, models: Structures, fitted: bool) -> list[Rest]:
    """What the refitted base and the better model leave of each piece, away from its edges."""
    inverse = Inverse(models.before, free_parameters(models.before))
    rests = []
    for piece, after in zip(prepared.pieces, residuals(prepared, models.after), strict=True):
        torque, slopes = inverse.torque(piece, inverse.present)
        rows = piece.inside
        left = (piece.tau - torque)[rows]
        rests.append(Rest(piece.t[rows], piece.v[rows], left, after[rows], slopes[rows], fitted))
    return rests


def _trace(prepared: Prepared, rests: Sequence[Rest], intervals: Spans) -> Trace:
    (name,) = prepared.names
    q, tau = (np.concatenate([getattr(p, signal)[p.inside] for p in prepared.pieces]) for signal in ("q", "tau"))
    t, v, before, after = (
        np.concatenate([getattr(rest, signal) for rest in rests]) for signal in ("t", "v", "residual", "after")
    )
    return Trace(
        name=name,
        heldout=not rests[0].fitted,
        t=t,
        q=q,
        v=v,
        tau=tau,
        before=tau - before,
        after=tau - after,
        missing=before,
        band=Z95 * noise_at(v, after, v),
        intervals=intervals,
        extras=_extras(prepared),
    )


def _extras(prepared: Prepared) -> dict[str, Array]:
    names = set.intersection(*(set(piece.extras) for piece in prepared.pieces)) - {"q_d", "v"}
    return {name: np.concatenate([piece.extras[name][piece.inside] for piece in prepared.pieces]) for name in names}
