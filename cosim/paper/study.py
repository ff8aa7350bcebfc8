"""All runs of the tracking experiment: every condition, every case, every seed, on all cores."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from os import cpu_count
from typing import Any

from cosim.paper.conditions import CASES, Condition, conditions
from cosim.paper.experiment import Job, Outcome, run
from cosim.paper.workshop import Workshop

LOOSE = 1e-4
"""Tolerance of the plant's solver where noise kicks it every tick; moves an ISE by 5e-6 of itself (from 1e-8)."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One run with its place in the study."""

    condition: str
    case: str
    seed: int
    outcome: Outcome


@dataclass(frozen=True, kw_only=True)
class Study:
    """All trials, and the seeds of those that noise plays a part in."""

    trials: tuple[Trial, ...]
    seeds: tuple[int, ...]

    def ise(self, condition: str) -> list[dict[str, float]]:
        """Return the ISE [arcsec^2 s] by case, seed by seed."""
        mine = [trial for trial in self.trials if trial.condition == condition]
        return [
            {trial.case: trial.outcome.ise for trial in mine if trial.seed == seed}
            for seed in dict.fromkeys(trial.seed for trial in mine)
        ]

    def traced(self, condition: str, case: str) -> Outcome:
        """Return the first trial of a condition and case, which has curves."""
        return next(t.outcome for t in self.trials if (t.condition, t.case) == (condition, case))


def study(
    workshop: Workshop,
    seeds: Sequence[int],
    wanted: Sequence[Condition] = (),
    cases: Sequence[str] = CASES,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Study:
    """Run the experiment under each condition (default: all) with each case and, where there is noise, each seed."""
    places, jobs = [], []
    for condition in wanted or conditions():
        for case in cases:
            for seed in seeds if condition.random else seeds[:1]:
                places.append((condition.key, case, seed))
                jobs.append(job(workshop, condition, case, seed, traced=seed == seeds[0]))
    with everywhere(len(jobs)) as spread:
        trials = []
        for place, outcome in zip(places, spread(run, jobs), strict=True):
            trials.append(Trial(condition=place[0], case=place[1], seed=place[2], outcome=outcome))
            progress(len(trials), len(jobs))
    return Study(trials=tuple(trials), seeds=tuple(seeds))


def job(workshop: Workshop, condition: Condition, case: str, seed: int, traced: bool = False) -> Job:
    """Build what one run needs."""
    controller = workshop.build(condition.controlled(case).controller_model())
    known = {name: value for name, value in condition.changes.items() if name in controller.parameters}
    return Job(
        plant=workshop.build(condition.plant.plant().model()).with_parameters(condition.seeded(seed)),
        controller=controller.with_parameters(known),
        period=condition.period,
        smooth_start=condition.smooth_start,
        encoder_noise=condition.encoder_noise,
        torque_noise=condition.torque_noise,
        seed=seed,
        tolerance=LOOSE if condition.random else None,
        traced=traced,
    )


@contextmanager
def everywhere(jobs: int) -> Iterator[Callable[..., Iterator[Any]]]:
    """Yield a `map` that keeps the order and uses all cores; a few jobs are not worth starting processes for."""
    workers = min(cpu_count() or 1, jobs)
    if workers < 2 or jobs < 2 * workers:
        yield map
        return
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        try:
            yield pool.map
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
