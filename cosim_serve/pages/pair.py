"""Two diagnoses side by side: one table of verdicts, effects and errors, and both overlays on the same axes."""

from collections.abc import Sequence
from datetime import datetime

from starlette.responses import Response

from cosim.support.plain import Parsed
from cosim_serve import comparison
from cosim_serve.chart import Chart, chart
from cosim_serve.comparison import Comparison, Effect
from cosim_serve.desk import Desk
from cosim_serve.job import Job
from cosim_serve.pages import moment, page

ERRORS = {
    "nominal": "with the card as delivered",
    "before": "with the refitted card",
    "after": "with the improved card",
    "floor": "noise floor",
}
"""Validation errors, in the order of the table."""
PANELS = (
    ("torque", ("measured", "before", "after"), 190),
    ("error: measured minus model", ("error_before", "error_after"), 132),
)
"""Panels of an overlay: title, lines, height."""
OLD = "An earlier version of cosim made this diagnosis and kept no overlay or sizes: diagnose it again to compare it."
Row = tuple[str, str, str]


def comparison_page(desk: Desk, first: Job, second: Job) -> Response:
    """Show two diagnoses that are done, side by side, the older one first."""
    jobs = (first, second)
    held = [comparison.read(desk.store.result(job.id)) for job in jobs]
    known = [one for one in held if one]
    return page(
        "pair.html.j2",
        title="Two diagnoses side by side",
        jobs=[_job(job, "AB"[number], one) for number, (job, one) in enumerate(zip(jobs, held, strict=True))],
        errors=_errors(held),
        effects=_effects(held),
        neither=_neither(known),
        overlays=_overlays(known) if len(known) == len(jobs) else [],
    )


def _job(job: Job, letter: str, held: Comparison | None) -> Parsed:
    used = [one.name + (" (validation)" if one.role == "heldout" else "") for one in job.uploads if one.role != "out"]
    return {
        "id": job.id,
        "letter": letter,
        "name": job.called,
        "heading": job.answer.heading,
        "files": ", ".join(used),
        "card": job.card,
        "made": moment(datetime.fromisoformat(job.made)),
        "seconds": f"{job.seconds:.0f} s",
        "validation": held.validation if held else "",
        "old": "" if held else OLD,
    }


def _errors(held: Sequence[Comparison | None]) -> list[Row]:
    """Return a row for each validation error; the same number of decimals would hide which one is better."""
    return [
        (title, *(_error(one, name) for one in held))  # type: ignore[misc]
        for name, title in ERRORS.items()
        if any(one and name in one.errors for one in held)
    ]


def _error(held: Comparison | None, name: str) -> str:
    return f"{held.errors[name]:.3g} {held.unit}" if held and name in held.errors else "–"


def _effects(held: Sequence[Comparison | None]) -> list[Parsed]:
    """Return a row for each effect that either of them shows, as the first that shows it ranks them."""
    shown = dict.fromkeys(one.id for each in held if each for one in each.effects if one.shows)
    titles = {one.id: one.title for each in held if each for one in each.effects}
    return [{"title": titles[name], "cells": [_effect(each, name) for each in held]} for name in shown]


def _effect(held: Comparison | None, name: str) -> Parsed | None:
    one: Effect | None = next((one for one in held.effects if one.id == name), None) if held else None
    if one is None:
        return None
    likely = f"probability {one.probability:.2f}" if one.probability is not None else ""
    return {
        "answer": one.answer,
        "shows": one.shows,
        "size": one.size,
        "more": ", ".join(filter(None, (one.range, likely))),
    }


def _neither(held: Sequence[Comparison]) -> list[str]:
    """Return the effects that none of them shows."""
    shown = {one.id for each in held for one in each.effects if one.shows}
    return [*dict.fromkeys(one.title for each in held for one in each.effects if one.id not in shown)]


def _overlays(held: Sequence[Comparison]) -> list[Parsed]:
    """Return the charts of both; of one unit they have one scale, of one recording one time too."""
    lasts = [_span(one, ("measured",), "t") for one in held]
    if held[0].validation == held[1].validation:
        lasts = [(min(low for low, _ in lasts), max(high for _, high in lasts))] * len(held)
    made: list[Parsed] = []
    for one, times in zip(held, lasts, strict=True):
        panels = []
        for title, names, height in PANELS:
            alike = [each for each in held if each.unit == one.unit]
            ends = [_span(each, names, "values") for each in alike]
            y = min(low for low, _ in ends), max(high for _, high in ends)
            panels.append({"title": f"{title} [{one.unit}]", "chart": _chart(one, names, times, y, height)})
        made.append({"panels": panels, "validation": one.validation})
    return made


def _chart(
    held: Comparison, names: Sequence[str], times: tuple[float, float], y: tuple[float, float], height: int
) -> Chart:
    lines = {name: (held.lines[name].t, held.lines[name].values) for name in names if name in held.lines}
    return chart(lines, times, y, height)


def _span(held: Comparison, names: Sequence[str], what: str) -> tuple[float, float]:
    values = [x for name in names if name in held.lines for x in getattr(held.lines[name], what)]
    return (min(values), max(values)) if values else (0.0, 1.0)
