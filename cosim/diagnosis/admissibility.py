"""Is a fitted effect what its name says, or another one in disguise?"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from cosim.diagnosis.answer.ledger import Rule, at_least
from cosim.diagnosis.hypotheses import hypothesis_of
from cosim.diagnosis.tuning import at_bound
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import far_from_turns
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount

LEAST_CHANGES = 0.5
"""Share of the torque's changes from row to row that a model with a delay or a lag must explain: in noise that the
controller answers, time runs otherwise than in the machine."""

LEAST_REMOVED = 0.02
"""Share of the energy below which it says nothing where it is removed: what is slow and small removes as little."""


LEAST_AT_REST = 10
"""Rows at rest below which nothing is concluded from them."""


class Fitted(Protocol):
    """An effect and the fitted structure that holds it."""

    @property
    def effect(self) -> Effect:
        """The effect."""
        ...

    @property
    def fit(self) -> Fit:
        """The structure."""
        ...


def name_rules(problem: Problem, one: Fitted) -> Iterator[Rule]:
    """Rules of whether an effect is what its name says, and can be identified from this motion."""
    mount, effect, prepared = one.fit.mount, one.effect, problem.prepared
    own = hypothesis_of(effect)
    yield Rule("its numbers are those of such an effect", own.is_plausible(effect, mount))
    yield Rule("the motion separates it from another friction law", own.shows(effect, mount, prepared))
    yield Rule("no number at its bound, and no other effect in disguise", not is_degenerate(problem, effect))
    needed, longest = hypothesis_of(effect).way_back(effect, mount), longest_way_back(prepared)
    yield at_least("way back of the motion", longest, needed, "m" if mount.motion == "linear" else "rad")


def is_degenerate(problem: Problem, effect: Effect) -> bool:
    """Whether an effect is really something else, lies at a bound, or is what no card may hold."""
    own = hypothesis_of(effect)
    if effect.broken_rule() or at_bound(effect, own.sizes):
        return True
    return own.is_degenerate(problem, effect)


def needs_turns(effect: Effect, mount: Mount, prepared: Prepared) -> bool:
    """Whether a fitted effect of friction needs motion to turn back further than it ever did."""
    return hypothesis_of(effect).way_back(effect, mount) > longest_way_back(prepared)


def longest_way_back(prepared: Prepared) -> float:
    """Longest way that the motion turns back, over all pieces [rad, m].

    Friction resists, so only motion that turns back tells its level; where it goes one way a level is free to be
    anything.
    """
    return max(_way_back(piece.q[piece.inside]) for piece in prepared.pieces)


def _way_back(q: Array) -> float:
    """Longest way back of a motion, whichever way it goes first."""
    return float(min((np.maximum.accumulate(q) - q).max(), (q - np.minimum.accumulate(q)).max()))


def in_time(problem: Problem, one: Fitted) -> bool:
    """Whether an effect of timing, if it is one, is told by changes of the torque that the model explains.

    Only changes that some motion asks for: at constant speed nothing is asked, what changes is noise and ripple, and
    the torque is what a loop answers.
    """
    if not hypothesis_of(one.effect).is_timing:
        return True
    pieces = problem.prepared.pieces
    counted = np.concatenate([np.full(len(piece.kept), piece.asked) for piece in pieces]) & (problem.weight > 0)
    owner = problem.prepared.recording_of
    rows = np.flatnonzero(counted[1:] & counted[:-1] & (owner[1:] == owner[:-1]))
    left, all_of_it = (np.diff(x)[rows] for x in (one.fit.residual, problem.prepared.stacked("tau")))
    return float(left @ left) < (1 - LEAST_CHANGES) * float(all_of_it @ all_of_it)


def away_from_turns(problem: Problem, left: Array, without: Array) -> float:
    """Share of the energy that something removes which it removes away from turns; 1 where it hardly removes any.

    Args:
        problem: whose rows these are.
        left: weighted residual of training with it (rows,) [N m].
        without: the same without it.
    """
    removed = without**2 - left**2
    whole = float(removed.sum())
    if whole <= LEAST_REMOVED * float(without @ without):
        return 1.0
    return float(far_from_turns(problem.prepared) @ removed) / whole


def removed_at_rest(weight: Array, left: Array, without: Array) -> float:
    """Share of the energy at rest, of which a law without memory says nothing, that a contact that bends removes.

    There it says what is held, and must be right; 1 where the axis hardly rests.

    Args:
        weight: of each row for the law without memory (rows,); 0 where that says nothing.
        left: residual with the contact (rows,) [N m].
        without: the same without it.
    """
    rest = weight == 0
    if rest.sum() < LEAST_AT_REST:
        return 1.0
    return 1 - float(left[rest] @ left[rest]) / max(float(without[rest] @ without[rest]), 1e-300)


def gets_memory(mount: Mount, without: Mount) -> bool:
    """Whether friction remembers with something that was added, and did not without it."""
    return bool(mount.law.states()) and not without.law.states()
