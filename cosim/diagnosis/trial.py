"""One effect on trial: fitted together with everything else, and judged on data its fit did not use.

An effect must be significant *and* large enough: lower the cross-validated energy in most blocks and by more than a few
per cent, remove some of the plain residual too, and mean what its name says.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from cosim.diagnosis.candidates import ROOM, Room
from cosim.diagnosis.evidence import Score, t_value
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.meaning import is_another, needs_turns
from cosim.diagnosis.prepare import Array
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.structure import WANDER, Bench
from cosim.diagnosis.tuning import tuned
from pyfmi_models.effects import (
    ActuatorLag,
    ClockEffect,
    Coupling,
    Delay,
    DriveEffect,
    Effect,
)
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.torque_saturation import TorqueSaturation

LEAST_GAIN, LEAST_T = 0.03, 1.8
"""Share of the cross-validated energy, and block t value, that an effect must reach together ..."""
SURE_GAIN = 0.05
"""... or the share that is enough with a t value of 1."""
LEAST_PLAIN_GAIN = 0.02
"""Share of the plain residual energy an effect must remove too: whitened evidence alone can be about nothing."""
TEMPERATURE = 60.0
"""Divides log-likelihoods before they become probabilities: neighbouring samples are far from independent."""
FORETOLD = 0.1
"""Share of the plain residual energy that an effect must foretell of *every* recording left out, where whitened
evidence is too little: whitening and nuisances take what is slow for noise, and few blocks may show what shows clearly.
No effect tried on 48 nulls foretold more than 0.042, whatever it explained of the recordings it was fitted to."""
LEAST_SIZE = WANDER
"""An effect at the axis must remove more torque error than the friction level's wandering makes, relative to it."""
LEAST_SEEN = 1e-3
"""The same for the effects that friction cannot imitate: derivatives of recorded rows are no better. Without any noise
a spring that rings at 100 Hz took 0.0003 of what differences leave; three concealed ones took 0.035 and more."""
LEAST_CHANGES = 0.5
"""Share of the torque's changes from row to row that a model with a delay or a lag must explain: in noise that the
controller answers, time runs otherwise than in the machine."""
LEAST_FREE = 0.1
"""Least share of the rows that is counted as left over by phases."""
CLEARLY = 2.0
TIE = 0.96
"""A simpler effect wins if it reaches this share of the best gain and is not worse by `CLEARLY` standard errors."""
LIMITS = {"torque_offset": ("cable_wrap", "gravity_unbalance")}
"""Effects that others become in a limit (home far away, a short stroke): such a one wins at `TIE` even if it is clearly
worse, as the larger family's further number takes up what the friction law leaves over the stroke."""
UNLIKE_FRICTION = (DriveEffect, ClockEffect, Coupling, PeriodicDisturbance)
"""Effects that a wandering friction level cannot imitate: they change when torque acts, or come by the clock."""


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
    found = tuned(problem, problem.fit(grown, 12), effect)
    return judged(found.mount.effects[-1], found, without, bench)


def judged(effect: Effect, found: Fit, without: Fit, bench: Bench) -> Trial:
    """Judge an effect of a fitted structure against the structure without it."""
    plain = [float(np.sum((bench.weight * one.residual) ** 2)) for one in (found, without)]
    room, level = ROOM.get(effect.id, ""), float(np.sum((bench.weight * bench.nuisances.level) ** 2))
    score = Score(_energy(bench, without, room), _energy(bench, found, room), bench.rows)
    removed = max(plain[1] - plain[0], 0.0)
    size = np.sqrt(removed / level) if level else np.inf
    return Trial(effect, found, score, 1 - plain[0] / plain[1], size, bench.foretold(found, without))


def _energy(bench: Bench, found: Fit, room: Room) -> Array:
    """Cross-validated energy of each block, without what a phase that was found in the fold itself takes of its noise.

    That is as much as a sine and a cosine take, two rows' worth: little in minutes, much in the few rows of a short
    recording, where a tone would be found in any noise.
    """
    taken = 2 * found.phases / float(bench.rows.sum())
    return bench.energy(found, room) / max(1 - taken, LEAST_FREE)


def is_real(problem: Problem, trial: Trial) -> bool:
    """Whether an effect is significant, large enough, and what its name says."""
    if trial.plain_gain < LEAST_PLAIN_GAIN or not is_meant(problem, trial) or not _in_time(problem, trial):
        return False
    if trial.size < (LEAST_SEEN if isinstance(trial.effect, UNLIKE_FRICTION) else LEAST_SIZE):
        return False
    sure = (trial.gain > LEAST_GAIN and trial.t > LEAST_T) or (trial.gain > SURE_GAIN and trial.t > 1)
    return sure or trial.foretold > FORETOLD


def is_meant(problem: Problem, trial: Trial) -> bool:
    """Whether an effect is what its name says, and can be told from this motion."""
    mount = trial.fit.mount
    return not is_another(problem, trial.effect) and not needs_turns(trial.effect, mount, problem.prepared)


def _in_time(problem: Problem, trial: Trial) -> bool:
    """Whether an effect of timing, if it is one, is told by changes of the torque that the model explains.

    Only changes that some motion asks for: at constant speed nothing is asked, what changes is noise and ripple, and
    the torque is what a loop answers.
    """
    if not isinstance(trial.effect, DriveEffect | ClockEffect) or isinstance(trial.effect, TorqueSaturation):
        return True
    pieces = problem.prepared.pieces
    counted = np.concatenate([np.full(len(piece.kept), piece.asked) for piece in pieces]) & (problem.weight > 0)
    owner = problem.prepared.recording_of
    rows = np.flatnonzero(counted[1:] & counted[:-1] & (owner[1:] == owner[:-1]))
    left, all_of_it = (np.diff(one)[rows] for one in (trial.fit.residual, problem.prepared.stacked("tau")))
    return float(left @ left) < (1 - LEAST_CHANGES) * float(all_of_it @ all_of_it)


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
