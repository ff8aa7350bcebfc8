"""Is a fitted effect what its name says, or another one in disguise? Do recordings tell its size?"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.answer.ledger import Rule, at_least
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.tuning import at_bound, ended_sizes
from cosim.diagnosis.search.candidate_fit import CandidateFit
from cosim.estimation.blocks import Blocks, covariance
from cosim.estimation.fit import Fit, recorded_by
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.support.statistics import Z95
from pyfmi_models.effects import Effect
from pyfmi_models.model import Recorded, parameters_of
from pyfmi_models.mount import Mount


def name_rules(problem: Problem, one: CandidateFit, is_held: bool = False) -> Iterator[Rule]:
    """Rules of whether an effect is what its name says, and can be identified from this motion.

    `is_held`: it explains surely what is held at rest, which no law without memory does, however little it bends.
    """
    mount, effect, prepared = one.fit.mount, one.effect, problem.prepared
    own = hypothesis_of(effect)
    yield Rule("its numbers are those of such an effect", own.is_plausible(effect, mount))
    yield Rule("the motion separates it from another friction law", is_held or own.shows(effect, mount, prepared))
    yield Rule("no number at its bound, and no other effect in disguise", not is_degenerate(problem, effect))
    needed, longest = own.way_back(effect, mount), longest_way_back(prepared)
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
    ways = (piece.q[piece.inside] for piece in prepared.pieces)  # whichever way each goes first
    return max(float(min((np.maximum.accumulate(q) - q).max(), (q - np.minimum.accumulate(q)).max())) for q in ways)


def in_time(problem: Problem, one: CandidateFit) -> bool:
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


@dataclass(frozen=True)
class Numbers:
    """Parameters of one effect, and what the recordings say of their precision."""

    values: dict[str, float]
    errors: dict[str, float]


def standard_errors(chosen: Fit, blocks: Blocks, weight: Array) -> dict[str, float]:
    """Block-robust standard errors of all fitted parameters (sandwich with blocks as clusters)."""
    spread = covariance(chosen.slopes * weight[:, None], chosen.residual * weight, blocks)
    return dict(zip(chosen.free, np.sqrt(np.maximum(np.diag(spread), 0)).tolist(), strict=True))


def numbers_of(effect: Effect, mount: Mount, errors: Mapping[str, float]) -> Numbers:
    """Parameters of an effect of a fitted mount with their standard errors, by the effect's own names."""
    prefix = next(name for name, part in mount.components().items() if part is effect)
    values = {variable.name: float(variable.start) for variable in parameters_of(effect)}
    return Numbers(values, {name: errors[f"{prefix}.{name}"] for name in values if f"{prefix}.{name}" in errors})


def is_told(effect: Effect, numbers: Numbers, mount: Mount, recorded: Recorded) -> bool:
    """Whether the recordings tell the size of an effect: its 95 % range holds neither "none" nor all that it may be.

    Of several sizes (a level and a viscosity, an offset and a drift) one is enough. At a bound, also at one of the fit,
    nothing is told.
    """
    own, known = hypothesis_of(effect), {variable.name: variable for variable in parameters_of(effect)}
    sizes = [name for name in own.sizes or (effect.main.parameter,) if name in numbers.errors]
    ended = ended_sizes(effect, sizes, recorded)
    none = own.none(mount)

    def excludes(name: str) -> bool:
        value, half, (low, high) = numbers.values[name], Z95 * numbers.errors[name], (known[name].low, known[name].high)
        whole = value - half <= low and value + half >= high
        return abs(value - none) > half and not whole and low < value < high

    return not sizes or any(name not in ended and excludes(name) for name in sizes)


def tells(problem: Problem, chosen: Fit, effect: Effect) -> bool:
    """Whether the training recordings tell a size of an effect of a fitted structure."""
    numbers = _in_training(problem, chosen, effect)
    return is_told(effect, numbers, chosen.mount, recorded_by(problem.prepared.pieces))


def goes_its_way(problem: Problem, found: Fit, effect: Effect) -> bool:
    """Whether an effect of a fitted structure goes the way its name says, by more than its 95 % range."""
    names = hypothesis_of(effect).must_fall(effect)
    numbers = _in_training(problem, found, effect) if names else None
    return not numbers or any(numbers.values[name] < -Z95 * numbers.errors.get(name, np.inf) for name in names)


def _in_training(problem: Problem, found: Fit, effect: Effect) -> Numbers:
    """An effect's numbers with the errors that the training recordings leave."""
    return numbers_of(effect, found.mount, standard_errors(found, Blocks.of(problem.prepared), problem.weight))
