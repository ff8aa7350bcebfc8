"""What is left, and what it follows: smooth shapes of recorded quantities that are no effect of the catalogue."""

import numpy as np

from cosim.diagnosis.answer.scores import TermScores
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.candidate_terms import LEVEL
from cosim.diagnosis.terms.dictionary import OF_LAW, Term, dictionary
from cosim.estimation.fit import Fit
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import Array
from cosim.support.statistics import rms


def flexible_terms(comparison: Comparison, found: Fit, held: Predictive) -> list[TermScores]:
    """Score all terms of the dictionary that the held-out recordings have too beside a structure, best first."""
    there = set.intersection(*(set(piece.extras) for piece in held.prepared.pieces))
    here = set.intersection(*(set(piece.extras) for piece in comparison.problem.prepared.pieces)) - {"q_d", "v"}
    residual, slopes = held.residual(found.mount), held.slopes(found)
    terms = dictionary(comparison.problem.prepared)
    missing = {name for column in here - there for name in (column, f"position and {column}")}
    looked_at = {name: term for name, term in terms.items() if name not in (*missing, *OF_LAW)}
    scored = [_scored(comparison, found, name, term, held, residual, slopes) for name, term in looked_at.items()]
    return sorted(scored, key=lambda one: -one.evidence)


def _scored(
    comparison: Comparison, found: Fit, name: str, term: Term, held: Predictive, residual: Array, slopes: Array
) -> TermScores:
    columns = term.columns(comparison.problem.prepared)
    evidence, beta = comparison.group(found, columns)
    uneven = _uneven(comparison, columns @ beta) if name == LEVEL else None
    after = residual - term.columns(held.prepared) @ beta
    # The base was bent to what is missing in training, so its own parameters are free beside what is predicted.
    left = projected(np.column_stack([residual, after]) * held.weight[:, None], slopes * held.weight[:, None])
    before, now = (left**2).sum(0)
    return TermScores(name, evidence, 1 - float(now) / max(float(before), 1e-300), uneven)


def _uneven(comparison: Comparison, torque: Array) -> float:
    """Torque of a term of the friction level, relative to that level, both RMS over the rows that count."""
    counted = comparison.problem.weight > 0
    return rms(torque[counted]) / max(rms(comparison.nuisances.level[counted]), 1e-300)
