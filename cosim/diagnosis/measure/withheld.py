"""A diagnosis that names nothing, as the recordings themselves are in doubt: the refitted base, and why."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from cosim.data.recording import Recording
from cosim.diagnosis.answer.doubt_entry import Sanity, not_determined_doubts
from cosim.diagnosis.answer.result import Diagnosis, Finding
from cosim.diagnosis.effects import TRIED
from cosim.diagnosis.measure.breakdown import parts
from cosim.diagnosis.measure.locate import regions
from cosim.diagnosis.measure.protocol import Structures, band_of, judge, traces
from cosim.estimation.determined import limited, not_determined
from cosim.estimation.prepare import quality
from cosim.estimation.problem import Problem
from pyfmi_models.effects import CATALOGUE
from pyfmi_models.mount import Mount

WHY = "the recordings are in doubt"
ACTION = "settle what is said about the recordings first, then diagnose again"


def without_names(
    problem: Problem,
    base: Mount,
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    sanity: tuple[Sanity, ...],
    started: float,
) -> Diagnosis:
    """Measure the refitted base and name no effect: what would be found is an error of the recordings.

    The verdict is "unknown": something is wrong, and it is none of the effects. `started` is when the diagnosis was
    [s of `time.perf_counter`].
    """
    base, limits = limited(problem, base)
    unknown = not_determined(problem, limits)
    untestable: Any = {"answer": "not_testable", "probability": 0.0, "gain": 0.0, "evidence": WHY, "action": ACTION}
    return replace(
        measured(problem, Structures(problem.mount, base, base), train, heldout),
        findings=tuple(Finding(effect=name, title=CATALOGUE[name][0].title, **untestable) for name in TRIED),
        sanity=(*sanity, *not_determined_doubts(unknown)),
        not_determined=unknown,
        seconds=time.perf_counter() - started,
    )


def measured(
    problem: Problem, models: Structures, train: Sequence[Recording], heldout: Sequence[Recording]
) -> Diagnosis:
    """What is measured of three models, whatever is named: a diagnosis without names."""
    linear = problem.mount.motion == "linear"
    held = judge(heldout, models, problem.prepared.band)
    signals = traces(train, heldout, models, band_of(held))
    return Diagnosis(
        verdict=("unknown",),
        findings=(),
        heldout=held,
        traces=signals,
        parts=parts(signals),
        regions=regions(signals, False, linear),
        regions_after=regions(signals, True, linear),
        mount=problem.mount.name,
        motion=problem.mount.motion,
        data_quality=tuple(note for one in (*train, *heldout) for note in quality(one, problem.prepared.cutoff)),
        base_parameters=models.base_parameters(),
    )
