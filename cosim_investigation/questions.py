"""What a diagnosis leaves open: sets, effects that are not certain, effects that cannot be tested, what has no name.

A duel is a question between two structures, each fitted to the same recordings: what the answer holds, and the same
with the rival, or without the effect.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

from cosim.data.own_rate import as_analysed
from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Diagnosis, Finding, is_special
from cosim.diagnosis.diagnose import Outcome
from cosim.diagnosis.effects import named
from cosim.diagnosis.evidence.band import in_band
from cosim.estimation.fit import Fit
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import weights
from pyfmi_models.card import Card
from pyfmi_models.effects import CATALOGUE, Effect
from pyfmi_models.model import Pair
from pyfmi_models.mount import Mount

Kind = Literal["set", "uncertain", "unproven", "unknown", "not testable", "unconfirmed"]
EVALUATIONS = 15
"""Evaluations of the model that a refit of a rival may spend: it starts from the diagnosis' own numbers."""
UNPROVEN = 2
"""Most effects that training proposes and the proof does not confirm about which is asked at once."""
NEAR_FLOOR = 1.3
"""Held-out error, in units of the noise there, up to which nothing that matters is left. Unit: 1."""


@dataclass(frozen=True)
class Question:
    """One open question: its kind, the effects it is about, and what stands in its way."""

    kind: Kind
    effects: tuple[str, ...]
    statement: str
    otherwise: str = ""
    """What else than a motion would tell."""


@dataclass(frozen=True)
class Duel:
    """Two fitted structures of which one is right, as far as a question is concerned."""

    question: Question
    ours: Fit
    other: Fit

    @property
    def general(self) -> Literal["ours", "other", ""]:
        """Which of both holds the other as a special case; "" where neither does."""
        if self.question.kind in ("uncertain", "unproven"):
            return "ours" if self.question.kind == "uncertain" else "other"
        ours, other = ({one.name: one.special_case_of for one in fit.mount.effects} for fit in (self.ours, self.other))
        only, others = set(ours) - set(other), set(other) - set(ours)
        if any(others & set(ours[name]) for name in only):
            return "other"
        return "ours" if any(only & set(other[name]) for name in others) else ""


def problem_of(train: Sequence[Recording], card: Card) -> Problem:
    """What fits of the training recordings share, in the band of the diagnosis."""
    good, mount = [*map(as_analysed, train)], card.plant()
    prepared = in_band(good, mount)
    return Problem(mount, prepared, weights(mount.friction, prepared), max(one.sample_time for one in good))


def questions(found: Diagnosis) -> tuple[Question, ...]:
    """Everything that a diagnosis leaves open and that matters, the likeliest to be settled first.

    "unconfirmed" is always among them: whether an answer needs another round depends on those before it.
    """
    titles = {one.name: one.title.lower() for one in found.findings}
    groups = [tuple(n for n in group if not named(n).same_as) for group in found.ambiguous_with]
    separable = [group for group in groups if len(group) > 1]  # names that no motion tells apart are no question
    sets = [Question("set", group, " or ".join(titles.get(n, n) for n in group)) for group in separable]
    paired = {name for group in found.ambiguous_with for name in group}
    lone = [one for one in found.in_model if one.answer == "ambiguous" and one.name not in paired]
    unsure = [Question("uncertain", (one.name,), f"whether it is {titles[one.name]}") for one in lone]
    unknown = [Question("unknown", (), "something that has no name")] if "unknown" in found.verdict else []
    return (
        *sets,
        *unsure,
        *_unproven(found),
        *unknown,
        *_not_testable(found),
        Question("unconfirmed", (), _confirmation(found)),
    )


def _unproven(found: Diagnosis) -> Iterator[Question]:
    """Effects that training proposes and the proof does not confirm, where the answer is not settled without them."""
    lost = [] if is_settled(found) else [one for one in found.findings if one.answer == "not_proven"]
    for one in sorted(lost, key=lambda one: -one.gain)[:UNPROVEN]:
        yield Question("unproven", (one.name,), f"whether there is {one.title.lower()}, which is not proven")


def is_settled(found: Diagnosis) -> bool:
    """Whether something is named and the held-out error is down to the noise."""
    return bool(found.verdict) and found.heldout.after_rms <= NEAR_FLOOR * found.heldout.floor_rms


def _confirmation(found: Diagnosis) -> str:
    if not found.verdict:
        return "whether nothing is missing where nothing was visited yet, too"
    share = found.heldout.after_rms / max(found.heldout.floor_rms, 1e-300)
    return f"whether the same is found once more (the held-out error is {share:.1f} times the noise)"


def _not_testable(found: Diagnosis) -> Iterator[Question]:
    """Effects that no recording so far could show; where an answer is settled those that imitate what it names."""
    named = {name for name in found.verdict if name in CATALOGUE}
    only = {one for name in named for one in CATALOGUE[name][0].rivals if not is_special(one, [name])}
    for one in found.findings:
        if one.answer == "not_testable" and one.action and (not is_settled(found) or one.effect in only):
            yield Question("not testable", (one.effect,), f"whether there is {one.title.lower()}", one.action)


def duels(outcome: Outcome, problem: Problem, asked: Sequence[Question]) -> list[Duel]:
    """The questions that are between two structures, each of them fitted to the training recordings."""
    pairs = [(question, rival) for question in asked for rival in _rivals(question, outcome)]
    if not pairs:
        return []
    ours = problem.fit(outcome.card.plant(), EVALUATIONS)
    return [Duel(question, ours, problem.fit(rival, EVALUATIONS)) for question, rival in pairs]


def _rivals(question: Question, outcome: Outcome) -> Iterator[Mount]:
    """The delivered model with another effect in the place of the one that is in question, with it, or without it."""
    if question.kind not in ("set", "uncertain", "unproven"):
        return
    mount, main = outcome.card.plant(), question.effects[0]
    own = len(mount.effects) - len(outcome.card.effects)
    rest = (*mount.effects[:own], *(one for one in outcome.card.effects if one.name != main))
    if question.kind == "uncertain":
        yield replace(mount, effects=rest)
    findings = {one.name: one for one in outcome.diagnosis.findings}
    if question.kind == "unproven":
        yield replace(mount, effects=(*mount.effects, effect_of(findings[main])))
    for name in question.effects[1:]:
        yield replace(mount, effects=(*rest, effect_of(findings[name])))


def effect_of(finding: Finding) -> Effect:
    """The effect of a finding, with its fitted numbers."""
    names = {name.partition(".")[0] for name in finding.parameters}
    form = max(CATALOGUE[finding.effect], key=lambda one: len(names & {item.name for item in fields(one)}))
    numbers: dict[str, float | Pair] = {}
    for name in names:
        sides = [finding.parameters.get(f"{name}.{side}") for side in Pair._fields]
        numbers[name] = Pair(*sides) if None not in sides else finding.parameters[name]  # type: ignore[arg-type]
    make: Any = form
    words = {"neighbour": finding.source} if finding.source else {}
    return make(**numbers, **words)  # type: ignore[no-any-return]
