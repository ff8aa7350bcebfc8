"""The proof: torque residuals on recordings, the one that was never fitted first of all.

Protocol: low-pass of 30 Hz (lower for slow recordings) on both sides, five-point differences, RMS over 3 s .. end -
0.5 s (shorter recordings: 5 % off each end). Beside it the same over clear motion only, in the band of the analysis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.bank import bank
from cosim.diagnosis.claim import claimed, least_speed
from cosim.diagnosis.inverse import Inverse
from cosim.diagnosis.prepare import Array, Piece, Prepared, prepare
from cosim.diagnosis.result import HeldOut, Trace
from cosim.diagnosis.structure import projected
from cosim.recording import Recording
from pyfmi_models.mount import Mount

CUTOFF = 30.0
NOISY = 3.0
"""Growth of the base's error beyond the band of the analysis from which that is noise of the encoder."""
BLOCK_SECONDS = 1.0
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
    prepared = prepare(recordings, cutoff)
    v, inside = (np.concatenate([getattr(piece, name) for piece in prepared.pieces]) for name in ("v", "inside"))
    return rms(np.concatenate(residuals(prepared, mount))[inside][claimed(mount.friction, v[inside])])


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
    found = []
    for number, recording in enumerate((*train, *heldout)):
        prepared, held = prepare([recording], CUTOFF), number >= len(train)
        before, after = residuals(prepared, models.before), residuals(prepared, models.after)
        found.append(_trace(recording, held, prepared, np.concatenate(before), np.concatenate(after)))
    return tuple(found)


def _trace(recording: Recording, held: bool, prepared: Prepared, before: Array, after: Array) -> Trace:
    inside = np.concatenate([piece.inside for piece in prepared.pieces])
    signals = [np.concatenate([getattr(p, name) for p in prepared.pieces])[inside] for name in ("t", "q", "v", "tau")]
    (t, q, v, tau), before, after = signals, before[inside], after[inside]
    band = _band(after, v)
    return Trace(
        name=recording.name,
        heldout=held,
        t=t,
        q=q,
        v=v,
        tau=tau,
        before=tau - before,
        after=tau - after,
        missing=before,
        band=band,
        intervals=_intervals(t, before, band),
    )


def _band(after: Array, v: Array) -> Array:
    """Half width of the 95 % band: what the better model leaves at about this speed."""
    order = np.argsort(np.abs(v))
    parts = [part for part in np.array_split(order, 12) if len(part)]
    centres = [float(np.median(np.abs(v[part]))) for part in parts]
    return np.interp(np.abs(v), centres, [Z95 * rms(after[part]) for part in parts])


def _intervals(t: Array, missing: Array, band: Array) -> tuple[tuple[float, float], ...]:
    """Spans of at least 0.2 s in which the missing torque, smoothed over 0.1 s, leaves its band."""
    width = max(1, int(0.1 / (t[1] - t[0])))
    smooth = np.convolve(missing, np.ones(width) / width, "same")
    out = np.concatenate([[False], np.abs(smooth) > band, [False]])
    starts, ends = np.flatnonzero(~out[:-1] & out[1:]), np.flatnonzero(out[:-1] & ~out[1:])
    spans = zip(t[starts], t[np.minimum(ends, len(t) - 1)], strict=True)
    return tuple((float(a), float(b)) for a, b in spans if b - a >= 0.2)
