"""All runs of the tracking experiment: every condition, every case, every seed, on all cores."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import active_children, get_context
from os import cpu_count
from typing import Any, NamedTuple

from cosim.support.errors import CosimError
from cosim_studies.paper.conditions import CASES, Condition, conditions
from cosim_studies.paper.experiment import Job, Outcome, run
from cosim_studies.paper.workshop import Workshop

LOOSE = 1e-4
"""Tolerance of the plant's solver where noise kicks it every tick; moves an ISE by 5e-6 of itself (from 1e-8)."""


class TrialKey(NamedTuple):
    """Where a run stands in a study."""

    condition: str
    case: str
    seed: int


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
    on_progress: Callable[[int, int], None] = lambda done, of: None,
) -> Study:
    """Run the experiment under each condition (default: all) with each case and, where there is noise, each seed."""
    planned = [
        (TrialKey(condition.key, case, seed), replace(one, traced=seed == seeds[0]))
        for condition in wanted or conditions()
        for case in cases
        for seed, one in jobs(workshop, condition, case, seeds)
    ]
    return performed(planned, on_progress)


def performed(
    planned: Sequence[tuple[TrialKey, Job]], on_progress: Callable[[int, int], None] = lambda done, of: None
) -> Study:
    """Run all jobs on all cores."""
    trials = []
    with everywhere(len(planned)) as spread:
        outcomes = spread(run, [one for _, one in planned])
        for (place, _), outcome in zip(planned, outcomes, strict=True):
            trials.append(Trial(condition=place.condition, case=place.case, seed=place.seed, outcome=outcome))
            on_progress(len(trials), len(planned))
    return Study(trials=tuple(trials), seeds=tuple(dict.fromkeys(trial.seed for trial in trials)))


def jobs(workshop: Workshop, condition: Condition, case: str, seeds: Sequence[int]) -> Iterator[tuple[int, Job]]:
    """Yield a run for each seed; where nothing is random, one."""
    first = job(workshop, condition, case, seeds[0])
    for seed in seeds if condition.random else seeds[:1]:
        yield seed, replace(first, seed=seed, plant=first.plant.with_parameters(condition.seeded(seed)))


def job(workshop: Workshop, condition: Condition, case: str, seed: int, traced: bool = False) -> Job:
    """Build what one run needs."""
    controller = workshop.build(condition.controlled(case).controller_model())
    plant = condition.plant.plant().model()
    known = {name: value for name, value in condition.changes.items() if name in controller.parameters}
    return Job(
        plant=workshop.build(plant).with_parameters(condition.seeded(seed)),
        controller=controller.with_parameters(known),
        period=condition.period,
        smooth_start=condition.smooth_start,
        run_in=condition.run_in,
        position="q_load" if any(one.name == "q_load" for one in plant.outputs) else "q",
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
    others = active_children()
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        try:
            yield partial(_mapped, pool)
        except BrokenProcessPool as error:
            text = "a process that did a part of this was ended from outside, or had no memory left."
            raise CosimError(text) from error
        except BaseException:
            for child in set(active_children()) - set(others):
                child.terminate()
            raise


def _mapped(pool: ProcessPoolExecutor, function: Callable[..., Any], *parts: Iterable[Any]) -> Iterator[Any]:
    """As `pool.map`, but nothing is cancelled at the end: where processes are ended too that is a traceback."""
    futures = [pool.submit(function, *one) for one in zip(*parts, strict=False)]
    return (one.result() for one in futures)
