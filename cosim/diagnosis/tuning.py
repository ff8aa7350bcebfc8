"""Fit what the grid of a candidate knows only roughly: cycles, how a cable hardens, a shape, how a contact bends."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cosim.diagnosis.families.friction import CURVES
from cosim.diagnosis.fit import FIXED, Fit, with_values
from cosim.diagnosis.meaning import at_bound
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.structure import LINEAR
from pyfmi_models.effects import Effect, FrictionEffect, StribeckEffect
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.presliding import Presliding

WHOLE = 0.01
"""A whole number of cycles is taken if the residual grows by no more than this share."""
SHARP = 1.0
"""Exponent of the Stribeck curve of Bo and Pavelescu (Wear 82, 1982); that of Armstrong-Helouvry is 2."""
SOFTER = (4.0, 16.0)
"""How many times softer than the start a bending contact is tried."""
DEAD = 0.1
"""Share of the card's number below which a friction parameter is tried at the card's number again."""


def tuned(problem: Problem, found: Fit, start: Effect) -> Fit:
    """Fit what its grid knows only roughly of an effect that was added last: cycles, how a cable hardens, a shape."""
    if isinstance(start, FrictionEffect):
        found = _revived(problem, found, start)
    added: Any = found.mount.effects[-1]
    if isinstance(added, CableWrap):
        return problem.fit(_freed(problem, found, "hardening").mount, 4)
    if isinstance(start, StribeckEffect):
        return _shaped(problem, _refound(problem, found, [replace(start, Vs=s * problem.top_speed) for s in CURVES]))
    if isinstance(start, Presliding):
        return _refound(problem, found, [replace(start, sigma0=start.sigma0 / softer) for softer in SOFTER])
    return _in_cycles(problem, found) if getattr(added, "cycles_per_rev", 0.0) > 0 else found


def _revived(problem: Problem, found: Fit, start: Effect) -> Fit:
    """Fit again from the card's friction what died while another effect stood in for it, if that fits better.

    Where a friction is nothing, its change with temperature or direction is nothing too, and no step leads away.
    """
    card = {variable.name: variable.start for variable in problem.mount.parameters()}
    levels = {name: value for name, value in found.parameters().items() if name in card and name.endswith(LINEAR)}
    dead = [name for name, value in levels.items() if abs(value) < DEAD * abs(card[name])]
    if not dead:
        return found
    again = replace(found.mount, effects=(*found.mount.effects[:-1], start))
    other = problem.fit(with_values(again, dead, np.array([card[name] for name in dead])), 12)
    return min((found, other), key=problem.error)


def _shaped(problem: Problem, found: Fit) -> Fit:
    """Try the sharper Stribeck curve of the literature too, and any shape if that fits clearly better."""
    gauss: Any = found.mount.effects[-1]
    sharper = replace(found.mount, effects=(*found.mount.effects[:-1], replace(gauss, delta=SHARP)))
    best = min((found, problem.fit(sharper, 12)), key=problem.error)
    free = _freed(problem, best, "delta")
    better = problem.error(free) * (1 + WHOLE) < problem.error(best)
    return free if better and not at_bound(free.mount.effects[-1]) else best


def _refound(problem: Problem, found: Fit, others: Sequence[Effect]) -> Fit:
    """The best of a fit and those from other starts: a start is known to an order of magnitude at most."""
    tried = [problem.fit(replace(found.mount, effects=(*found.mount.effects[:-1], one)), 12) for one in others]
    return min((found, *tried), key=problem.error)


def _in_cycles(problem: Problem, found: Fit) -> Fit:
    """Fit the cycles of a ripple; slots, teeth and rolling elements come in whole numbers: one that fits is taken."""
    free = _freed(problem, found, "cycles_per_rev")
    best = min((found, free), key=problem.error)
    ripple: Any = best.mount.effects[-1]
    for cycles in (max(1.0, float(round(ripple.cycles_per_rev))), ripple.cycles_per_rev):
        effects = (*best.mount.effects[:-1], replace(ripple, cycles_per_rev=cycles))
        settled = problem.fit(replace(best.mount, effects=effects), 8)
        if problem.error(settled) < problem.error(best) * (1 + WHOLE):
            return settled
    return found


def _freed(problem: Problem, found: Fit, name: str) -> Fit:
    return problem.fit(found.mount, 10, [fixed for fixed in FIXED if fixed != name])
