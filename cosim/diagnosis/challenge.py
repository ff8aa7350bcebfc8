"""Challenge what was accepted: does each effect still earn its place, and does a rival do as well in it?

Each accepted effect is taken out and the rest refitted. If little is lost, it goes. Its rivals are tried in its place;
a better one takes it, one that comes close makes the answer a set.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import log

import numpy as np

from cosim.diagnosis.calibration import calibrated
from cosim.diagnosis.candidates import columns_of
from cosim.diagnosis.families import candidates
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.instruments import DECISIVE, Misfits, excludes, misfits_of, settled
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.result import SPECIAL
from cosim.diagnosis.select import Selection
from cosim.diagnosis.structure import Bench, projected
from cosim.diagnosis.trial import (
    LEAST_GAIN,
    TEMPERATURE,
    TIE,
    Trial,
    clearly_worse,
    is_meant,
    is_real,
    judged,
    simpler_wins,
    tried,
    twins,
)
from pyfmi_models.effects import Effect

ALIKE = 0.4
"""A rival is refitted in an effect's place if its linear gain there reaches this share of the effect's."""
ROUNDS = 3
CREDIBLE = 0.05
"""A rival with a smaller share of the probability is not in the set, which is to hold the truth in 95 % of cases."""
NEAR = 0.9
"""A rival with less than this share of the effect's gain, and clearly worse block by block, is not in it either."""


@dataclass(frozen=True)
class Place:
    """One accepted effect: what it earns beside the others, and who else could stand in its place."""

    effect: Effect
    trial: Trial
    rivals: tuple[Trial, ...]
    misfits: Misfits = field(default_factory=dict)
    """What the set point says of a delay and of a lag, where this is one of them."""

    @property
    def ambiguous_with(self) -> tuple[str, ...]:
        """Rivals that these recordings cannot exclude."""
        return tuple(rival.effect.id for rival in self.rivals if self._is_close(rival))

    def _is_close(self, rival: Trial) -> bool:
        margin = excludes(self.misfits, self.effect, rival.effect)
        if margin is not None:
            return margin < DECISIVE
        far = rival.gain < NEAR * self.trial.gain and clearly_worse(rival, self.trial)
        return self.shares[rival.effect.id] >= CREDIBLE and not far and not self._holds_for(rival)

    def _holds_for(self, rival: Trial) -> bool:
        """Whether this effect is a special case of a rival that explains no more, and foretells no more."""
        special = rival.effect.id in SPECIAL.get(self.effect.id, ())
        return special and self.trial.gain >= TIE * rival.gain and self.trial.foretold >= rival.foretold

    @property
    def more_general(self) -> tuple[Trial, ...]:
        """Rivals that hold this effect as a special case and explain as much, but no more: the simpler one stands."""
        alike = [rival for rival in self.rivals if rival.effect.id in SPECIAL.get(self.effect.id, ())]
        return tuple(r for r in alike if r.gain >= TIE * self.trial.gain and not self._is_close(r))

    @property
    def better(self) -> Trial:
        """The trial that should hold this place: by gain, but between delay and lag the set point decides."""
        demanded = settled(self.misfits, self.trial, self.rivals)
        by_gain = [rival for rival in self.rivals if excludes(self.misfits, self.effect, rival.effect) is None]
        return max((demanded, *by_gain), key=lambda trial: trial.gain) if demanded is self.trial else demanded

    @property
    def favourite(self) -> Trial:
        """The most probable member of the set: it is named first."""
        members = [self.trial, *(rival for rival in self.rivals if self._is_close(rival))]
        return max(members, key=lambda trial: self.shares[trial.effect.id])

    @property
    def probabilities(self) -> dict[str, float]:
        """Calibrated probabilities of the members of the set, together one at most."""
        told = {name: calibrated(self.shares[name]) for name in (self.effect.id, *self.ambiguous_with)}
        return {name: one / max(1.0, sum(told.values())) for name, one in told.items()}

    @property
    def probability(self) -> float:
        """Share of this effect among its rivals and "none"."""
        return self.shares[self.effect.id]

    @property
    def shares(self) -> dict[str, float]:
        """Tempered posterior of this effect and of each rival, "none" being the rest; equal priors.

        A parameter more than this effect has costs what it does in BIC, with as many rows as are independent; where
        the set point speaks of both, its chi-squared is the evidence.
        """
        own = self.trial.log_odds
        odds = np.array([0.0, *(self._log_odds(rival) for rival in self.rivals), -own])
        weights = np.exp(odds - odds.max())
        names = [self.effect.id, *(rival.effect.id for rival in self.rivals)]
        return dict(zip(names, (weights[:-1] / weights.sum()).tolist(), strict=True))

    def _log_odds(self, rival: Trial) -> float:
        """Log-odds of a rival against this effect."""
        margin = excludes(self.misfits, self.effect, rival.effect)
        if margin is not None:
            return -margin / 2
        more = rival.fit.count - self.trial.fit.count
        price = log(max(float(self.trial.score.rows.sum()) / TEMPERATURE, 1.0)) / 2
        return rival.log_odds - self.trial.log_odds - more * price


@dataclass(frozen=True)
class Verdict:
    """The structure that stands, its places, and the bench they were judged on."""

    base: Fit
    chosen: Fit
    bench: Bench
    places: tuple[Place, ...]
    looked_at: dict[str, Trial]


def challenge(problem: Problem, selection: Selection, say: Callable[[str], None] = lambda _: None) -> Verdict:
    """Delete and swap until nothing changes, at most `ROUNDS` times; `say` is told which effect is challenged."""
    chosen, bench = selection.chosen, selection.bench
    for _ in range(ROUNDS):
        places, after = _round(problem, chosen, bench, say)
        if after is None:
            break
        chosen = after
    else:
        places = [_place(problem, effect, chosen, bench) for effect in _added(problem, chosen)]
    return Verdict(selection.base, chosen, bench, tuple(places), selection.looked_at)


def _round(problem: Problem, chosen: Fit, bench: Bench, say: Callable[[str], None]) -> tuple[list[Place], Fit | None]:
    """Challenge each effect; return the places, or the structure after the first change."""
    places = []
    for effect in _added(problem, chosen):
        say(effect.title)
        place = _place(problem, effect, chosen, bench)
        best = place.better
        if place.trial.gain < LEAST_GAIN and not is_real(problem, best):
            return [], _without(problem, chosen, effect)
        if place.shares[best.effect.id] > place.probability and not simpler_wins(place.trial, best):
            return [], best.fit
        places.append(place)
    favourites = [place.favourite for place in places]
    changed = [one for one, place in zip(favourites, places, strict=True) if one is not place.trial]
    return ([], changed[0].fit) if changed else (places, None)


def _added(problem: Problem, chosen: Fit) -> tuple[Effect, ...]:
    return chosen.mount.effects[len(problem.mount.effects) :]


def _without(problem: Problem, chosen: Fit, effect: Effect) -> Fit:
    rest = tuple(other for other in chosen.mount.effects if other is not effect)
    return problem.fit(replace(chosen.mount, effects=rest), 15)


def _place(problem: Problem, effect: Effect, chosen: Fit, bench: Bench) -> Place:
    reduced = _without(problem, chosen, effect)
    own = judged(effect, chosen, reduced, bench)
    rivals = [tried(problem, reduced, start, bench) for start in _rivals(effect, reduced, bench, own.gain)]
    real = [rival for rival in rivals if is_meant(problem, rival)]
    misfits = misfits_of(problem.prepared, chosen.mount, effect) if real else {}
    return Place(effect, own, tuple(sorted(real, key=lambda trial: -trial.gain)), misfits)


def _rivals(effect: Effect, reduced: Fit, bench: Bench, gain: float) -> list[Effect]:
    """Starts of the effect's rivals that are worth a nonlinear fit in its place, best member of each."""
    prepared, nuisance = bench.prepared, bench.nuisances
    rest = projected(reduced.residual, np.column_stack([reduced.slopes, nuisance.columns]))
    alike = candidates(reduced.mount, prepared, rest, np.abs(nuisance.level), effect.rivals)
    if not alike:
        return []
    groups = columns_of(reduced.mount, alike, prepared, reduced.values)
    scores = bench.screen(reduced, alike, groups)
    best: dict[str, tuple[float, Effect]] = {}
    for candidate, (score, coefficients) in zip(alike, scores, strict=True):
        if score.gain > max(ALIKE * gain, best.get(candidate.effect, (LEAST_GAIN,))[0]):
            best[candidate.effect] = score.gain, candidate.start(coefficients)
    found = [start for _, start in sorted(best.values(), key=lambda item: -item[0])]
    return found + [twin for twin in twins(effect) if twin.id not in best]


def merged(places: Sequence[Place]) -> dict[str, list[Place]]:
    """Group places by effect: the harmonics of one ripple are one effect."""
    groups: dict[str, list[Place]] = {}
    for place in places:
        groups.setdefault(place.effect.id, []).append(place)
    return groups
