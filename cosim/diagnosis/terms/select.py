"""Which terms are learned: those that predict recordings they were not fitted to, one after the other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.terms.candidate_terms import CandidateTerm
from cosim.diagnosis.terms.grams import Grams, columns_of, grams_of, with_terms
from cosim.estimation.fit import Fit, with_values
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array
from pyfmi_models.mount import Mount

MOST = 3
"""Terms of one answer: more is a black box."""
STARTS = 2
"""First terms that are followed, of each ranking: more looks at held-out recordings would let luck decide."""
FOLDS = 8
"""Groups of recordings that are left out in turn, where there are more: fewer of them say less, more cost more. Five to
ten are the usual (Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 7.10)."""
ROUNDS = 2
"""Gauss-Newton steps after the linear one: the terms that scale friction are not quite linear."""


@dataclass(frozen=True)
class Path:
    """Terms in the order in which they were chosen, with what each gained in training and on recordings left out."""

    order: tuple[int, ...] = ()
    evidence: tuple[float, ...] = ()
    predicted: tuple[float, ...] = ()

    def longer(self, term: int, evidence: float, predicted: float) -> "Path":
        """The path with one more term."""
        return Path((*self.order, term), (*self.evidence, evidence), (*self.predicted, predicted))

    def first(self, count: int) -> "Path":
        """The path with no more than its first terms."""
        return Path(self.order[:count], self.evidence[:count], self.predicted[:count])


def paths(grams: Grams, candidates: Sequence[int]) -> list[Path]:
    """Choose terms one after the other, each the one that recordings left out gain most by; from several first ones.

    What goes together in training (a place and the temperature there) is told apart by other recordings only: every
    first term that gains nearly as much as the best has a path of its own, and the held-out recordings judge.
    """
    now = _scores(grams, ())
    gains = _gains(grams, candidates, (), now)
    starts = [Path().longer(one, *gains[one]) for one in _near(gains)]
    return [path for start in starts for path in (start, _path(grams, candidates, start))]


def telling(grams: Grams, terms: Sequence[CandidateTerm]) -> list[int]:
    """Terms that may be learned: a table over two quantities must say clearly more than terms over each of them alone.

    Else a column that does nothing goes into the model with the position, over which friction is uneven anywhere.
    """
    every, places = list(range(grams.recordings)), {one.name: k for k, one in enumerate(terms)}

    def tells(which: int, alone: Sequence[int]) -> bool:
        whole, parts = (grams.marginal(chosen, every).log_likelihood for chosen in ([which], alone))
        return whole - parts >= POLICY.clear

    parts = [[places[name] for name in one.parts if name in places] for one in terms]
    return [k for k, alone in enumerate(parts) if not alone or tells(k, alone)]


def begun(found: Sequence[Path]) -> list[Path]:
    """Every path and all its beginnings, each set of terms once."""
    known: dict[frozenset[int], Path] = {}
    for path in found:
        for count in range(1, len(path.order) + 1):
            known.setdefault(frozenset(path.order[:count]), path.first(count))
    return list(known.values())


def _path(grams: Grams, candidates: Sequence[int], found: Path) -> Path:
    for _ in range(1, MOST):
        gains = _gains(grams, candidates, found.order, _scores(grams, found.order))
        proven, large = _ranked(gains)
        ranked = proven or large
        if not ranked:
            break
        best = max(ranked, key=lambda k: ranked[k])
        found = _without_idle(grams, found.longer(best, *gains[best]))
    return found


def _without_idle(grams: Grams, found: Path) -> Path:
    """The path without the term that the last one made idle, if it made one so: it stood for what that one is."""
    whole, _ = _scores(grams, found.order)
    for one in found.order[:-1]:
        rest = tuple(other for other in found.order if other != one)
        if whole - _scores(grams, rest)[0] < POLICY.clear:
            return _along(grams, rest)
    return found


def _along(grams: Grams, order: Sequence[int]) -> Path:
    found = Path()
    for one in order:
        found = found.longer(one, *_gains(grams, [one], found.order, _scores(grams, found.order))[one])
    return found


def _gains(
    grams: Grams, candidates: Sequence[int], chosen: tuple[int, ...], now: tuple[float, float]
) -> dict[int, tuple[float, float]]:
    scores = {one: _scores(grams, (*chosen, one)) for one in candidates if one not in chosen}
    return {one: (here - now[0], there - now[1]) for one, (here, there) in scores.items()}


def _ranked(gains: Mapping[int, tuple[float, float]]) -> tuple[dict[int, float], dict[int, float]]:
    """Terms that may be next: by what recordings left out gain, and by evidence, if no misfit of a law reaches it.

    No recording left out may gain, as each may hold what no other does: another place, temperature, way.
    """
    proven = {k: there for k, (here, there) in gains.items() if here >= POLICY.clear and there >= POLICY.fair}
    return proven, {k: here for k, (here, _) in gains.items() if here >= POLICY.strong}


def _near(gains: Mapping[int, tuple[float, float]]) -> list[int]:
    """The best first terms: by what recordings left out gain, and by evidence."""
    found: list[int] = []
    for ranked in _ranked(gains):
        order = sorted(ranked, key=lambda k: -ranked[k])
        found += [k for k in order if ranked[k] >= POLICY.half * ranked[order[0]]][:STARTS]
    return list(dict.fromkeys(found))


def _scores(grams: Grams, chosen: Sequence[int]) -> tuple[float, float]:
    """Evidence of terms in training, and what each recording says that was left out; one recording alone says both.

    Of many recordings neighbours are left out together: they are the likeliest to resemble each other.
    """
    every = list(range(grams.recordings))
    evidence = grams.marginal(chosen, every).log_likelihood
    if grams.recordings < 2:
        return evidence, evidence
    left = 0.0
    for fold in np.array_split(every, min(FOLDS, len(every))):
        beta = grams.fitted(chosen, [one for one in every if one not in fold])
        left += sum(grams.predicted(chosen, beta, [one]) for one in fold.tolist())
    return evidence, left


def fitted(
    comparison: Comparison, found: Fit, terms: Sequence[CandidateTerm]
) -> tuple[Mount, tuple[CandidateTerm, ...]]:
    """Fit the chosen terms together with the base: Gauss-Newton, the size of each term by marginal likelihood.

    It ends where a step does not lower the error, as from tables so steep that no command gives what is needed.
    """
    weight, terms = comparison.problem.weight, tuple(terms)
    now, best = found, (np.inf, found, terms)
    for _ in range(1 + ROUNDS):
        if not all(one.prior.any() for one in terms):  # nothing is left of a term that may only take energy
            break
        now, terms = _step(comparison, now, terms)
        risen = tuple(map(_rising, terms))
        is_cut = any(one is not other for one, other in zip(terms, risen, strict=True))
        if is_cut:
            now, terms = _at(comparison, now, now.mount, now.values, risen), risen
        error = float(np.linalg.norm(weight * now.residual))
        if not is_cut and error >= best[0]:
            break
        best = (np.inf if is_cut else error), now, terms
    return best[1].mount, best[2]


def _rising(term: CandidateTerm) -> CandidateTerm:
    """A hysteresis without the elements that would give energy."""
    if not term.effect.never_negative or (term.coefficients >= 0).all():
        return term
    values = np.maximum(term.coefficients, 0.0)
    return replace(term, prior=np.where(values > 0, term.prior, 0.0)).with_coefficients(values.tolist())


def _step(comparison: Comparison, now: Fit, terms: tuple[CandidateTerm, ...]) -> tuple[Fit, tuple[CandidateTerm, ...]]:
    """One step: the target is what the base would leave without the terms."""
    columns = [columns_of(now.mount, one, comparison.problem.prepared, terms) for one in terms]
    old = np.concatenate([one.coefficients for one in terms])
    residual = now.residual + np.column_stack(columns) @ old if old.any() else now.residual
    grams = grams_of(comparison, replace(now, residual=residual), columns, terms)
    beta = grams.fitted(range(len(terms)), list(range(grams.recordings)))
    known = {variable.name: variable for variable in now.mount.parameters()}
    edges = [[getattr(known[name], edge) for name in now.free] for edge in ("low", "high")]
    values = np.clip(now.values + beta[: len(now.values)], *map(np.array, edges))
    new = _spread(beta[len(now.values) :] * grams.unit, terms)
    mount = with_values(now.mount, now.free, values)
    terms = tuple(one.with_coefficients(c.tolist()) for one, c in zip(terms, new, strict=True))
    return _at(comparison, now, mount, values, terms), terms


def _at(comparison: Comparison, now: Fit, mount: Mount, values: Array, terms: Sequence[CandidateTerm]) -> Fit:
    """A fit of the base at other numbers, beside terms."""
    whole, _ = with_terms(mount, terms)
    prepared = comparison.problem.prepared
    torque, slopes = stacked(Inverse(whole, now.free), prepared.pieces, values)
    left = prepared.stacked("tau") - torque
    return replace(now, mount=mount, values=values, torque=torque, slopes=slopes, residual=left)


def _spread(values: Array, terms: Sequence[CandidateTerm]) -> list[Array]:
    """Coefficients of each term, zero where the base holds the wave already."""
    out, first = [], 0
    for one in terms:
        own, free = np.zeros(one.count), one.prior > 0
        last = first + int(free.sum())
        own[free], first = values[first:last], last
        out.append(own)
    return out
