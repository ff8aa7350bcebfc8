"""Is a fitted effect what its name says, or another one in disguise?"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from cosim.diagnosis.answer.ledger import Rule, at_least
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.tuning import at_bound
from cosim.estimation.fit import Fit, recorded_by
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount


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


def name_rules(problem: Problem, one: Fitted, is_held: bool = False) -> Iterator[Rule]:
    """Rules of whether an effect is what its name says, and can be identified from this motion.

    `is_held`: it explains surely what is held at rest, which no law without memory does, however little it bends.
    """
    mount, effect, prepared = one.fit.mount, one.effect, problem.prepared
    own = hypothesis_of(effect)
    yield Rule("its numbers are those of such an effect", own.is_plausible(effect, mount))
    yield Rule("the motion separates it from another friction law", is_held or own.shows(effect, mount, prepared))
    yield Rule("no number at its bound, and no other effect in disguise", not is_degenerate(problem, effect))
    needed, longest = hypothesis_of(effect).way_back(effect, mount), longest_way_back(prepared)
    yield at_least("way back of the motion", longest, needed, "m" if mount.motion == "linear" else "rad")


def is_degenerate(problem: Problem, effect: Effect) -> bool:
    """Whether an effect is really something else, lies at a bound, or is what no card may hold."""
    own = hypothesis_of(effect)
    recorded = recorded_by(problem.prepared.pieces)
    if effect.broken_rule() or at_bound(effect, own.sizes, recorded, own.may_end):
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
    the torque is what a loop answers, where time runs otherwise than in the machine. Half of them must be explained.
    """
    if not hypothesis_of(one.effect).is_timing:
        return True
    pieces = problem.prepared.pieces
    counted = np.concatenate([np.full(len(piece.kept), piece.is_asked) for piece in pieces]) & (problem.weight > 0)
    owner = problem.prepared.recording_of
    rows = np.flatnonzero(counted[1:] & counted[:-1] & (owner[1:] == owner[:-1]))
    left, all_of_it = (np.diff(x)[rows] for x in (one.fit.residual, problem.prepared.stacked("tau")))
    return float(left @ left) < (1 - POLICY.half) * float(all_of_it @ all_of_it)
