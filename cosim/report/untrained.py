"""What is left where training never was: what acts there alone (a torque limit, a cable's end) was never fitted."""

import numpy as np

from cosim.diagnosis.answer.result import Array, Diagnosis, Trace
from cosim.plots.quantities import Scale
from cosim.report.quantities import Scales

MOST = 0.5
"""Share of the held-out error energy, from which on it is said where it lies. Unit: 1."""
DENSER = 2.0
"""Energy of a row there, at least, relative to that of a row on average: more ground alone is no reason. Unit: 1."""


def untrained(diagnosis: Diagnosis, scales: Scales) -> str:
    """Say that most of the held-out error lies beyond what training had of positions, speeds or torques; or nothing."""
    trained = [trace for trace in diagnosis.traces if not trace.heldout]
    held = [trace for trace in diagnosis.traces if trace.heldout]
    if not trained or not held:
        return ""
    left = _stacked(held, "tau") - _stacked(held, "after")
    told = [
        (*_beyond(_stacked(held, axis), left, _edges(trained, axis)), name, _edges(trained, axis), unit)
        for axis, name, unit in (
            ("q", "positions", scales.position),
            ("v", "speeds", scales.speed),
            ("tau", "torques", scales.torque),
        )
    ]
    energy, rows, name, edges, unit = max(told, key=lambda one: one[0])
    return _sentence(energy, rows, name, edges, unit) if energy >= MOST and energy >= DENSER * rows else ""


def _stacked(traces: list[Trace], axis: str) -> Array:
    return np.concatenate([getattr(trace, axis) for trace in traces])


def _edges(traces: list[Trace], axis: str) -> tuple[float, float]:
    values = _stacked(traces, axis)
    return float(np.nanmin(values)), float(np.nanmax(values))


def _beyond(values: Array, left: Array, edges: tuple[float, float]) -> tuple[float, float]:
    """Shares of the energy and of the rows outside the edges."""
    outside, whole = (values < edges[0]) | (values > edges[1]), float(np.nansum(left**2))
    return (float(np.nansum(left[outside] ** 2)) / whole if whole else 0.0), float(np.mean(outside))


def _sentence(energy: float, rows: float, name: str, edges: tuple[float, float], unit: Scale) -> str:
    where = f"at {name} outside {unit.span(*edges)}, which the fit never had ({100 * rows:.0f} % of the time)"
    part = f"{100 * energy:.0f} % of the error energy on validation runs"
    return f"{part} lies {where}: what acts there alone cannot be named without training data."
