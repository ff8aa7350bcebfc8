"""Choose the effects: forward one at a time with full refits, backward deletion, swaps among rivals.

An effect is accepted on significance *and* size, both on data its own fit did not use: it must lower the
cross-validated energy in most blocks, and by more than a few per cent; a delay must be longer than the time stamps can
be trusted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim.diagnosis.evidence import Blocks, Score, t_value
from cosim.diagnosis.fit import FIXED, Fit, fit
from cosim.diagnosis.prepare import Array, Prepared
from cosim.diagnosis.structure import Bench, Screening, nuisances, screen
from pyfmi_models.effects import ActuatorLag, Cogging, Delay, Effect, StribeckEffect
from pyfmi_models.mount import Mount

LEAST_GAIN, LEAST_T = 0.03, 1.8
"""Share of the cross-validated energy, and block t value, that an effect must reach together ..."""
SURE_GAIN = 0.05
"""... or the share that is enough with a t value of 1."""
SCREEN_GAIN = 0.004
SCREEN_SHARE = 0.3
"""Least linear gain, alone and relative to the best effect's, that makes an effect worth a nonlinear fit."""
REFINED = 4
"""How many effects are refined by a nonlinear fit in each stage."""
MOST_KINDS, MOST_EFFECTS = 4, 7
"""Different effects, and effects counting each harmonic, that one diagnosis may add."""
LEAST_VS, LEAST_CYCLES = 0.005, 1.5
LEAST_PLAIN_GAIN = 0.02
"""Share of the plain residual energy an effect must remove too: whitened evidence alone can be about nothing."""
WHOLE = 0.01
"""A whole number of cycles is taken if the residual grows by no more than this share."""
CLEARLY = 2.0
TIE = 0.96
"""A rival that reaches this share of the winner's gain is not excluded; a simpler one that does so wins."""


@dataclass(frozen=True)
class Trial:
    """One effect added to (or exchanged in) a structure: the refitted structure and what it earned."""

    effect: str
    fit: Fit
    score: Score
    plain_gain: float
    """Share of the energy of the plain residual removed."""
    top_speed: float

    @property
    def gain(self) -> float:
        """Share of the cross-validated energy removed."""
        return self.score.gain

    @property
    def t(self) -> float:
        """Mean improvement over blocks in units of its standard error."""
        return self.score.t


@dataclass(frozen=True)
class Selection:
    """The chosen structure, how it was reached, and what was looked at."""

    base: Fit
    chosen: Fit
    bench: Bench
    accepted: dict[str, Trial] = field(default_factory=dict)
    rivals: dict[str, list[Trial]] = field(default_factory=dict)
    """For each accepted effect, the rivals tried in its place."""
    looked_at: dict[str, Trial] = field(default_factory=dict)
    """The best trial of each effect that was not accepted."""


def select(
    mount: Mount, prepared: Prepared, weight: Array, sample_time: float, say: Callable[[str], None] = lambda _: None
) -> Selection:
    """Find which effects the recordings demand beside a mount.

    Args:
        mount: the base, as the card has it.
        prepared: the training recordings.
        weight: weight of each kept row in fits.
        sample_time: sample time of the recordings, s.
        say: told what is being tried.
    """
    base = fit(mount, prepared.pieces, weight)
    blocks, current = Blocks.of(prepared), base
    accepted: dict[str, Trial] = {}
    looked_at: dict[str, Trial] = {}
    while True:
        nuisance = nuisances(current, prepared)
        screening = screen(current, prepared, blocks, nuisance, weight)
        bench = screening.bench
        before = bench.energy(current)
        tried = []
        for effect in starts(screening):
            say(effect.title)
            tried.append(_trial(current, effect.id, effect, prepared, weight, bench, before, mount))
        looked_at |= {t.effect: t for t in tried if t.effect not in accepted}
        best = winner([t for t in tried if is_real(t, sample_time)])
        if best is None or _full(best.effect, accepted):
            break
        accepted[_label(best.effect, accepted)] = best
        current = best.fit
    return Selection(base, current, bench, accepted, {}, looked_at)


def starts(screening: Screening) -> list[Effect]:
    """Effects worth a nonlinear fit, strongest first; delay and lag, alike at first order, always come together."""
    least = max(SCREEN_GAIN, SCREEN_SHARE * screening.best[0][1].gain) if screening.best else 0.0
    worth = [candidate.start(k) for candidate, score, k in screening.best[:REFINED] if score.gain >= least]
    for effect in list(worth):
        if isinstance(effect, Delay) and not any(isinstance(other, ActuatorLag) for other in worth):
            worth.append(ActuatorLag(time_constant_ms=effect.delay_ms))
        if isinstance(effect, ActuatorLag) and not any(isinstance(other, Delay) for other in worth):
            worth.append(Delay(delay_ms=effect.time_constant_ms))
    return worth


def _full(effect: str, accepted: dict[str, Trial]) -> bool:
    kinds = {name.rstrip("0123456789") for name in accepted} | {effect}
    return len(kinds) > MOST_KINDS or len(accepted) >= MOST_EFFECTS


def _label(effect: str, accepted: dict[str, Trial]) -> str:
    count = sum(name.rstrip("0123456789") == effect for name in accepted)
    return effect + (str(count + 1) if count else "")


def _trial(
    current: Fit,
    name: str,
    effect: Effect,
    prepared: Prepared,
    weight: Array,
    bench: Bench,
    before: Array,
    prior: Mount,
) -> Trial:
    mount = replace(current.mount, effects=(*current.mount.effects, effect))
    found = tuned(fit(mount, prepared.pieces, weight, prior, evaluations=12), prepared, weight, prior)
    return judged(name, found, current, before, bench)


def judged(name: str, found: Fit, without: Fit, before: Array, bench: Bench) -> Trial:
    """Judge a structure against the one without an effect, whose energies are `before`."""
    plain = [float(np.sum((bench.weight * one.residual) ** 2)) for one in (found, without)]
    score = Score(before, bench.energy(found), bench.rows)
    return Trial(name, found, score, 1 - plain[0] / plain[1], _top(bench.prepared))


def tuned(found: Fit, prepared: Prepared, weight: Array, prior: Mount) -> Fit:
    """Fit the cycles of a periodic effect that was added last, which the grid knows only roughly.

    Slots, teeth and rolling elements come in whole numbers: one that fits as well is taken.
    """
    if getattr(found.mount.effects[-1], "cycles_per_rev", 0.0) <= 0:
        return found
    others = tuple(name for name in FIXED if name != "cycles_per_rev")
    free = fit(found.mount, prepared.pieces, weight, prior, evaluations=10, fixed=others)
    best = min((found, free), key=lambda one: one.rms)
    ripple: Any = best.mount.effects[-1]
    whole = max(1.0, float(round(ripple.cycles_per_rev)))
    for cycles in (whole, ripple.cycles_per_rev):
        effect = replace(ripple, cycles_per_rev=cycles)
        mount = replace(best.mount, effects=(*best.mount.effects[:-1], effect))
        settled = fit(mount, prepared.pieces, weight, prior, evaluations=8)
        if settled.rms < best.rms * (1 + WHOLE):
            return settled
    return found


def _top(prepared: Prepared) -> float:
    return max(abs(edge) for edge in prepared.ranges["v"])


def winner(trials: Sequence[Trial]) -> Trial | None:
    """The trial with the largest gain, or a simpler one that nearly reaches it."""
    if not trials:
        return None
    best = max(trials, key=lambda trial: trial.gain)
    near = [trial for trial in trials if trial.gain >= TIE * best.gain and not clearly_worse(trial, best)]
    return min(near, key=lambda trial: (len(trial.fit.free), -trial.gain))


def clearly_worse(trial: Trial, best: Trial) -> bool:
    """Whether block by block a trial explains less than the best one, by `CLEARLY` standard errors."""
    return t_value(trial.score.rows * np.log(trial.score.after / best.score.after)) > CLEARLY


def is_real(trial: Trial, sample_time: float) -> bool:
    """Significant and large enough; a delay also longer than the time stamps can be trusted."""
    added = trial.fit.mount.effects[-1]
    if isinstance(added, Delay) and added.delay_ms < 1e3 * max(0.3 * sample_time, 1.5e-4):
        return False
    if trial.plain_gain < LEAST_PLAIN_GAIN or degenerate(trial):
        return False
    return (trial.gain > LEAST_GAIN and trial.t > LEAST_T) or (trial.gain > SURE_GAIN and trial.t > 1)


def degenerate(trial: Trial) -> bool:
    """Whether an effect is really another: a Stribeck speed near zero is a level, a ripple once a turn an unbalance."""
    mount, added = trial.fit.mount, trial.fit.mount.effects[-1]
    if isinstance(added, Cogging) and mount.motion == "rotary":
        return bool(added.cycles_per_rev < LEAST_CYCLES)
    return isinstance(added, StribeckEffect) and bool(added.Vs < LEAST_VS * trial.top_speed)
