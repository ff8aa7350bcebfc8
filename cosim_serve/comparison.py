"""What of a diagnosis is compared with another one: answers with sizes, validation errors, and the overlay.

JOB/result/comparison.json     written with the report, in the units of the report
"""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
from pydantic import ConfigDict, TypeAdapter

from cosim.diagnosis.answer.result import Diagnosis, Finding, Trace
from cosim.support.files import replacing
from cosim_serve.folder import read_plain
from cosim_serve.job import STRICT

FILE = "comparison.json"
LARGEST = 4_000_000
"""Bytes of the file; a usual one has 60 kB."""
CORNERS = 800
"""Corners of a line: two for each pixel of a phone."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """An effect and what was said of it."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    id: str
    title: str
    answer: str
    shows: bool
    """Whether it is detected or possible; else `size` is empty and `range` may hold the upper limit."""
    size: str = ""
    range: str = ""
    probability: float | None = None


@dataclass(frozen=True, kw_only=True)
class Line:
    """A line of the overlay: corners over time."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    t: tuple[float, ...]
    values: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A diagnosis as it is compared with another one; errors are RMS on the validation recording, in `unit`."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    heading: str
    model: str
    unit: str
    effects: tuple[Effect, ...]
    errors: dict[str, float]
    validation: str
    lines: dict[str, Line] = field(default_factory=dict)


def compared(found: Diagnosis) -> Comparison:
    """Return what of a diagnosis is compared with another one."""
    from cosim.report.lead import heading
    from cosim.report.quantities import Scales
    from cosim.report.words import model

    scale, held = Scales.of(found).torque, found.heldout
    errors = {name: getattr(held, f"{name}_rms") for name in ("nominal", "before", "after", "floor")}
    traces = [one for one in found.traces if one.heldout and one.t.size > 1]
    return Comparison(
        heading=heading(found),
        model=model(found) or found.mount,
        unit=scale.unit,
        effects=tuple(_effect(one) for one in found.findings if one.effect != "unknown"),
        errors={name: scale.factor * value for name, value in errors.items() if np.isfinite(value)},
        validation=traces[0].name if traces else held.name,
        lines=_lines(traces[0], scale.factor) if traces else {},
    )


def write(found: Diagnosis, folder: Path) -> None:
    """Write it into the folder of a result."""
    with replacing(folder / FILE, True) as partial:
        partial.write_text(json.dumps(asdict(compared(found))), "utf-8")


def read(folder: Path) -> Comparison | None:
    """Read it back; None where a version without it made the result, or it is damaged."""
    try:
        return _COMPARISON.validate_json(read_plain(folder / FILE, LARGEST))
    except (OSError, ValueError):
        return None


def _effect(one: Finding) -> Effect:
    from cosim.report.words import ANSWERS, limit, sized

    shows = one.answer in ("found", "ambiguous")
    size, span = sized(one) if shows else ("", "")
    if one.answer == "not_seen" and (least := limit(one)):
        span = f"upper limit {least}"
    return Effect(
        id=one.name,
        title=one.title,
        answer=ANSWERS.get(one.answer, one.answer),
        shows=shows,
        size=size,
        range=span,
        probability=one.probability if shows else None,
    )


def _lines(trace: Trace, factor: float) -> dict[str, Line]:
    signals = {"measured": trace.tau, "before": trace.before, "after": trace.after}
    signals |= {"error_before": trace.tau - trace.before, "error_after": trace.tau - trace.after}
    return {name: _line(trace.t, factor * values) for name, values in signals.items()}


def _line(t: np.ndarray, values: np.ndarray) -> Line:
    rows = corners(t, values, CORNERS)
    return Line(t=tuple(np.round(t[rows], 4).tolist()), values=tuple(float(f"{x:.5g}") for x in values[rows]))


def corners(t: np.ndarray, values: np.ndarray, most: int) -> np.ndarray:
    """Return the rows of at most `most` corners of a line: least and greatest of each part, so that no peak is lost."""
    good = np.flatnonzero(np.isfinite(values) & np.isfinite(t))
    parts = np.array_split(good, min(most // 2, len(good))) if len(good) else []
    return np.unique([row for part in parts for row in (part[values[part].argmin()], part[values[part].argmax()])])


_COMPARISON = TypeAdapter(Comparison)
