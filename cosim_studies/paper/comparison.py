"""Controllers side by side: what each gains, what it costs, and what it survives.

    ratio = ISE / ISE of C3a in the same condition with the same seed

Margins are those of the loop at the worst of its points (`price`). Designs are chosen on design seeds; everything that
is reported runs on test seeds.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cosim.support.errors import InputError
from cosim.support.statistics import rms
from cosim_studies.paper.conditions import Condition, condition
from cosim_studies.paper.experiment import Job
from cosim_studies.paper.frontier import Design, choice, chosen_option, designs, frontier
from cosim_studies.paper.margins import Margins
from cosim_studies.paper.options import ADAPTING, LEARNING, REFERENCE, Option, options, repeating, settled
from cosim_studies.paper.price import price
from cosim_studies.paper.robustness import Stress, stresses
from cosim_studies.paper.study import Study, TrialKey, jobs, performed
from cosim_studies.paper.workshop import Workshop

Progress = Callable[[int, int], None]
A, B = "realistic", "realistic_observer"
"""Conditions of the comparison: realistic A and B."""
FEW = 5
"""Seeds of what explains and is not asked for."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is compared, and on which seeds; no seed is for both design and test."""

    seeds: tuple[int, ...]
    design_seeds: tuple[int, ...]
    options: tuple[Option, ...] = field(default_factory=options)
    designs: tuple[Option, ...] = field(default_factory=designs)
    stresses: tuple[Stress, ...] = field(default_factory=stresses)

    def __post_init__(self) -> None:
        """Refuse seeds that are for both (raises InputError)."""
        both = sorted(set(self.seeds) & set(self.design_seeds))
        if both:
            raise InputError(f"Seed {both[0]} is for both design and test; choose another first seed.")


@dataclass(frozen=True, kw_only=True)
class Row:
    """One controller in one condition: ratio with its standard deviation and worst value over the seeds, ISE, torques.

    `ise` is the mean [arcsec^2 s], `torque` the RMS of the command, `noise` that part of it which the encoder's noise
    makes [N m].
    """

    condition: str
    option: Option
    ratio: float
    spread: float
    worst: float
    ise: float
    torque: float
    noise: float
    price: Margins
    seeds: int


@dataclass(frozen=True, kw_only=True)
class Survival:
    """One controller under one stress: whether its linear loop is stable, and its ISE over that of C3a as designed."""

    option: Option
    stress: Stress
    stable: bool
    ratio: float


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Everything that was compared."""

    plan: Plan
    designs: tuple[Design, ...]
    chosen: Design
    rows: tuple[Row, ...]
    survivals: tuple[Survival, ...]

    def of(self, key: str) -> list[Row]:
        """Return the rows of a condition."""
        return [row for row in self.rows if row.condition == key]


def compare(
    workshop: Workshop, plan: Plan, known: Study | None = None, on_progress: Progress = lambda done, of: None
) -> Comparison:
    """Search a design on the design seeds, then measure it and all options on the test seeds.

    What is `known` already of conditions, cases and test seeds is not run again.
    """
    tried = tuple(_tried(workshop, plan, on_progress))
    chosen = choice(tried)
    best = [one.option for one in frontier(one for one in tried if one.option.knows == "nominal")]
    compared = (*plan.options, chosen_option(chosen))
    return Comparison(
        plan=plan,
        designs=tried,
        chosen=chosen,
        rows=tuple(_rows(workshop, _places(compared, best), plan.seeds, known, on_progress)),
        survivals=tuple(_survivals(workshop, compared, plan, on_progress)),
    )


Pair = tuple[Condition, Option, int]
"""A condition, a controller in it, and for how many of the seeds."""


def _places(compared: Sequence[Option], best: Sequence[Option]) -> list[Pair]:
    """List what is measured on the test seeds."""
    most = 10**9
    found = [(condition(key), one, most) for key in (A, B) for one in compared]
    found += [(condition(A), one, FEW) for one in best]
    learners = [one for one in (REFERENCE, ADAPTING, LEARNING) if one in compared]
    for key in (A, B) if len(learners) > 1 else ():
        found += [(settled(condition(key)), one, FEW) for one in learners]
        found += [(repeating(settled(condition(key))), one, FEW) for one in learners]
    limits = [one for one in compared if one.key in ("C3a", "refitted", "chosen")]
    return found + [(repeating(condition(A)), one, FEW) for one in limits]


def planned(workshop: Workshop, pairs: Iterable[Pair], seeds: Sequence[int]) -> Iterator[tuple[TrialKey, Job]]:
    """Yield a run for each seed of each pair."""
    for where, option, count in pairs:
        for seed, job in jobs(workshop, option.under(where), option.compensation, seeds[:count]):
            yield TrialKey(where.key, option.key, seed), job


def _tried(workshop: Workshop, plan: Plan, on_progress: Progress) -> Iterator[Design]:
    where, every = condition(A), len(plan.design_seeds)
    pairs = [(where, one, every) for one in (REFERENCE, *plan.designs)]
    found = Ratios(performed(list(planned(workshop, pairs, plan.design_seeds)), on_progress))
    for option in plan.designs:
        under = option.under(where)
        cost = price(under)
        yield Design(
            option=option,
            ratio=float(np.mean(found.ratios(A, option.key))),
            torque=found.torque(A, option.key),
            price=cost,
            noise=cost.noise * under.encoder_noise,
        )


def _rows(
    workshop: Workshop, pairs: Sequence[Pair], seeds: Sequence[int], known: Study | None, on_progress: Progress
) -> Iterator[Row]:
    cases = {REFERENCE.key, "C2a"}  # these controllers are the paper's cases as they are
    done = [trial for trial in (known.trials if known else ()) if trial.case in cases]
    ready = {(trial.condition, trial.case, trial.seed) for trial in done}
    wanted = [(place, job) for place, job in planned(workshop, pairs, seeds) if place not in ready]
    found = Ratios(Study(trials=(*done, *performed(wanted, on_progress).trials), seeds=tuple(seeds)))
    for where, option, _ in pairs:
        ratios, cost = found.ratios(where.key, option.key), price(option.under(where))
        yield Row(
            condition=where.key,
            option=option,
            ratio=float(np.mean(ratios)),
            spread=float(np.std(ratios, ddof=1)) if len(ratios) > 1 else 0.0,
            worst=max(ratios),
            ise=float(np.mean(list(found.ise[where.key, option.key].values()))),
            torque=found.torque(where.key, option.key),
            noise=cost.noise * where.encoder_noise,
            price=cost,
            seeds=len(ratios),
        )


def _survivals(workshop: Workshop, compared: Sequence[Option], plan: Plan, on_progress: Progress) -> Iterator[Survival]:
    places = [(stress, option) for stress in plan.stresses for option in compared]
    pairs = [(stress.on(condition(B)), option, 1) for stress, option in places]
    designed = (condition(B), REFERENCE, 1)
    found = Ratios(performed(list(planned(workshop, [designed, *pairs], plan.seeds)), on_progress))
    usual = found.ise[B, REFERENCE.key][plan.seeds[0]]
    for (stress, option), (where, _, _) in zip(places, pairs, strict=True):
        ise = found.ise[where.key, option.key][plan.seeds[0]]
        stable = price(option.under(where)).stable
        yield Survival(option=option, stress=stress, stable=stable, ratio=ise / usual)


class Ratios:
    """ISE of a study by condition, controller and seed, and its ratios to C3a."""

    def __init__(self, study: Study) -> None:
        """Sort the trials of a study."""
        self.ise: dict[tuple[str, str], dict[int, float]] = {}
        self._torque: dict[tuple[str, str], list[float]] = {}
        for trial in study.trials:
            place = trial.condition, trial.case
            self.ise.setdefault(place, {})[trial.seed] = trial.outcome.ise
            self._torque.setdefault(place, []).append(trial.outcome.torque)

    def ratios(self, where: str, key: str) -> list[float]:
        """Return ISE over that of C3a, seed by seed."""
        usual: Mapping[int, float] = self.ise[where, REFERENCE.key]
        return [value / usual[seed] for seed, value in self.ise[where, key].items()]

    def torque(self, where: str, key: str) -> float:
        """Return the RMS of the command over all seeds [N m]."""
        return rms(np.asarray(self._torque[where, key]))
