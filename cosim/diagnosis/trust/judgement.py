"""From likelihoods to words: what is doubtful about recordings, and what cannot be and is refused."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import log

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.answer.doubt_entry import Alternative, Kind, Sanity
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.trust.explanations import Explanation, explanations
from cosim.diagnosis.trust.likelihood import Evidence, Reference
from cosim.support.errors import RecordingError

SURE = 0.95
"""Probability from which an explanation is stated alone."""
ALONE = 0.2
"""Probability of being right below which one recording is doubted: there may be many, so half is too little."""
MOST_ALONE = 6
"""Recordings that are judged each alone; of more, neighbours are judged together, in so many groups."""
IMPOSSIBLE = 10.0
"""A unit that is wrong by more than this factor is refused: no fit can make sense of it."""
TOLD = 0.03
"""Alternatives less likely than this are not listed ..."""
MOST_TOLD = 4
"""... and of the others so many at most."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """Probabilities of all explanations of some recordings."""

    recordings: tuple[Recording, ...]
    evidence: Evidence
    table: tuple[Explanation, ...]
    probability: tuple[float, ...]

    @classmethod
    def of(cls, recordings: Sequence[Recording], reference: Reference) -> "Judgement":
        """Weigh all explanations of recordings that are in the same state."""
        evidence = Evidence(list(recordings), reference)
        reading = "q" if all("q" in one for one in recordings) else "v"
        stated = [name for name in (reading, "tau") if all(name in one.units for one in recordings)]
        counted = all("period" in one.origin for one in recordings)
        table = tuple(explanations(reference.linear, reading, stated, evidence.speed_off, counted))
        prior = np.array([log(one.prior) for one in table])
        score = prior + np.array([evidence.of(one) for one in table])
        if not np.isfinite(score).any():  # too short to say anything
            score = prior
        weight = np.exp(score - score.max())
        return cls(tuple(recordings), evidence, table, tuple((weight / weight.sum()).tolist()))

    @property
    def right(self) -> float:
        """Probability that recording and card are right."""
        return self._share(lambda one: one.kind is None)

    @property
    def slip(self) -> float:
        """Probability that the recording is wrong."""
        return self._share(lambda one: one.is_slip)

    def _share(self, belongs: Callable[[Explanation], bool]) -> float:
        return sum(p for one, p in zip(self.table, self.probability, strict=True) if belongs(one))

    @property
    def alternatives(self) -> tuple[tuple[Explanation, Alternative], ...]:
        """Explanations whose factor is free taken together, likeliest first, with the likeliest factor in the words."""
        groups: dict[str, list[int]] = {}
        for number, one in enumerate(self.table):
            groups.setdefault(one.what, []).append(number)
        found = []
        for what, members in groups.items():
            best = max(members, key=lambda number: self.probability[number])
            share = sum(self.probability[number] for number in members)
            said = what.format(factor=f"{self.table[best].factor:.3g}")
            found.append((self.table[best], Alternative(what=said, likelihood=share)))
        return tuple(sorted(found, key=lambda pair: -pair[1].likelihood))

    @property
    def kind(self) -> Kind:
        """What the finding is called: by its likeliest explanation but "right"."""
        return next(one.kind for one, _ in self.alternatives if one.kind is not None)

    def allows(self, other: "Judgement") -> bool:
        """Whether the likeliest explanation of other recordings is not excluded by these."""
        likeliest = next(one.what for one, _ in other.alternatives if one.kind is not None)
        return any(one.what == likeliest and told.likelihood > TOLD for one, told in self.alternatives)

    @property
    def names(self) -> str:
        """Names of the recordings."""
        return ", ".join(one.name for one in self.recordings)


def judged(train: Sequence[Recording], heldout: Sequence[Recording], reference: Reference) -> tuple[Sanity, ...]:
    """Say what is doubtful about recordings beside a card.

    Raises:
        RecordingError: a unit is wrong beyond doubt; the message names the option that puts it right.
    """
    alone = [Judgement.of(group, reference) for group in _groups([*train, *heldout])]
    doubted = [one for one in alone if one.right < ALONE]
    if doubted:
        others = [one for one in alone if one not in doubted and one.allows(doubted[0])]
        return tuple(stated(one) for one in _grouped([*doubted, *others], reference))
    together = Judgement.of([*train, *heldout], reference) if len(alone) > 1 else alone[0]
    return (stated(together),) if together.right < POLICY.half else ()


def _groups(recordings: Sequence[Recording]) -> list[list[Recording]]:
    """Each recording alone, or neighbours together where there are many."""
    edges = np.linspace(0, len(recordings), min(len(recordings), MOST_ALONE) + 1).astype(int)
    return [list(recordings[first:last]) for first, last in pairwise(edges)]


def _grouped(doubted: Sequence[Judgement], reference: Reference) -> list[Judgement]:
    """Judge recordings together that may suffer from the same."""
    groups: list[Judgement] = []
    for one in doubted:
        first = next((group for group in groups if one.allows(group)), None)
        if first is None:
            groups.append(one)
        else:
            joined = Judgement.of([*first.recordings, *one.recordings], reference)
            groups[groups.index(first)] = joined
    return groups


def stated(judgement: Judgement) -> Sanity:
    """Put a judgement into words, or refuse (RecordingError) what cannot be."""
    told = [pair for pair in judgement.alternatives if pair[1].likelihood > TOLD][:MOST_TOLD]
    best, first = told[0]
    beyond = max(best.factor, 1 / best.factor) > IMPOSSIBLE
    if first.likelihood > POLICY.nearly_all and best.option and best.kind in ("position_scale", "time_unit") and beyond:
        column = best.option.split()[1].split("=")[0]
        right = "" if column == "t" else f" If its unit is the right one, state that: --units {column}=..."
        text = f"{judgement.names}: {first.what} ({_fact(judgement)}). Use {best.option}.{right}"
        raise RecordingError(text, culprit=column, value=best.factor)
    evidence = judgement.evidence
    same_fault = evidence.speed_off != 1.0 and evidence.reference.is_of_recordings  # other sizes, and no other names
    return Sanity(
        finding=judgement.kind,
        statement=f"{judgement.names}: {_fact(judgement)}. {_causes(told)}",
        alternatives=tuple(one for _, one in told),
        blocks_naming=judgement.slip > POLICY.half and not same_fault,
    )


def _causes(told: Sequence[tuple[Explanation, Alternative]]) -> str:
    best, first = told[0]
    hint = f" Use {best.option}." if best.option else ""
    if first.likelihood > SURE:
        return f"{first.what[:1].upper()}{first.what[1:]}.{hint}"
    listed = "; or ".join(f"{one.what} ({one.likelihood:.0%})" for _, one in told)
    return f"Either {listed}.{hint}"


def _fact(judgement: Judgement) -> str:
    """What torque and motion imply, in the units as they are stated."""
    known, off = judgement.evidence.reference, judgement.evidence.speed_off
    slope = f'"v" is {off:.3g} times the slope of "q"'
    if off != 1.0 and known.is_of_recordings:
        return slope
    found = judgement.evidence.balance(1.0).solution(0.0 if known.linear else 1.0)
    unit, force = ("kg", "N") if known.linear else ("kg m2", "N m")
    said = f"torque and motion imply an inertia of {found.inertia.value:.3g} {unit} (card: {known.inertia:.3g})"
    if known.coulomb:
        said += f" and a friction of {found.coulomb.value:.3g} {force} (card: {known.coulomb:.3g})"
    said = f"{slope}, and {said}" if off != 1.0 else said
    return said if found.explained > POLICY.half else f"{said}, and explain {found.explained:.0%} of it"
