"""Challenge what was accepted: does each effect still earn its place, and does a rival do as well in it?

Each accepted effect is taken out and the rest refitted. If little is lost, it goes. Its rivals, and whatever the
screening likes in its place, are tried there; a better one takes the place, one that comes close makes the answer a
set.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.diagnosis.candidates import candidates, columns_of
from cosim.diagnosis.fit import Fit, fit
from cosim.diagnosis.prepare import Array, Prepared
from cosim.diagnosis.select import LEAST_GAIN, TIE, Selection, Trial, clearly_worse, degenerate, is_real, judged, tuned
from cosim.diagnosis.structure import Bench, projected
from pyfmi_models.effects import ActuatorLag, Delay, Effect
from pyfmi_models.mount import Mount

ALIKE = 0.4
"""A rival is refitted in an effect's place if its linear gain there reaches this share of the effect's."""
TEMPERATURE = 60.0
"""Divides log-likelihoods before they become probabilities: neighbouring samples are far from independent."""
ROUNDS = 2
NEAR = 0.9
"""A rival with this share of the winner's gain is excluded only if it is clearly worse block by block."""


@dataclass(frozen=True)
class Place:
    """One accepted effect: what it earns beside the others, and who else could stand in its place."""

    effect: Effect
    trial: Trial
    rivals: tuple[Trial, ...]

    @property
    def ambiguous_with(self) -> tuple[str, ...]:
        """Rivals that these recordings cannot exclude."""
        return tuple(rival.effect for rival in self.rivals if _too_close(self.trial, rival))

    @property
    def probability(self) -> float:
        """Tempered posterior of this effect among its rivals and "none", with equal priors."""
        others = [0.0, *(rival.score.nats for rival in self.rivals)]
        weights = np.exp(np.clip((np.array(others) - self.trial.score.nats) / TEMPERATURE, -50, 50))
        return float(1 / (1 + weights.sum()))


@dataclass(frozen=True)
class Verdict:
    """The structure that stands, its places, and the bench they were judged on."""

    base: Fit
    chosen: Fit
    bench: Bench
    places: tuple[Place, ...]
    looked_at: dict[str, Trial]


def _too_close(winner: Trial, rival: Trial) -> bool:
    """Whether a rival cannot be excluded: its gain comes near, and block by block it is not clearly worse."""
    if len(rival.fit.free) > len(winner.fit.free):
        return rival.gain >= winner.gain
    return rival.gain >= NEAR * winner.gain and not clearly_worse(rival, winner)


def challenge(
    selection: Selection,
    mount: Mount,
    prepared: Prepared,
    weight: Array,
    sample_time: float,
    say: Callable[[str], None] = lambda _: None,
) -> Verdict:
    """Delete and swap until nothing changes (at most `ROUNDS` times); see `select` for the arguments."""
    chosen, bench = selection.chosen, selection.bench
    known = len(mount.effects)
    places: list[Place] = []
    for _ in range(ROUNDS):
        added = chosen.mount.effects[known:]
        before = chosen
        places = []
        for effect in added:
            say(effect.title)
            place = _place(effect, chosen, mount, prepared, weight, bench)
            places.append(place)
            best = max((place.trial, *place.rivals), key=lambda trial: trial.gain)
            if place.trial.gain < LEAST_GAIN and not is_real(best, sample_time):
                chosen = _without(chosen, effect, mount, prepared, weight)
                break
            if best is not place.trial and not _simpler_wins(place.trial, best):
                chosen = best.fit
                break
        if chosen is before:
            break
    else:
        added = chosen.mount.effects[known:]
        places = [_place(effect, chosen, mount, prepared, weight, bench) for effect in added]
    return Verdict(selection.base, chosen, bench, tuple(places), selection.looked_at)


def _simpler_wins(holder: Trial, best: Trial) -> bool:
    close = holder.gain >= TIE * best.gain and not clearly_worse(holder, best)
    return close and len(holder.fit.free) < len(best.fit.free)


def _without(chosen: Fit, effect: Effect, mount: Mount, prepared: Prepared, weight: Array) -> Fit:
    rest = tuple(other for other in chosen.mount.effects if other is not effect)
    return fit(replace(chosen.mount, effects=rest), prepared.pieces, weight, mount, evaluations=15)


def _place(
    effect: Effect,
    chosen: Fit,
    mount: Mount,
    prepared: Prepared,
    weight: Array,
    bench: Bench,
) -> Place:
    reduced = _without(chosen, effect, mount, prepared, weight)
    before = bench.energy(reduced)
    own = judged(effect.id, chosen, reduced, before, bench)
    starts = _rivals(effect, reduced, bench, own.gain)
    rivals = [_tried(reduced, start, mount, prepared, weight, bench, before) for start in starts]
    real = [rival for rival in rivals if not degenerate(rival)]
    return Place(effect, own, tuple(sorted(real, key=lambda trial: -trial.gain)))


def _rivals(effect: Effect, reduced: Fit, bench: Bench, gain: float) -> list[Effect]:
    """Starts of the effect's rivals that are worth a nonlinear fit in its place, best member of each."""
    prepared, nuisance = bench.prepared, bench.nuisances
    rest = projected(reduced.residual, np.column_stack([reduced.slopes, nuisance.columns]))
    alike = candidates(reduced.mount, prepared, rest, np.abs(nuisance.level), effect.rivals)
    if not alike:
        return []
    groups = columns_of(reduced.mount, alike, prepared, reduced.values)
    scores = bench.screen(reduced, groups, [candidate.shapes_excluded for candidate in alike])
    best: dict[str, tuple[float, Effect]] = {}
    for candidate, (score, coefficients) in zip(alike, scores, strict=True):
        if score.gain > max(ALIKE * gain, best.get(candidate.effect, (LEAST_GAIN,))[0]):
            best[candidate.effect] = score.gain, candidate.start(coefficients)
    found = [start for _, start in sorted(best.values(), key=lambda item: -item[0])]
    return found + [twin for twin in _twins(effect) if twin.id not in best]


def _twins(effect: Effect) -> list[Effect]:
    """Delay and lag are alike at first order, so a linear score cannot send one of them away."""
    if isinstance(effect, Delay):
        return [ActuatorLag(time_constant_ms=effect.delay_ms)]
    if isinstance(effect, ActuatorLag):
        return [Delay(delay_ms=effect.time_constant_ms)]
    return []


def _tried(
    reduced: Fit, effect: Effect, mount: Mount, prepared: Prepared, weight: Array, bench: Bench, before: Array
) -> Trial:
    grown = replace(reduced.mount, effects=(*reduced.mount.effects, effect))
    found = tuned(fit(grown, prepared.pieces, weight, mount, evaluations=12), prepared, weight, mount)
    return judged(effect.id, found, reduced, before, bench)


def merged(places: Sequence[Place]) -> dict[str, list[Place]]:
    """Group places by effect: the harmonics of one ripple are one effect."""
    groups: dict[str, list[Place]] = {}
    for place in places:
        groups.setdefault(place.effect.id, []).append(place)
    return groups
