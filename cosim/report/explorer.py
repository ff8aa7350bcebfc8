"""The recordings thinned, quantised and compressed into the page, for the canvas explorer."""

import base64
import zlib

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.answer.result import Array, Diagnosis, Trace
from cosim.diagnosis.measure.breakdown import worst
from cosim.report.quantities import Scales
from cosim.support.plain import JsonObject

Index = npt.NDArray[np.intp]
BUCKETS = 10_000
"""Over all recordings; each gives a smallest and a largest value per signal."""
LEVELS = 65_000
MISSING = 65_535


def payload(diagnosis: Diagnosis, scales: Scales) -> JsonObject:
    """Return what `explorer.js` reads: units and, per recording, base64 of zlib-compressed uint16 deltas."""
    traces = [trace for trace in diagnosis.traces if trace.t.size > 1]
    seconds = sum(float(trace.t[-1] - trace.t[0]) for trace in traces) or 1.0
    return {
        "torque": scales.torque.unit,
        "position": scales.position.unit,
        "recordings": [_packed(trace, scales, seconds) for trace in traces],
        "open": next((i for i, trace in enumerate(traces) if trace.heldout), 0),
    }


def _packed(trace: Trace, scales: Scales, seconds: float) -> JsonObject:
    length = float(trace.t[-1] - trace.t[0])
    buckets = int(np.clip(BUCKETS * length / seconds, 50, max(50, trace.t.size // 4)))
    edges = np.searchsorted(trace.t, trace.t[0] + length / buckets * np.arange(buckets + 1))
    torque = scales.torque.factor
    signals = {
        "tau": trace.tau * torque,
        "before": trace.before * torque,
        "after": trace.after * torque,
        "q": trace.q * scales.position.factor,
    }
    packed = {name: _signal(values, edges) for name, values in signals.items()}
    data = b"".join(codes.tobytes() for codes, _, _ in packed.values())
    return {
        "name": trace.name,
        "heldout": trace.heldout,
        "start": float(trace.t[0]),
        "length": length,
        "count": 2 * buckets,
        "signals": [[name, low, step] for name, (_, low, step) in packed.items()],
        "worst": [worst(trace, trace.missing), worst(trace, trace.tau - trace.after)],
        "data": base64.b64encode(zlib.compress(data, 9)).decode(),
    }


def _signal(values: Array, edges: Index) -> tuple[npt.NDArray[np.uint16], float, float]:
    """Return uint16 deltas of two values a bucket, and the offset and step that give the values back."""
    pairs = _pairs(values, edges)
    low = float(np.nanmin(pairs)) if np.isfinite(pairs).any() else 0.0
    step = (float(np.nanmax(pairs)) - low) / LEVELS if np.isfinite(pairs).any() else 0.0
    step = step or 1.0
    levels = np.where(np.isfinite(pairs), np.round((pairs - low) / step), MISSING).astype(np.uint16)
    return np.diff(levels, prepend=np.uint16(0)).astype("<u2"), low, step


def _pairs(values: Array, edges: Index) -> Array:
    """Return smallest and largest value of every bucket in the order they came; NaN where it is empty."""
    pairs = np.full((len(edges) - 1, 2), np.nan)
    full = np.diff(edges) > 0
    starts = edges[:-1][full]
    if not len(starts):
        return pairs.ravel()
    part = values[: edges[-1]]
    low, high = np.fmin.reduceat(part, starts.astype(np.intp)), np.fmax.reduceat(part, starts.astype(np.intp))
    rising = part[np.minimum(edges[1:][full], len(part)) - 1] >= part[starts]
    pairs[full] = np.where(rising[:, None], np.stack([low, high], 1), np.stack([high, low], 1))
    return pairs.ravel()
