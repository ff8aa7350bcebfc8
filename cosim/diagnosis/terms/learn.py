"""Model what has no name: terms chosen in training, delivered only where recordings that nothing saw are better off.

The answer itself is decided before and does not change. Terms are chosen one after the other (`select.py`); the
held-out recordings then say how many of them stay, as they do for named effects, and have a veto: none of them may be
worse off.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cosim.diagnosis.answer.entries import BinsEntry, LearnedEntry, NotLearnedEntry
from cosim.diagnosis.answer.scores import LearnedScores
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive, interval_of
from cosim.diagnosis.terms.candidate_terms import CandidateTerm, candidate_terms
from cosim.diagnosis.terms.closed_form import ClosedForm, closed_form
from cosim.diagnosis.terms.dictionary import OF_LAW
from cosim.diagnosis.terms.grams import columns_of, grams_of
from cosim.diagnosis.terms.partial import needed, partial
from cosim.diagnosis.terms.select import begun, fitted, paths, telling
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.residuals import NO_BETTER, residuals
from cosim.support.statistics import MIDDLE, rms
from pyfmi_models.effects.learned_base import LearnedEffect
from pyfmi_models.mount import Mount

FEWER = 3
"""How often the waves of a term are halved before it is given up."""


@dataclass(frozen=True)
class Learned:
    """A model with learned terms, and what they are worth on the held-out recordings."""

    mount: Mount
    effects: tuple[LearnedEffect, ...]
    quantities: tuple[str, ...]
    size: float
    """Half the range of the terms' torque in training, outermost 5 % left out [N m or N]."""
    before: float
    after: float
    interval: tuple[float, float]
    """95 % range of before - after."""
    cutoff: float
    """Of the low-pass in front of these errors [Hz]."""
    helps: bool
    """Whether the held-out recordings prove it: else it is no part of the delivered model."""
    evidence: tuple[float, ...] = field(default=())
    predicted: tuple[float, ...] = field(default=())
    gain: float = 0.0
    """What the held-out recordings gain by the terms. Unit: nats."""
    data: tuple[BinsEntry, ...] = field(default=())
    """What the training recordings leave without each term, over what it goes over."""
    formulas: tuple[ClosedForm | None, ...] = field(default=())
    """Of each term, where one is as good as its table."""

    @property
    def is_sure(self) -> bool:
        """Whether training, what training left out and the held-out recordings each prove it for themselves."""
        return self.helps and bool(min(*self.evidence, *self.predicted, self.gain) >= POLICY.clear)

    def scores(self) -> LearnedScores:
        """What the decision looks at."""
        removed = 1 - (self.after / self.before) ** 2
        of_law = set(self.quantities) <= set(OF_LAW)
        return LearnedScores(tuple(self.quantities), float(min(self.evidence)), float(removed), self.is_sure, of_law)

    @property
    def unit(self) -> str:
        """Of its errors."""
        return "N" if self.mount.motion == "linear" else "N·m"

    def judged_in(self, band: Prepared, without: Mount) -> "Learned":
        """The same with its errors on recordings in another band, in which too it must help."""
        old, new = (np.concatenate(_held_out(band, one)) for one in (without, self.mount))
        interval = interval_of(old, new, band.pieces[0].dt)
        helps = self.helps and interval[0] > 0
        return replace(self, before=rms(old), after=rms(new), interval=interval, cutoff=band.cutoff, helps=helps)

    def sentence(self) -> str:
        """Say it to a mechanic."""
        depends, (low, high) = ", and ".join(self.quantities), self.interval
        error = f"validation error {self.before:.2g} → {self.after:.2g} {self.unit}"
        if not self.helps:
            return (
                f"A lookup table over {depends} was tried for the rest and is not in the model: {error}, "
                "not clearly less, or more on one recording."
            )
        said = f"Something that depends on {depends}, {self.size:.2g} {self.unit}; modelled as a table"
        return f"{said}; {error} [less by {low:.2g} to {high:.2g}]."

    def as_json(self) -> LearnedEntry:
        """Return what `diagnosis.json` holds under `learned`."""
        linear = self.mount.motion == "linear"
        tables = [effect.for_reader("N" if linear else "N.m") for effect in self.effects]
        return {
            "quantities": list(self.quantities),
            "size": float(self.size),
            "table": [{**table, "data": one} for table, one in zip(tables, self.data, strict=True)],
            "formula": [{"table": k, **one.as_json()} for k, one in enumerate(self.formulas) if one],
            "before": self.before,
            "after": self.after,
            "interval": list(self.interval),
            "cutoff_hz": self.cutoff,
            "range": [effect.learned_in(linear) for effect in self.effects],
            "evidence": [float(one) for one in self.evidence],
            "predicted": [float(one) for one in self.predicted],
            "statement": self.sentence(),
        }

    def stated(self) -> tuple[tuple[ClosedForm, str], ...]:
        """The formulas, each with what the diagnosis says of the learned term."""
        return tuple((one, self.sentence()) for one in self.formulas if one)

    def refused(self) -> NotLearnedEntry:
        """Return what `diagnosis.json` holds under `not_learned`."""
        return {
            "quantities": list(self.quantities),
            "before": self.before,
            "after": self.after,
            "cutoff_hz": self.cutoff,
            "statement": self.sentence(),
        }


NOTHING_TRIED: NotLearnedEntry = {
    "quantities": [],
    "statement": "No table over what was recorded predicts the remaining error, so none was added to the model.",
}


def learn(comparison: Comparison, found: Fit, held: Predictive) -> Learned | None:
    """Learn what a structure leaves; None where no term predicts training recordings that were left out.

    Where nothing is better on the held-out recordings, what came nearest is returned, and does not help.
    """
    tried = [one for one in candidate_terms(found.mount, comparison.problem.prepared) if is_recorded(one, held)]
    columns = [columns_of(found.mount, one, comparison.problem.prepared) for one in tried]
    grams, best = grams_of(comparison, found, columns, tried), None
    for chosen in begun(paths(grams, telling(grams, tried))):
        own = _judged(comparison, found, [tried[k] for k in chosen.order], held)
        if own and (best is None or (not own.helps, own.after) < (not best.helps, best.after)):
            best = replace(own, evidence=chosen.evidence, predicted=chosen.predicted)
    return _measured(comparison, found, best, held) if best and best.helps else best


def _measured(comparison: Comparison, found: Fit, learned: Learned, held: Predictive) -> Learned:
    """Add the size of the terms, the data that they were learned from, and formulas that are as good."""
    problem, whole = comparison.problem, learned.mount
    rows = [partial(whole, one, problem.prepared, problem.weight) for one in learned.effects]
    formulas = (closed_form(whole, one, found, comparison, held) for one in learned.effects)
    data = tuple(one.data() for one in rows)
    return replace(learned, size=_size(comparison, learned), data=data, formulas=tuple(formulas))


def _judged(comparison: Comparison, found: Fit, terms: Sequence[CandidateTerm], held: Predictive) -> Learned | None:
    """Fit some terms and ask the held-out recordings, which may veto; None where no fit breaks no rule."""
    whole, effects = allowed(comparison, found, terms)
    if not effects:
        return None
    pairs = list(zip(_held_out(held.protocol, found.mount), _held_out(held.protocol, whole), strict=True))
    left = [np.concatenate(parts) for parts in zip(*pairs, strict=True)]
    before, after = map(rms, left)
    gain = held.likelihood_of(whole) - held.likelihood_of(found.mount)
    worse = any(rms(new) > rms(old) for old, new in pairs)
    interval = interval_of(left[0], left[1], held.protocol.pieces[0].dt)
    proven = gain >= comparison.policy.fair or 1 - (after / before) ** 2 >= comparison.policy.considerable
    refused = worse or not proven or after > (1 - NO_BETTER) * before or interval[0] <= 0
    names = tuple(one.name for one in terms)
    return Learned(whole, effects, names, 0.0, before, after, interval, held.protocol.cutoff, not refused, gain=gain)


def allowed(
    comparison: Comparison, found: Fit, terms: Sequence[CandidateTerm]
) -> tuple[Mount, tuple[LearnedEffect, ...]]:
    """Fit terms that break no rule, with fewer waves where they would: a drive that falls where no row tells."""
    for _ in range(FEWER):
        mount, fit = fitted(comparison, found, terms)
        effects = tuple(one.learned(one.coefficients.tolist()).admitted() for one in fit)
        broken = [bool(effect.broken_rule()) for effect in effects]
        if not any(broken):
            return replace(mount, effects=(*mount.effects, *effects)), effects
        terms = [one.coarser() if fails else one for one, fails in zip(terms, broken, strict=True)]
    return found.mount, ()


def _held_out(held: Prepared, mount: Mount) -> list[Array]:
    """What a model leaves of each held-out recording, by the protocol."""
    left: dict[int, list[Array]] = {number: [] for number in sorted({piece.recording for piece in held.pieces})}
    for one, piece in zip(residuals(held, mount), held.pieces, strict=True):
        left[piece.recording].append(one[piece.inside])
    return [np.concatenate(parts) for parts in left.values()]


def is_recorded(term: CandidateTerm, held: Predictive) -> bool:
    """Whether the held-out recordings have what a term goes over."""
    return all(one.name in piece.extras for one in term.effect.inputs() for piece in held.prepared.pieces)


def _size(comparison: Comparison, learned: Learned) -> float:
    """Half the middle range of the torque that the terms add in training."""
    plain = replace(learned.mount, effects=learned.mount.effects[: -len(learned.effects)])
    with_it, without = (needed(mount, comparison.problem.prepared) for mount in (learned.mount, plain))
    return float(np.ptp(np.quantile(with_it - without, MIDDLE))) / 2
