"""One effect on trial: fitted together with everything else, and judged on data its fit did not use.

An effect must be significant *and* large enough: lower the cross-validated energy in most blocks and by more than a few
per cent, remove some of the plain residual too, and mean what its name says.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log
from typing import Any

import numpy as np

from cosim.diagnosis.candidates import ROOM
from cosim.diagnosis.evidence import Score, t_value
from cosim.diagnosis.fit import FIXED, LEAST_VS, Fit, fit
from cosim.diagnosis.lateness import blamed
from cosim.diagnosis.prepare import Array, Prepared
from cosim.diagnosis.shaken import heard
from cosim.diagnosis.structure import WANDER, Bench
from pyfmi_models.effects import (
    ActuatorLag,
    ClockEffect,
    Cogging,
    Coupling,
    Delay,
    DriveEffect,
    Effect,
    StribeckEffect,
)
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.model import parameters_of
from pyfmi_models.mount import Mount

LEAST_GAIN, LEAST_T = 0.03, 1.8
"""Share of the cross-validated energy, and block t value, that an effect must reach together ..."""
SURE_GAIN = 0.05
"""... or the share that is enough with a t value of 1."""
LEAST_PLAIN_GAIN = 0.02
"""Share of the plain residual energy an effect must remove too: whitened evidence alone can be about nothing."""
TEMPERATURE = 60.0
"""Divides log-likelihoods before they become probabilities: neighbouring samples are far from independent."""
FORETOLD = 0.2
"""Share of the plain residual energy that an effect must foretell of *every* recording left out, where whitened
evidence is too little: whitening and nuisances take what is slow for noise. No effect tried on 30 nulls foretold more
than a few per cent, whatever it explained of the recordings it was fitted to."""
LEAST_SIZE = WANDER
"""An effect at the axis must remove more torque error than the friction level's wandering makes, relative to it."""
LEAST_DELAY_SAMPLES, LEAST_DELAY = 0.3, 1.5e-4
"""A delay shorter than this many samples, or seconds, is what time stamps cannot be trusted for."""
LEAST_DRIFT_MS, LEAST_DRIFT = 1.0, 0.3
"""A clock that drifts by less than this, or than this share of its offset, over a recording is late like a delay."""
LEAST_CYCLES = 1.5
"""A ripple with fewer cycles a turn is an unbalance."""
WHOLE = 0.01
"""A whole number of cycles is taken if the residual grows by no more than this share."""
SHARP = 1.0
"""Exponent of the Stribeck curve of Bo and Pavelescu (Wear 82, 1982); that of Armstrong-Helouvry is 2."""
SOFTER = (4.0, 16.0)
"""How many times softer than the start a bending contact is tried."""
LEAST_CHANGES = 0.5
"""Share of the torque's changes from row to row that a model with a delay or a lag must explain: in noise that the
controller answers, time runs otherwise than in the machine."""
CLEARLY = 2.0
TIE = 0.96
"""A simpler effect wins if it reaches this share of the best gain and is not worse by `CLEARLY` standard errors."""
LIMITS = {"torque_offset": ("cable_wrap", "gravity_unbalance")}
"""Effects that others become in a limit (home far away, a short stroke): such a one wins at `TIE` even if it is clearly
worse, as the larger family's further number takes up what the friction law leaves over the stroke."""
BESIDE = 1.0
"""A cable whose home lies further beside the visited positions than this share of their range is an offset: of its
energy its change over the range has less than about 1 - `TIE`."""
UNLIKE_FRICTION = (DriveEffect, ClockEffect, Coupling, PeriodicDisturbance)
"""Effects that a wandering friction level cannot imitate: they change when torque acts, or come by the clock."""


@dataclass(frozen=True)
class Problem:
    """What all fits of a diagnosis share: the base as in the card, the training data, the weight of each kept row."""

    mount: Mount
    prepared: Prepared
    weight: Array
    sample_time: float

    @property
    def seconds(self) -> float:
        """Length of the longest piece of a recording."""
        return max(float(piece.t[-1] - piece.t[0]) for piece in self.prepared.pieces)

    @property
    def top_speed(self) -> float:
        """Highest speed that was recorded."""
        return max(abs(edge) for edge in self.prepared.ranges["v"])

    def fit(self, mount: Mount, evaluations: int, fixed: Sequence[str] = FIXED) -> Fit:
        """Fit a structure, its base held weakly to the card."""
        return fit(mount, self.prepared.pieces, self.weight, self.mount, evaluations, fixed=fixed)


@dataclass(frozen=True)
class Trial:
    """A structure with one effect more: its fit, and what the effect earned."""

    effect: Effect
    fit: Fit
    score: Score
    plain_gain: float
    """Share of the energy of the plain residual removed."""
    size: float
    """RMS of the torque error removed, relative to the RMS of the friction level."""
    foretold: float = 0.0
    """Least share of the plain residual energy of a recording left out that is foretold."""

    @property
    def gain(self) -> float:
        """Share of the cross-validated energy removed; of the plain energy, where only that shows the effect."""
        return self.foretold if self.is_slow else self.score.gain

    @property
    def is_slow(self) -> bool:
        """Whether only the plain residual shows the effect, in every recording."""
        return self.score.gain < LEAST_GAIN and self.foretold > FORETOLD

    @property
    def log_odds(self) -> float:
        """Log-odds against nothing being there: tempered log-likelihood, or that of the blocks as single rows."""
        if self.is_slow:
            return -len(self.score.rows) / 2 * log(1 - self.foretold)
        return self.score.nats / TEMPERATURE

    @property
    def t(self) -> float:
        """Mean improvement over blocks in units of its standard error."""
        return self.score.t


def tried(problem: Problem, without: Fit, effect: Effect, bench: Bench) -> Trial:
    """Add an effect to a fitted structure, refit everything, and judge it."""
    grown = replace(without.mount, effects=(*without.mount.effects, effect))
    found = _tuned(problem, problem.fit(grown, 12), effect)
    return judged(found.mount.effects[-1], found, without, bench)


def judged(effect: Effect, found: Fit, without: Fit, bench: Bench) -> Trial:
    """Judge an effect of a fitted structure against the structure without it."""
    plain = [float(np.sum((bench.weight * one.residual) ** 2)) for one in (found, without)]
    room, level = ROOM.get(effect.id, ""), float(np.sum((bench.weight * bench.nuisances.level) ** 2))
    score = Score(bench.energy(without, room), bench.energy(found, room), bench.rows)
    removed = max(plain[1] - plain[0], 0.0)
    size = np.sqrt(removed / level) if level else np.inf
    return Trial(effect, found, score, 1 - plain[0] / plain[1], size, bench.foretold(found, without))


def _tuned(problem: Problem, found: Fit, start: Effect) -> Fit:
    """Fit what its grid knows only roughly of an effect that was added last: cycles, how a cable hardens, a shape."""
    added: Any = found.mount.effects[-1]
    if isinstance(added, CableWrap):
        return problem.fit(_freed(problem, found, "hardening").mount, 4)
    if isinstance(added, StribeckEffect):
        return _shaped(problem, found)
    if isinstance(start, Presliding):
        return _softened(problem, found, start)
    return _in_cycles(problem, found) if getattr(added, "cycles_per_rev", 0.0) > 0 else found


def _shaped(problem: Problem, found: Fit) -> Fit:
    """Try the sharper Stribeck curve of the literature too, and any shape if that fits clearly better."""
    gauss: Any = found.mount.effects[-1]
    sharper = replace(found.mount, effects=(*found.mount.effects[:-1], replace(gauss, delta=SHARP)))
    best = min((found, problem.fit(sharper, 12)), key=lambda one: one.rms)
    free = _freed(problem, best, "delta")
    return free if free.rms * (1 + WHOLE) < best.rms and not _at_bound(free.mount.effects[-1]) else best


def _softened(problem: Problem, found: Fit, start: Presliding) -> Fit:
    """Try softer contacts too: the start is known to an order of magnitude at most, and a stiff one stays stiff."""
    others = [replace(start, sigma0=start.sigma0 / softer) for softer in SOFTER]
    tried = [problem.fit(replace(found.mount, effects=(*found.mount.effects[:-1], one)), 12) for one in others]
    return min((found, *tried), key=lambda one: one.rms)


def _in_cycles(problem: Problem, found: Fit) -> Fit:
    """Fit the cycles of a ripple; slots, teeth and rolling elements come in whole numbers: one that fits is taken."""
    free = _freed(problem, found, "cycles_per_rev")
    best = min((found, free), key=lambda one: one.rms)
    ripple: Any = best.mount.effects[-1]
    for cycles in (max(1.0, float(round(ripple.cycles_per_rev))), ripple.cycles_per_rev):
        effects = (*best.mount.effects[:-1], replace(ripple, cycles_per_rev=cycles))
        settled = problem.fit(replace(best.mount, effects=effects), 8)
        if settled.rms < best.rms * (1 + WHOLE):
            return settled
    return found


def _freed(problem: Problem, found: Fit, name: str) -> Fit:
    return problem.fit(found.mount, 10, [fixed for fixed in FIXED if fixed != name])


def is_real(problem: Problem, trial: Trial) -> bool:
    """Whether an effect is significant, large enough, and what its name says."""
    if trial.plain_gain < LEAST_PLAIN_GAIN or is_another(problem, trial.effect) or not _in_time(problem, trial):
        return False
    if trial.size < LEAST_SIZE and not isinstance(trial.effect, UNLIKE_FRICTION):
        return False
    sure = (trial.gain > LEAST_GAIN and trial.t > LEAST_T) or (trial.gain > SURE_GAIN and trial.t > 1)
    return sure or trial.foretold > FORETOLD


def _in_time(problem: Problem, trial: Trial) -> bool:
    """Whether an effect of timing, if it is one, is told by changes of the torque that the model explains.

    Only changes that some motion asks for: at constant speed nothing is asked, what changes is noise and ripple, and
    the torque is what a loop answers.
    """
    if not isinstance(trial.effect, DriveEffect | ClockEffect):
        return True
    pieces = problem.prepared.pieces
    counted = np.concatenate([np.full(len(piece.kept), piece.asked) for piece in pieces]) & (problem.weight > 0)
    owner = problem.prepared.recording_of
    rows = np.flatnonzero(counted[1:] & counted[:-1] & (owner[1:] == owner[:-1]))
    left, all_of_it = (np.diff(one)[rows] for one in (trial.fit.residual, problem.prepared.stacked("tau")))
    return float(left @ left) < (1 - LEAST_CHANGES) * float(all_of_it @ all_of_it)


def is_another(problem: Problem, effect: Effect) -> bool:
    """Whether an effect is really something else: a time-stamp convention, a level, an unbalance, a drift; or at a
    bound, or what no card may hold.
    """
    if effect.broken_rule() or _at_bound(effect):
        return True
    if isinstance(effect, DriveEffect | ClockEffect):
        return _is_other_timing(problem, effect)
    if isinstance(effect, PeriodicDisturbance):
        slowest, fastest = heard(problem.prepared)
        return not bool(slowest <= effect.frequency_hz <= fastest)
    if isinstance(effect, CableWrap):
        return _is_far(problem.prepared, effect)
    if isinstance(effect, Cogging) and problem.mount.motion == "rotary":
        return bool(effect.cycles_per_rev < LEAST_CYCLES)
    return isinstance(effect, StribeckEffect) and bool(effect.Vs < LEAST_VS * problem.top_speed)


def _is_far(prepared: Prepared, cable: CableWrap) -> bool:
    low, high = prepared.ranges["q"]
    room = BESIDE * (high - low)
    return not low - room <= float(cable.home) <= high + room


def _is_other_timing(problem: Problem, effect: Effect) -> bool:
    """Whether a lateness is too short to be told from the time stamps', or lies in the clocks and not in the drive."""
    if isinstance(effect, Delay) and effect.delay_ms < 1e3 * max(
        LEAST_DELAY_SAMPLES * problem.sample_time, LEAST_DELAY
    ):
        return True
    late = _late(problem, effect)
    if late is None:
        return False
    return blamed(problem.prepared, late, problem.sample_time) == (
        "drive" if isinstance(effect, ClockSkew) else "clock"
    )


def _late(problem: Problem, effect: Effect) -> float | None:
    """Seconds by which an effect makes the torque late against the reading; None if it is not late.

    Of a clock that drifts it is the middle of a recording that counts, if late by a sample at least.
    """
    if isinstance(effect, Delay):
        return 1e-3 * float(effect.delay_ms)
    if isinstance(effect, ActuatorLag):
        return 1e-3 * float(effect.time_constant_ms)
    if not isinstance(effect, ClockSkew):
        return None
    offset, drift = float(effect.offset_ms), 1e-3 * float(effect.drift_ppm) * problem.seconds
    steady = abs(drift) < max(LEAST_DRIFT_MS, LEAST_DRIFT * abs(offset))
    late = -1e-3 * (offset + drift / 2)
    return late if late > (0 if steady else problem.sample_time) else None


def _at_bound(effect: Effect) -> bool:
    return any(variable.start >= variable.high for variable in parameters_of(effect))


def winner(trials: Sequence[Trial]) -> Trial | None:
    """The trial with the largest gain, or a simpler one that nearly reaches it."""
    if not trials:
        return None
    best = max(trials, key=lambda trial: trial.gain)
    near = [best, *(trial for trial in trials if simpler_wins(trial, best))]
    return min(near, key=lambda trial: (trial.fit.count, -trial.gain))


def simpler_wins(trial: Trial, best: Trial) -> bool:
    """Whether a trial with fewer parameters explains as much as the best one, as far as that can be said."""
    if trial.fit.count >= best.fit.count or trial.gain < TIE * best.gain:
        return False
    return best.effect.id in LIMITS.get(trial.effect.id, ()) or not clearly_worse(trial, best)


def clearly_worse(trial: Trial, best: Trial) -> bool:
    """Whether block by block a trial explains less than the best one, by `CLEARLY` standard errors."""
    return t_value(trial.score.rows * np.log(trial.score.after / best.score.after)) > CLEARLY


def twins(effect: Effect) -> list[Effect]:
    """Delay and lag are alike at first order: where one is tried, the other must be, whatever a linear score says."""
    if isinstance(effect, Delay):
        return [ActuatorLag(time_constant_ms=effect.delay_ms)]
    if isinstance(effect, ActuatorLag):
        return [Delay(delay_ms=effect.time_constant_ms)]
    return []
