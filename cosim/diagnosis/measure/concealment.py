"""Conceal an effect in recordings, at a size, and weigh what the search would find of it.

    r' = r + D w        D: columns of the effect, derivatives of the torque that the recorded motion needs

A machine with the effect needs D w more torque for the same motion, so r' is what the same structure would have left of
its recordings: exactly where the effect is linear in its size, to first order elsewhere. Evidence is quadratic in r, so
Gram matrices of r, of the structure's tangents, of the nuisances and of all columns are made once; a size costs two
small factorisations.

Of each effect some members are concealed all over its range, and the ways each may lie: which says its hypothesis
(`Hypothesis.concealed`). What comes with a phase is concealed in four of them, what may have either sign in both, and a
tone, which has a phase of its own in each recording, twice at random.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from cosim.diagnosis.effects import HYPOTHESES, hypothesis_of
from cosim.diagnosis.effects.candidates import Candidate, Span, columns_of
from cosim.diagnosis.evidence.comparison import Comparison, aside_for
from cosim.diagnosis.evidence.marginal import ROUNDS, Group, Marginal, marginal
from cosim.diagnosis.search.admissibility import is_degenerate, needs_turns
from cosim.diagnosis.search.stages import least
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.support.statistics import column_rms, rms
from pyfmi_models.effects import Effect
from pyfmi_models.model import parameters_of
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Hidden:
    """Where an effect's columns are, by number, and how it is looked for."""

    effect: str
    columns: Any
    prior: Array
    """How large coefficients may be (one standard deviation)."""
    price: float
    """Nats that the search for it costs."""
    must_stand_out: bool = False
    """Whether it must remove more energy than the noise of the reading holds."""


@dataclass(frozen=True)
class Worth:
    """What is found of a concealed effect."""

    evidence: float
    """Nats, search priced."""
    plain: float
    """Share of the plain residual energy."""
    above_noise: float
    """Energy in that of the reading's noise."""


class Concealment:
    """Concealing columns of effects in what a fitted structure leaves."""

    def __init__(self, comparison: Comparison, found: Fit, columns: Sequence[Array], largest: float = 0.0) -> None:
        self._comparison, self._found, self._largest = comparison, found, largest
        nuisances = comparison.nuisances.columns
        self._own, self._many = 1 + found.slopes.shape[1], nuisances.shape[1]
        stacked = np.column_stack([found.residual, found.slopes, nuisances, *columns])
        self._grams = comparison.bands.grams(comparison.bands.transform(stacked))
        weight = comparison.problem.weight[:, None]
        slopes = found.slopes * weight
        basis, _ = np.linalg.qr(slopes / (np.sqrt((slopes**2).sum(0)) + 1e-300))
        own = np.column_stack([found.residual, *columns]) * weight
        own = own - basis @ (basis.T @ own)
        self._plain = np.asarray(own.T @ own)  # beyond the tangents of the structure, in N2 m2 over the rows
        self._before: dict[str, Marginal] = {}

    def energy(self, hidden: Hidden, weights: Array) -> float:
        """Share of the plain energy that concealing adds, relative to what is left now."""
        place = 1 + hidden.columns
        added = weights @ self._plain[np.ix_(place, place)] @ weights
        return float(added) / max(float(self._plain[0, 0]), 1e-300)

    def worth(self, hidden: Hidden, weights: Array) -> Worth:
        """Conceal an effect with these coefficients and weigh what is found of it."""
        base, groups = self._base(hidden.effect)
        place = self._own + self._many + hidden.columns
        grams = _concealed(self._grams, place, weights)
        now = self._marginal(grams, base, groups, np.zeros(0), self._start(hidden.effect, base, groups))
        after = self._marginal(grams, np.concatenate([base, place]), groups, hidden.prior, now)
        evidence = after.log_likelihood - now.log_likelihood - hidden.price
        tangents = np.arange(1, self._own)
        removed = _energy(grams.sum(0), tangents) - _energy(grams.sum(0), np.concatenate([tangents, place]))
        noise = float(self._comparison.floor @ self._comparison.bands.count)
        return Worth(evidence, self._plain_share(hidden, weights), removed / max(noise, 1e-300))

    def is_found(self, hidden: Hidden, weights: Array) -> bool:
        """Whether the search would add the concealed effect: its rules of evidence and of size."""
        worth, policy = self.worth(hidden, weights), self._comparison.policy
        enough = worth.evidence >= least(policy, self._largest, worth.plain) and worth.plain >= policy.negligible
        large = worth.plain >= policy.small or worth.evidence >= policy.sure
        loud = not hidden.must_stand_out or worth.above_noise >= policy.least_above_noise
        return enough and large and loud

    def _plain_share(self, hidden: Hidden, weights: Array) -> float:
        place = 1 + hidden.columns
        plain = _concealed(self._plain[None], place, weights)[0]
        towards = plain[place, 0]
        beta = np.linalg.lstsq(plain[np.ix_(place, place)], towards, rcond=1e-9)[0]
        return float(beta @ towards) / max(float(plain[0, 0]), 1e-300)

    def _base(self, effect: str) -> tuple[Any, list[Group]]:
        """Numbers of residual, tangents and the nuisances that stay beside an effect, and the groups of the latter."""
        aside, nuisances = aside_for(effect), self._comparison.nuisances
        kept = [self._own + k for group in nuisances.groups if group.name not in aside for k in group.columns]
        groups = nuisances.groups_at(self._own - 1, aside)
        return np.array([*range(self._own), *kept]), groups

    def _start(self, effect: str, base: Any, groups: list[Group]) -> Marginal:
        """The marginal likelihood with nothing concealed."""
        key = ",".join(sorted(aside_for(effect)))
        if key not in self._before:
            self._before[key] = self._marginal(self._grams, base, groups, np.zeros(0), None)
        return self._before[key]

    def _marginal(self, grams: Array, rows: Any, groups: list[Group], prior: Array, start: Marginal | None) -> Marginal:
        bands, free = self._comparison.bands, self._comparison.free(self._found, len(rows) - 1)
        free[len(free) - len(prior) :] = prior
        chosen = grams[:, rows][:, :, rows]
        rounds = {} if start is None else {"rounds": ROUNDS // 2}  # noise and sizes start from the recordings' own
        return marginal(chosen, free, groups, bands.count, bands.effective, self._comparison.floor, start, **rounds)


def _concealed(grams: Array, place: Any, weights: Array) -> Array:
    """Gram matrices once columns at `place`, times weights, are added to the first column."""
    out = grams.copy()
    cross = grams[:, :, place] @ weights
    own = grams[:, 0, 0] + 2 * cross[:, 0] + cross[:, place] @ weights
    out[:, 0, :] += cross
    out[:, :, 0] = out[:, 0, :]
    out[:, 0, 0] = own
    return np.asarray(out)


def _energy(gram: Array, rows: Any) -> float:
    """Energy of the first column that least squares on some others leaves."""
    towards = gram[rows, 0]
    return float(gram[0, 0] - towards @ np.linalg.lstsq(gram[np.ix_(rows, rows)], towards, rcond=1e-12)[0])


MOST_TORQUE = 10.0
"""Times the torque's RMS that no effect can be that is a torque."""


@dataclass(frozen=True)
class Member:
    """One member of a kind of effects."""

    instance: Effect
    columns: Array
    directions: tuple[Array, ...]
    """Weights of the columns that are a unit of the main number, one for each way in which it may be concealed."""
    place: float
    """The number by which members of the kind differ."""
    prior: Array
    """How large the columns' coefficients may be (one standard deviation)."""
    many: int
    """Members that the search tries."""
    none: float = 0.0
    """Main number at which there is no effect."""
    least: float = 0.0
    """Size below which it is not named whatever its evidence ..."""
    most: float = np.inf
    """... and above which it cannot be."""
    phases: int = 0
    has_name: bool = True
    """Whether it would be given its name where it is as it stands here."""

    @property
    def effect(self) -> str:
        """Its id."""
        return self.instance.id

    @property
    def easiest(self) -> int:
        """Whether less (-1) or more (1) of the number at which it sets in is easier to find; 0 where it has a size."""
        return hypothesis_of(self.instance).easiest


def members(problem: Problem, mount: Mount, span: Span, tried: Sequence[Candidate], values: Array) -> list[Member]:
    """Make the members of all effects that the search tries."""
    chosen = [
        member
        for one in HYPOTHESES
        for member in one.concealed(mount, span, [c for c in tried if isinstance(c.instances[0], one.forms)])
        if not needs_turns(member.instances[0], mount, problem.prepared)
    ]
    even = [one for one in chosen if not hypothesis_of(one.instances[0]).has_own_phase]
    columns = columns_of(mount, even, problem.prepared, values)
    torque = rms(problem.prepared.stacked("tau"))
    many = {name: sum(one.effect == name for one in tried) for name in {one.effect for one in chosen}}
    made = [_member(one, own, problem, mount, torque, many[one.effect]) for one, own in zip(even, columns, strict=True)]
    tones = [one for one in chosen if hypothesis_of(one.instances[0]).has_own_phase]
    return [*made, *_tones(problem.prepared, tones, torque, many)]


def _member(one: Candidate, columns: Array, problem: Problem, mount: Mount, torque: float, many: int) -> Member:
    instance, own = one.instances[0], hypothesis_of(one.instances[0])
    main = instance.main
    size = column_rms(columns)
    high = next(variable.high for variable in parameters_of(instance) if variable.name == main.parameter)
    return Member(
        instance=instance,
        columns=columns,
        directions=_directions(one, columns.shape[1]),
        place=float(getattr(instance, own.member or main.parameter)),
        prior=np.ones(columns.shape[1]) if one.finite else 0.5 * torque / size,
        many=many,
        none=own.none(mount),
        least=own.least(problem.sample_time),
        most=min(high, MOST_TORQUE * torque if main.unit == "N.m" else np.inf),
        has_name=not own.easiest
        or (own.shows(instance, mount, problem.prepared) and not is_degenerate(problem, instance)),
    )


def _directions(one: Candidate, count: int) -> tuple[Array, ...]:
    """Weights of a unit: of waves in both phases and signs, of what only resists with one sign, of others with both."""
    instance, unit = one.instances[0], np.eye(count)
    own, main = hypothesis_of(instance), instance.main.parameter
    low = next(variable.low for variable in parameters_of(instance) if variable.name == main)
    if own.easiest:
        return (unit[0],)
    if len(one.instances) == 2:
        return (*unit, *-unit) if hasattr(instance, "phase") else tuple(unit)
    unit[0] /= abs(float(getattr(instance, main))) if one.finite and getattr(instance, main) else 1.0
    return (unit[0],) if low >= 0 else (unit[0], -unit[0])


def _tones(prepared: Prepared, tones: Sequence[Candidate], torque: float, many: dict[str, int]) -> Iterator[Member]:
    draw, pieces = np.random.default_rng(0), len(prepared.pieces)
    for one in tones:
        instance = one.instances[0]
        hertz = float(getattr(instance, hypothesis_of(instance).member))
        phases = (draw.uniform(0, 2 * pi, pieces) for _ in range(2))
        ways = tuple(np.column_stack([np.cos(one), np.sin(one)]).ravel() for one in phases)
        prior = np.full(2 * pieces, 0.5 * torque)
        yield Member(instance, _tone(prepared, hertz), ways, hertz, prior, many[one.effect], phases=pieces)


def _tone(prepared: Prepared, hertz: float) -> Array:
    """Sine and cosine over time in each piece, filtered, (rows, 2 pieces)."""
    rows = [len(piece.kept) for piece in prepared.pieces]
    out = np.zeros((sum(rows), 2 * len(rows)))
    for number, (piece, first) in enumerate(zip(prepared.pieces, np.cumsum([0, *rows]), strict=False)):
        angle = 2 * pi * hertz * piece.t
        waves = piece.lowpass(np.column_stack([np.sin(angle), np.cos(angle)]))[piece.kept]
        out[first : first + rows[number], 2 * number : 2 * number + 2] = waves
    return out
