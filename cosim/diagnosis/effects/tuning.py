"""Fit what the grid of a candidate knows only roughly: the tools that hypotheses use."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf, isclose
from typing import Any

import numpy as np

from cosim.estimation.fit import Fit, with_values
from cosim.estimation.least_squares import ENOUGH
from cosim.estimation.priors import is_linear
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import NO_BETTER
from pyfmi_models.effects import Effect
from pyfmi_models.model import Recorded, Variable, parameters_of
from pyfmi_models.mount import Mount

ANY = Recorded(inf, inf)
"""Where no recording limits what a fit may find."""
DEAD = 0.1
"""Share of the card's number below which a friction parameter is tried at the card's number again."""
AT_END = 1e-6
"""Share of a number by which it may be away from an end of its range and is at that end: a thousand times what a fit
keeps from there (`estimation/fit.py`), a millionth of any number that was found."""


def with_last(mount: Mount, effect: Effect) -> Mount:
    """A mount with another effect in the place of its last one."""
    return replace(mount, effects=(*mount.effects[:-1], effect))


def revived(problem: Problem, found: Fit, start: Effect) -> Fit:
    """Fit again from the card's friction what died while another effect stood in for it, if that fits better.

    Where a friction is nothing, its change with temperature or direction is nothing too, and no step leads away.
    """
    card = {variable.name: variable.start for variable in problem.mount.parameters()}
    law, numbers = found.mount.friction, found.parameters()
    levels = {name: value for name, value in numbers.items() if name in card and is_linear(law, name)}
    dead = [name for name, value in levels.items() if abs(value) < DEAD * abs(card[name])]
    if not dead:
        return found
    again = with_values(with_last(found.mount, start), dead, np.array([card[name] for name in dead]))
    other = problem.fit(again, 36)
    return min((found, other), key=problem.error)


def ended_sizes(effect: Effect, sizes: Sequence[str], recorded: Recorded = ANY) -> list[str]:
    """Those of several sizes that are at an end of their range in a fit."""
    return [one.name for one in parameters_of(effect) if one.name in sizes and _ends(effect, one, recorded)]


def _ends(effect: Effect, variable: Variable, recorded: Recorded) -> bool:
    """Whether a number is at an end of its range: 0.94999999905 is at 0.95, as a fit goes on from 1e-9 inside."""
    low, high = effect.fit_bounds(variable, recorded)
    value = variable.start
    is_low = value <= low or isclose(value, low, rel_tol=AT_END)
    return value >= high or isclose(value, high, rel_tol=AT_END) or (low != 0 and is_low)


def refound(
    problem: Problem, found: Fit, evidence: Callable[[Fit], float], others: Sequence[Effect], steps: int = 36
) -> Fit:
    """The best of a fit and those from other starts: a start is known to an order of magnitude at most."""
    return max((found, *(restarted(problem, found, one, steps) for one in others)), key=evidence)


def restarted(problem: Problem, found: Fit, start: Effect, steps: int = 36) -> Fit:
    """A fit with its last effect started elsewhere."""
    return problem.fit(with_last(found.mount, start), steps)


def in_most_turns(problem: Problem) -> Problem:
    """The same with the weight of one recording alone, the one that turns most: it tells several starts apart too."""
    recordings, pieces = problem.prepared.recording_of, problem.prepared.pieces
    turns = dict.fromkeys(np.unique(recordings[problem.weight > 0]).tolist(), 0)
    for piece in (one for one in pieces if one.recording in turns):
        turns[piece.recording] += int(np.count_nonzero(np.diff(np.sign(piece.v))))
    most = max(turns, key=lambda one: turns[one])
    return replace(problem, weight=np.where(recordings == most, problem.weight, 0.0))


def in_cycles(problem: Problem, found: Fit) -> Fit:
    """Fit the cycles of a ripple; slots, teeth and rolling elements come in whole numbers: one that fits is taken.

    A metre knows no whole numbers.
    """
    free = freed(problem, found, "cycles_per_rev")
    best = min((found, free), key=problem.error)
    ripple: Any = best.mount.effects[-1]
    whole = [] if problem.mount.motion == "linear" else [max(1.0, float(round(ripple.cycles_per_rev)))]
    for cycles in (*whole, ripple.cycles_per_rev):
        settled = restarted(problem, best, replace(ripple, cycles_per_rev=cycles), 24)
        if problem.error(settled) < problem.error(best) * (1 + NO_BETTER):
            return settled
    return found


def in_whole_cycles(problem: Problem, found: Fit, waves: int) -> Fit:
    """A ripple and its multiples, the last effects of a fit, with a whole number of cycles, where that fits as well."""
    ripple: list[Any] = [*found.mount.effects[-waves:]]
    cycles = ripple[0].cycles_per_rev
    whole = max(1.0, float(round(cycles)))
    if problem.mount.motion == "linear" or cycles == whole:
        return found
    moved = [replace(one, cycles_per_rev=one.cycles_per_rev / cycles * whole) for one in ripple]
    settled = problem.fit(replace(found.mount, effects=(*found.mount.effects[:-waves], *moved)), 24)
    return settled if problem.error(settled) < problem.error(found) * (1 + NO_BETTER) else found


def freed(problem: Problem, found: Fit, name: str) -> Fit:
    """Fit again with a number that a fit leaves as it is otherwise: it stays from there on, so this goes to the end."""
    return replace(problem, enough=ENOUGH).fit(found.mount, 30, (name,))


def at_bound(effect: Effect, sizes: Sequence[str] = (), recorded: Recorded = ANY, may_end: Sequence[str] = ()) -> bool:
    """Whether a parameter of an effect is at an end of its range in a fit; of several `sizes` all that are not nothing.

    A range from 0 on ends at nothing, which is no bound: there an effect is small. Nor is it one for `may_end`.
    """
    variables = [one for one in parameters_of(effect) if one.name not in may_end]
    ends = {one.name: _ends(effect, one, recorded) for one in variables}
    own = [ends.pop(one.name) for one in variables if one.name in sizes and one.start]
    return any(ends.values()) or (bool(own) and all(own))
