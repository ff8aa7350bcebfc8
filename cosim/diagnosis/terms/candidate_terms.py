"""Terms that may be learned: effects of the catalogue whose coefficients are parameters, zero to begin with.

So the columns that a term adds are the exact derivatives of the plant's own equations, behind springs, drives and
clocks as well, and the equation that is fitted is the one that is delivered. Sizes of the waves fall with their number:
a coefficient of wave k has a prior of 1/k beside the size of its term, that of a random walk over the range.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from math import pi
from typing import Any

import numpy as np

from cosim.diagnosis.terms.dictionary import FEW, followed, user_columns
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models.effects.learned import LearnedFriction, LearnedTorque, LearnedViscous
from pyfmi_models.effects.learned_base import LearnedEffect, with_free_coefficients
from pyfmi_models.effects.learned_drive import LearnedDrive, LearnedGain
from pyfmi_models.effects.learned_memory import LearnedAfterReversal, LearnedHysteresis
from pyfmi_models.mount import Mount
from pyfmi_models.waves import INPUT

WAVES = 12
"""Waves over a range: a bump of a tenth of it is still drawn."""
FINE = 32
"""Waves over position of a torque constant: 16 periods over the range, as magnets and teeth come many times a turn."""
OVER_WAY = 8
"""Waves over the way travelled: one fades over a tenth of it or longer."""
STROKES = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Ways of a long hysteresis, in ranges of position."""
WAYS = (0.003, 0.01, 0.03, 0.1)
"""Ways over which a reversal is forgotten, in ranges of position."""
TIMES = (0.1, 0.2, 0.4, 0.8, 1.6)
"""Times [s] in which a reversal is forgotten."""
LEVEL = "friction level over position"
"""Name of the term of a friction level that is not the same everywhere."""
CREEP = 1e-3
"""Share of the top speed below which no direction is told."""


@dataclass(frozen=True)
class CandidateTerm:
    """A term that may be learned: plain name, an effect with free coefficients, and the prior size of each."""

    name: str
    effect: LearnedEffect
    prior: Array
    """Of each coefficient, relative; 0 for one that the base holds already."""
    parts: tuple[str, ...] = ()
    """Terms over one of its quantities alone, which it holds: it must say clearly more than they do."""

    @property
    def count(self) -> int:
        """How many coefficients."""
        return len(self.prior)

    @property
    def in_torque(self) -> bool:
        """Whether the coefficients are torques; else they are shares of the friction level."""
        return self.effect.in_torque

    @property
    def coefficients(self) -> Array:
        """Present coefficients."""
        return np.array([getattr(self.effect, f"c{k}") for k in range(self.count)])

    def coarser(self) -> "CandidateTerm":
        """The same with half of the waves."""
        kept = np.flatnonzero(self.prior)
        prior = self.prior.copy()
        prior[kept[len(kept) // 2 :]] = 0.0
        return replace(self, prior=prior).with_coefficients([0.0] * self.count)

    def with_coefficients(self, values: Sequence[float]) -> "CandidateTerm":
        """The same at other coefficients."""
        return replace(self, effect=replace(self.effect, **{f"c{k}": float(c) for k, c in enumerate(values)}))

    def learned(self, values: Sequence[float]) -> LearnedEffect:
        """The effect as a card holds it."""
        form: Any = type(self.effect).__mro__[1]
        known = {one.name: getattr(self.effect, one.name) for one in fields(form)}
        made: LearnedEffect = form(**(known | {form.filled: tuple(map(float, values))}))
        return made


def _term(name: str, form: type[LearnedEffect], prior: Sequence[float], **shape: Any) -> CandidateTerm:
    return CandidateTerm(name, with_free_coefficients(form, len(prior))(**shape), np.asarray(prior, float))


def candidate_terms(mount: Mount, prepared: Prepared) -> list[CandidateTerm]:
    """Every term that these recordings could tell."""
    return [*_of_motion(mount, prepared), *_of_columns(mount, prepared)]


def _falling(count: int, first: float = 1.0) -> list[float]:
    """Prior sizes of waves 0 to `count`."""
    return [first, *(1 / k for k in range(1, count + 1))]


def _of_motion(mount: Mount, prepared: Prepared) -> Iterator[CandidateTerm]:
    q, v = prepared.ranges["q"], prepared.ranges["v"]
    reach, top = q[1] - q[0], max(map(abs, v))
    command = float(np.abs(prepared.stacked("tau")).max())
    rubs = mount.friction.key != "none"
    smooth = [1.0, *(1 / k**2 for k in range(1, WAVES + 1))]  # steeper than its command no drive may fall
    yield _term("torque", LearnedDrive, smooth, command_seen=(-command, command))
    if rubs:
        yield _term("speed", LearnedFriction, _falling(WAVES, 0), over="speed", seen=v)
        yield _term("time since reversal", LearnedAfterReversal, [1.0] * len(TIMES), times=TIMES, creep=CREEP * top)
        level = _falling(WAVES, 0)
        way, a = ranges_of("way", prepared), ranges_of("acceleration", prepared)  # what a state follows
        yield _term("way travelled", LearnedFriction, _falling(OVER_WAY, 0), over="way", seen=way)
        yield _term("speed and acceleration", LearnedViscous, level, over="acceleration", seen=a, at_speed=top)
    if not prepared.has_position:
        return
    yield _term("position", LearnedTorque, _falling(WAVES), over="position", seen=q)
    strokes, ways = (tuple(reach * one for one in shares) for shares in (STROKES, WAYS))
    yield _term("hysteresis over a long stroke", LearnedHysteresis, [1.0] * len(strokes), strokes=strokes)
    if mount.motion == "rotary" and reach > 2 * pi:
        pairs = [one for one in _falling(WAVES)[1:] for _ in ("cosine", "sine")]
        yield _term("position over the turn", LearnedTorque, [1.0, *pairs], over="turn")
        yield _term("torque and position", LearnedGain, [0.0, *pairs], over="turn")
    else:
        yield _term("torque and position", LearnedGain, _falling(FINE, 0), over="position", seen=q)
    if rubs:
        yield _term("speed and position", LearnedViscous, level, over="position", seen=q, at_speed=top)
        yield _term(LEVEL, LearnedFriction, level, over="position", seen=q)
        after = {"ways": ways, "creep": CREEP * top}
        yield _term("distance since reversal", LearnedAfterReversal, [1.0] * len(ways), **after)


def ranges_of(name: str, prepared: Prepared) -> tuple[float, float]:
    """Least and largest value of a quantity that is followed, at rows that count: a state needs time to begin with."""
    found = np.concatenate([followed(name, piece)[piece.kept] for piece in prepared.pieces])
    return float(found.min()), float(found.max())


def _of_columns(mount: Mount, prepared: Prepared) -> Iterator[CandidateTerm]:
    rubs, top = mount.friction.key != "none", max(map(abs, prepared.ranges["v"]))
    for name in user_columns(prepared):
        whole = np.concatenate([piece.extras[name] for piece in prepared.pieces])
        seen = (float(whole.min()), float(whole.max()))
        over = name if name == "temperature" else INPUT + name
        if not seen[0] < seen[1] or not (name.isidentifier() and name.isascii()):
            continue
        few = resolved(FEW, whole)
        yield _term(f"torque over {name}", LearnedTorque, _falling(few), over=over, seen=seen)
        yield _term(f"torque and {name}", LearnedGain, _falling(few, 0), over=over, seen=seen)
        if rubs:
            yield _term(f"friction level over {name}", LearnedFriction, _falling(few, 0), over=over, seen=seen)
            yield _term(f"speed and {name}", LearnedViscous, _falling(few, 0), over=over, seen=seen, at_speed=top)
            if prepared.has_position:
                waves = FEW, resolved(FEW // 2, whole)
                sizes = [a * b for a, b in product(_falling(FEW), _falling(waves[1]))]
                shape = {"over": "position", "seen": prepared.ranges["q"], "by": over, "by_seen": seen, "waves": waves}
                found = _term(f"position and {name}", LearnedFriction, [0.0, *sizes[1:]], **shape)
                yield replace(found, parts=(LEVEL, f"friction level over {name}"))


def resolved(most: int, values: Array) -> int:
    """How many waves the values of a column tell: a wave that fits into the widest gap between them is told by none.

    Two nights at two temperatures tell a rise from one to the other, and no bend between.
    """
    gap = float(np.diff(np.sort(values)).max() / np.ptp(values))
    return max(1, min(most, int(1 / gap)))
