"""Compare fitted structures, and candidates beside one, by one evidence.

All structures of a diagnosis are compared on the same rows, scaled by the same noise over speed, beside the same
nuisances; only their torques and tangents differ.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from cosim.diagnosis.answer.ledger import Gain, Key, Ledger, Rule, Trial, error_of_sum
from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.effects import candidates, named
from cosim.diagnosis.effects.candidates import Candidate, columns_of
from cosim.diagnosis.evidence.bands import Bands, NoiseOverSpeed, OnBands, joined, noise_over_speed
from cosim.diagnosis.evidence.discrepancy import Discrepancy, Forms, discrepancy, forms
from cosim.diagnosis.evidence.marginal import Group, Marginal, marginal
from cosim.diagnosis.evidence.structure import Structure, key_of, structure_of
from cosim.estimation.blocks import Blocks
from cosim.estimation.fit import Fit
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import Array
from cosim.estimation.priors import trust
from cosim.estimation.problem import Problem
from cosim.support.statistics import column_rms, rms
from pyfmi_models.effects import Effect

Aside = frozenset[str]
"""Names of nuisances that stand aside, because they are the effect in question."""
NONE: Aside = frozenset()
AT_HAND = 3
"""Transformed columns that are kept: of a structure, of the one it is compared with, of what that one misses."""


def aside_for(*effects: str) -> Aside:
    """Nuisances that stand aside for effects."""
    return frozenset(nuisance for name in effects if (nuisance := named(name).imitated_by))


@dataclass(frozen=True)
class Screened:
    """A candidate with the evidence that a linear step towards it has, and the share of the plain energy."""

    candidate: Candidate
    evidence: float
    plain: float
    coefficients: Array

    @property
    def form(self) -> type[Effect]:
        """Class of the effect."""
        return type(self.candidate.instances[0])


@dataclass(frozen=True, eq=False)
class Comparison(OnBands):
    """What all comparisons of a diagnosis share."""

    problem: Problem
    policy: Policy
    bands: Bands
    nuisances: Discrepancy
    floor: Array
    noise: NoiseOverSpeed
    inertia: float
    """Inertia [kg m2, kg] that carries the reading's noise into the torque."""
    base: tuple[str, ...]
    """Names of the base's fitted numbers."""
    offered: dict[Fit, "_Offered"] = field(default_factory=dict)
    """What is offered beside a fit that will be screened, until then."""
    refitted: Fit | None = None
    """The refitted base, on which gains are told."""
    ledger: Ledger = field(default_factory=Ledger)
    fitted: dict[Key, Structure] = field(default_factory=dict)
    """Structures of the ledger, as far as held-out recordings must know them."""

    @classmethod
    def of(cls, problem: Problem, base: Fit, policy: Policy) -> "Comparison":
        """Set up from the refitted base: noise over speed is what the base leaves beside the best of every effect."""
        prepared, weight = problem.prepared, problem.weight
        nuisances = discrepancy(base.mount, prepared, policy)
        known, residual = _tangents_and_rest(problem, base, nuisances)
        offered = _Offered.after(problem, base, nuisances, residual)
        counted = (weight > 0).astype(float)
        best: dict[type[Effect], tuple[float, Array]] = {}
        for one, columns in zip(offered.tried, offered.columns, strict=True):
            share = _share(residual, columns * counted[:, None], known)
            form = type(one.instances[0])
            if share > best.get(form, (0.0,))[0]:
                best[form] = share, columns
        everything = np.column_stack([known, *(columns * counted[:, None] for _, columns in best.values())])
        left, v, rows = projected(base.residual * counted, everything), prepared.stacked("v"), weight > 0
        noise = noise_over_speed(left[rows], v[rows])
        bands = Bands.of(prepared, weight, noise.at(v), policy)
        # A base that lacks much may be left with no inertia; then the card knows better what noise there is.
        inertia = max(float(base.mount.axis.inertia), float(problem.mount.axis.inertia))
        floor = bands.least_noise(prepared, inertia, policy)
        return cls(problem, policy, bands, nuisances, floor, noise, inertia, base.free, {base: offered}, base)

    @cached_property
    def _evidence(self) -> WeakKeyDictionary[Fit, dict[tuple[Aside, bool, Forms | None], float]]:
        return WeakKeyDictionary()

    @cached_property
    def _forms(self) -> WeakKeyDictionary[Fit, Forms | None]:
        return WeakKeyDictionary()

    def evidence(self, found: Fit, aside: Aside = NONE, few: bool = False, beside: Fit | None = None) -> float:
        """Log marginal likelihood of a fitted structure, phases that each recording tells priced; computed once.

        Args:
            found: the structure.
            aside: nuisances that stand aside.
            few: count the few ways of each band in which an equation may be wrong, not its independent rows.
            beside: a structure whose effects may miss something of their machine's, see `forms.py`.
        """
        known, missed = self._evidence.setdefault(found, {}), self.missed_by(beside)
        if (aside, few, missed) not in known:
            likelihood = self._marginal(found, aside, few, missed).log_likelihood
            known[aside, few, missed] = likelihood - self.policy.phase_price * found.phases
        return known[aside, few, missed]

    def form_gain(self, found: Fit, name: str) -> float:
        """Nats by which a structure is better where the machine may be off the equation of one of its effects."""
        missed = self.missed_by(found)
        if missed is None or name not in missed.names:
            return 0.0
        loose = self._marginal(found, NONE, False, missed.of(name)).log_likelihood
        return max(0.0, loose - self.policy.phase_price * found.phases - self.evidence(found))

    def missed_by(self, beside: Fit | None) -> Forms | None:
        """What the effects of a structure may miss; computed once."""
        if beside is None:
            return None
        if beside not in self._forms:
            self._forms[beside] = forms(beside, len(self.problem.mount.effects), self.problem.prepared)
        return self._forms[beside]

    def _marginal(self, found: Fit, aside: Aside, few: bool = False, missed: Forms | None = None) -> Marginal:
        own = self._own(found)
        grams, groups = self._joined(found, own, aside)
        if missed:
            first = grams.shape[1] - 1
            grams = self._grown(grams, own, aside, self._kept(missed, lambda: self.bands.transform(missed.columns)))
            groups = [*groups, *(Group(first + np.array(one), self.policy.misfit) for one in missed.groups)]
        rows = self.bands.of_forms if few else self.bands.effective
        return marginal(grams, self.free(found, grams.shape[1] - 1), groups, self.bands.count, rows, self.floor)

    def enter(self, effect: str, found: Fit, share: float) -> None:
        """Enter a structure into the ledger, looked at for one of its effects that removes this share of the energy."""
        key = key_of(effect, found)
        self.ledger.add(key, lambda: replace(self.trial_of(found), effect=effect, share=share))
        if key not in self.fitted:
            self.fitted[key] = structure_of(self.problem, found)

    def trial_of(self, found: Fit) -> Trial:
        """A structure and what it gains in training, looked at for no effect."""
        added = tuple(one.name for one in found.mount.effects[len(self.problem.mount.effects) :])
        return Trial(added, "", found.parameters(), self.gain(found), blocks=self._by_block(found))

    def judge(self, effect: str, found: Fit, rules: Sequence[Rule]) -> None:
        """Enter the rules that were asked of an effect in a structure."""
        self.ledger.judge(key_of(effect, found), rules)

    def gain(self, found: Fit) -> Gain:
        """What a structure gains on the refitted base [nats], and its standard error over blocks of time."""
        assert self.refitted is not None
        nats = self.evidence(found) - self.evidence(self.refitted)
        return Gain(nats, error_of_sum(self._by_block(self.refitted) - self._by_block(found)))

    @cached_property
    def _blocks_known(self) -> WeakKeyDictionary[Fit, Array]:
        return WeakKeyDictionary()

    def _by_block(self, found: Fit) -> Array:
        """What a structure leaves in each block of time, in nats, once tangents and nuisances are taken out."""
        if found not in self._blocks_known:
            own, weighed = self._own(found), self._marginal(found, NONE)
            first = own.shape[1] - 1
            left = own[:, 0] - own[:, 1:] @ weighed.beta[:first] - self._nuisances @ weighed.beta[first:]
            blocks = Blocks.of(self.problem.prepared)
            self._blocks_known[found] = self.bands.energy_by_block(left, weighed.noise, blocks)
        return self._blocks_known[found]

    def free(self, found: Fit, count: int) -> Array:
        """Prior sizes of so many columns, the first of which are the tangents of a structure."""
        free = np.ones(count)
        free[: len(found.free)] = trust(found, self.problem.prepared.reach)
        return free

    def _own(self, found: Fit) -> Array:
        """What is left and its slopes, transformed, and the slopes of the base's numbers in fast motion once more.

        A law is one thing to slow motion and another to fast one: where what is slow counts as noise, numbers that fit
        what is fast cost nothing, and a structure that explains what is slow would be the worse for that.
        """

        def made() -> Array:
            own = self.bands.transform(np.column_stack([found.residual, found.slopes]))
            base = np.array([name in self.base for name in found.free], bool)
            relative = own[:, 1:][:, base] * np.abs(found.values[base])
            return np.column_stack([own, np.where(self.bands.fast[:, None], relative, 0.0)])

        return self._kept(found, made)

    @cached_property
    def _last(self) -> dict[Fit | Forms, Array]:
        return {}

    def _kept(self, of: Fit | Forms, make: Callable[[], Array]) -> Array:
        """Transformed columns of a structure, or of what one misses; of the last few they are at hand."""
        found = self._last.pop(of, None)
        self._last[of] = make() if found is None else found
        if len(self._last) > AT_HAND:
            del self._last[next(iter(self._last))]
        return self._last[of]

    def _joined(self, found: Fit, own: Array, aside: Aside) -> tuple[Array, list[Group]]:
        """Gram matrices of own columns and the nuisances that stay, and where those are among the columns."""
        kept, first = self._staying(aside), own.shape[1] - 1
        cross = self.bands.crossed(own, self._nuisances[:, kept])
        grams = joined(self.bands.grams(own), cross, self._nuisance_grams[:, kept][:, :, kept])
        fast = np.arange(len(found.free), first)
        placed = [Group(fast, self.policy.wander)] if fast.size else []
        return grams, [*placed, *self.nuisances.groups_at(first, aside)]

    def _staying(self, aside: Aside) -> list[int]:
        return [k for group in self.nuisances.groups if group.name not in aside for k in group.columns]

    def screen(self, found: Fit) -> list[Screened]:
        """Score every candidate beside a fitted structure."""
        own = self.offered.pop(found, None)
        if not own:
            residual = _tangents_and_rest(self.problem, found, self.nuisances)[1]
            own = _Offered.after(self.problem, found, self.nuisances, residual)
        return self.score(found, own.tried, own.columns)

    def score(self, found: Fit, tried: Sequence[Candidate], groups: Sequence[Array]) -> list[Screened]:
        """Score columns of candidates beside a fitted structure."""
        own = self._own(found)
        plain, bands = _Plain(found, self.problem.weight), self.bands
        torque = rms(self.problem.prepared.stacked("tau"))
        ready: dict[Aside, tuple[Array, list[Group], Array, Marginal]] = {}
        scored = []
        for one, columns in zip(tried, groups, strict=True):
            aside = aside_for(one.effect)
            if aside not in ready:
                ready[aside] = self._ready(found, own, aside)
            grams, placed, free, now = ready[aside]
            added = self.bands.transform(columns)
            grown = self._grown(grams, own, aside, added)
            size = column_rms(columns)
            prior = np.ones(columns.shape[1]) if one.finite else 0.5 * torque / size
            after = marginal(
                grown, np.concatenate([free, prior]), placed, bands.count, bands.effective, self.floor, now, 2
            )
            gain, beta = after.log_likelihood - now.log_likelihood, after.beta[len(free) :]
            possible = not one.positive or bool(np.all(beta > 0))
            shares = (gain, plain.share(columns)) if possible else (-inf, 0.0)
            scored.append(Screened(one, *shares, beta))
        return scored

    def _ready(self, found: Fit, own: Array, aside: Aside) -> tuple[Array, list[Group], Array, Marginal]:
        grams, placed = self._joined(found, own, aside)
        free, bands = self.free(found, grams.shape[1] - 1), self.bands
        return grams, placed, free, marginal(grams, free, placed, bands.count, bands.effective, self.floor)

    def group(self, found: Fit, columns: Array) -> tuple[float, Array]:
        """Evidence of columns whose coefficients share an unknown size, and those coefficients, shrunk as that says.

        Columns have unit RMS in training; the prior of the size is `policy.misfit` of the friction level. What the
        effects of the structure may miss of their machine's stands beside them.
        """
        own, missed, policy = self._own(found), self.missed_by(found), self.policy
        grams, placed = self._joined(found, own, NONE)
        level = rms(self.nuisances.level) or float(np.std(self.problem.prepared.stacked("tau")))
        added, free = self.bands.transform(columns * level), self.free(found, grams.shape[1] - 1)
        if missed:
            added = np.column_stack([self._kept(missed, lambda: self.bands.transform(missed.columns)), added])
            placed = [*placed, *(Group(len(free) + np.array(one), policy.misfit) for one in missed.groups)]
        free = np.concatenate([free, np.ones(added.shape[1])])
        term = Group(np.arange(len(free) - columns.shape[1], len(free)), policy.misfit)
        grown = self._grown(grams, own, NONE, added)
        after = marginal(grown, free, [*placed, term], self.bands.count, self.bands.effective, self.floor)
        gain = after.log_likelihood - self._marginal(found, NONE, False, missed).log_likelihood
        return gain, after.beta[len(free) - columns.shape[1] :] * level

    def above_noise(self, found: Fit, without: Fit) -> float:
        """Energy that an effect removes, over the least noise: the reading's in the torque, and any model's accuracy.

        The acceleration is known up to that noise, which biases what scales with it: least squares shrinks the inertia
        where noise is loud, and so does a spring.
        """
        left = self.bands.transform(np.column_stack([without.residual, found.residual]))
        energy = self.bands.grams(left).sum(0)
        noise = float(self.floor @ self.bands.count)
        return float(energy[0, 0] - energy[1, 1]) / max(noise, 1e-300)

    def wander(self, found: Fit) -> dict[str, float]:
        """Estimated sizes of the nuisances beside a structure."""
        groups, sizes = self.nuisances.groups, self._marginal(found, NONE).sizes
        return {group.name: float(size) for group, size in zip(groups, sizes[-len(groups) :], strict=True)}

    def _grown(self, grams: Array, own: Array, aside: Aside, added: Array) -> Array:
        nuisances = self._nuisances[:, self._staying(aside)]
        cross = np.concatenate([self.bands.crossed(own, added), self.bands.crossed(nuisances, added)], 1)
        return joined(grams, cross, self.bands.grams(added))


class _Offered(NamedTuple):
    """The candidates beside a fit that have values there, and the columns of each.

    Beside a number that ended at its bound (a spring of 10 kHz) a walk through a gap may have none.
    """

    tried: Sequence[Candidate]
    columns: Sequence[Array]

    @classmethod
    def after(cls, problem: Problem, found: Fit, nuisances: Discrepancy, residual: Array) -> "_Offered":
        tried = candidates(found.mount, problem.prepared, residual, np.abs(nuisances.level))
        columns = columns_of(found.mount, tried, problem.prepared, found.values)
        kept = [k for k, one in enumerate(columns) if np.isfinite(one).all()]
        return cls([tried[k] for k in kept], [columns[k] for k in kept])


def _tangents_and_rest(problem: Problem, found: Fit, nuisances: Discrepancy) -> tuple[Array, Array]:
    """Tangents of a fit with the nuisances, at the rows that count, and what they leave of its residual there."""
    counted = (problem.weight > 0).astype(float)
    known = np.column_stack([found.slopes, nuisances.columns]) * counted[:, None]
    return known, projected(found.residual * counted, known)


class _Plain:
    """Share of the plain residual energy that columns explain beyond the tangents of a fit."""

    def __init__(self, found: Fit, weight: Array) -> None:
        scale = np.sqrt((found.slopes**2).sum(0)) + 1e-300
        self._base, _ = np.linalg.qr(found.slopes / scale * weight[:, None])
        self._weight, target = weight, found.residual * weight
        self._residual = target - self._base @ (self._base.T @ target)
        self._energy = float(self._residual @ self._residual) + 1e-300

    def share(self, columns: Array) -> float:
        """Share of the energy that columns explain."""
        own = columns * self._weight[:, None]
        own = own - self._base @ (self._base.T @ own)
        beta = np.linalg.lstsq(own.T @ own, own.T @ self._residual, rcond=1e-9)[0]
        return float(beta @ (own.T @ self._residual)) / self._energy


def _share(residual: Array, columns: Array, known: Array) -> float:
    """Share of a residual that columns explain (the residual is free of `known` already)."""
    own = projected(columns, known)
    beta = np.linalg.lstsq(own.T @ own, own.T @ residual, rcond=1e-9)[0]
    return float(beta @ (own.T @ residual)) / (float(residual @ residual) + 1e-300)
