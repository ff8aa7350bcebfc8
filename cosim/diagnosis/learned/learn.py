"""Model what has no name: terms chosen in training, delivered only where recordings that nothing saw are better off.

The answer itself is decided before and does not change. Terms are chosen one after the other (`select.py`); the
held-out recordings then say how many of them stay, as they do for named effects, and have a veto: none of them may be
worse off.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cosim.diagnosis.comparison import Comparison
from cosim.diagnosis.entries import LearnedEntry
from cosim.diagnosis.learned.candidate_terms import CandidateTerm, candidate_terms
from cosim.diagnosis.learned.grams import columns_of, grams_of
from cosim.diagnosis.learned.select import fitted, path
from cosim.diagnosis.predictive import Predictive
from cosim.diagnosis.protocol import interval_of, residuals
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Array
from cosim.support.statistics import rms
from pyfmi_models.effects.learned import LearnedEffect
from pyfmi_models.mount import Mount

LEAST_GAIN = 0.01
"""Share of the held-out error that a term must remove: less is no better model, only a larger one. Unit: 1."""
FEWER = 3
"""How often the waves of a term are halved before it is given up."""
MIDDLE = (0.025, 0.975)
"""Quantiles of a term's torque between which its size is told."""


@dataclass(frozen=True)
class Learned:
    """The delivered model with its learned terms, and what they are worth on the held-out recordings."""

    mount: Mount
    effects: tuple[LearnedEffect, ...]
    quantities: tuple[str, ...]
    size: float
    """Half the range of the terms' torque in training, outermost 5 % left out [N m or N]."""
    before: float
    after: float
    interval: tuple[float, float]
    """95 % range of before - after."""
    evidence: tuple[float, ...] = field(default=())
    predicted: tuple[float, ...] = field(default=())

    def sentence(self) -> str:
        """Say it to a mechanic."""
        unit, (low, high) = "N" if self.mount.motion == "linear" else "N·m", self.interval
        depends = ", and on ".join(self.quantities)
        error = f"held-out error {self.before:.2g} -> {self.after:.2g} {unit} [less by {low:.2g} to {high:.2g}]"
        return f"Something that depends on {depends}, {self.size:.2g} {unit}; modelled as a table; {error}."

    def as_json(self) -> LearnedEntry:
        """Return what `diagnosis.json` holds under `learned`."""
        linear = self.mount.motion == "linear"
        return {
            "quantities": list(self.quantities),
            "size": float(self.size),
            "table": [effect.for_reader("N" if linear else "N.m") for effect in self.effects],
            "before": self.before,
            "after": self.after,
            "interval": list(self.interval),
            "range": [effect.learned_in(linear) for effect in self.effects],
            "evidence": [float(one) for one in self.evidence],
            "predicted": [float(one) for one in self.predicted],
            "statement": self.sentence(),
        }


def learn(comparison: Comparison, found: Fit, held: Predictive) -> Learned | None:
    """Learn what a structure leaves; None where nothing that was learned is better on the held-out recordings."""
    tried = [one for one in candidate_terms(found.mount, comparison.problem.prepared) if _is_recorded(one, held)]
    columns = [columns_of(found.mount, one, comparison.problem.prepared) for one in tried]
    chosen = path(grams_of(comparison, found, columns, tried), range(len(tried)))
    best: Learned | None = None
    for count in range(1, len(chosen.order) + 1):
        own = _judged(comparison, found, [tried[k] for k in chosen.order[:count]], held)
        if own and (best is None or own.after < best.after):
            best = replace(own, evidence=chosen.evidence[:count], predicted=chosen.predicted[:count])
    return replace(best, size=_size(comparison, best)) if best else None


def _judged(comparison: Comparison, found: Fit, terms: Sequence[CandidateTerm], held: Predictive) -> Learned | None:
    """Fit some terms and ask the held-out recordings; None where they veto."""
    whole, effects = _allowed(comparison, found, terms)
    if not effects:
        return None
    pairs = list(zip(_left(held, found.mount), _left(held, whole), strict=True))
    left = [np.concatenate(parts) for parts in zip(*pairs, strict=True)]
    before, after = map(rms, left)
    gain = held.log_likelihood(held.residual(whole)) - held.log_likelihood(held.residual(found.mount))
    worse = any(rms(new) > rms(old) for old, new in pairs)
    interval = interval_of(left[0], left[1], held.protocol.pieces[0].dt)
    if worse or gain < comparison.policy.least_predicted or after > (1 - LEAST_GAIN) * before or interval[0] <= 0:
        return None
    return Learned(whole, effects, tuple(one.name for one in terms), 0.0, before, after, interval)


def _allowed(
    comparison: Comparison, found: Fit, terms: Sequence[CandidateTerm]
) -> tuple[Mount, tuple[LearnedEffect, ...]]:
    """Fit terms that break no rule, with fewer waves where they would: a drive that falls where no row tells."""
    for _ in range(FEWER):
        mount, fit = fitted(comparison, found, terms)
        effects = tuple(one.learned(one.coefficients.tolist()) for one in fit)
        broken = [bool(effect.broken_rule()) for effect in effects]
        if not any(broken):
            return replace(mount, effects=(*mount.effects, *effects)), effects
        terms = [one.coarser() if fails else one for one, fails in zip(terms, broken, strict=True)]
    return found.mount, ()


def _left(held: Predictive, mount: Mount) -> list[Array]:
    """What a model leaves of each held-out recording, by the protocol."""
    pieces = held.protocol.pieces
    left = [one[piece.inside] for one, piece in zip(residuals(held.protocol, mount), pieces, strict=True)]
    owners = [piece.recording for piece in pieces]
    return [
        np.concatenate([one for one, own in zip(left, owners, strict=True) if own == number])
        for number in sorted(set(owners))
    ]


def _is_recorded(term: CandidateTerm, held: Predictive) -> bool:
    """Whether the held-out recordings have what a term goes over."""
    return all(one.name in piece.extras for one in term.effect.inputs() for piece in held.prepared.pieces)


def _size(comparison: Comparison, learned: Learned) -> float:
    """Half the middle range of the torque that the terms add in training."""
    prepared = comparison.problem.prepared
    count = len(learned.mount.effects) - len(learned.effects)
    plain = replace(learned.mount, effects=learned.mount.effects[:count])
    with_it, without = (Inverse(mount, ()) for mount in (learned.mount, plain))
    nothing = np.zeros(0)
    parts = [(with_it.torque(p, nothing)[0] - without.torque(p, nothing)[0])[p.kept] for p in prepared.pieces]
    return float(np.ptp(np.quantile(np.concatenate(parts), MIDDLE))) / 2
