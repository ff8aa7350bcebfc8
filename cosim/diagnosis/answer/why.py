"""Why an effect was taken, refused or left open, read from the ledger of a diagnosis that was written."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp
from typing import Any

from cosim.diagnosis.answer.ledger import Rule, Trial
from cosim.diagnosis.answer.names import is_of, with_names

UNKNOWN = "unknown"
BASE = "refitted base"
WORDS = {
    "found": "detected",
    "ambiguous": "possible",
    "not_proven": "not confirmed by held-out recordings",
    "not_decided": "not decided",
    "not_seen": "not detected",
    "not_testable": "not testable",
}
"""Answers of diagnosis.json in words."""


@dataclass(frozen=True)
class Ranked:
    """A structure in the table of all, the best in training first."""

    structure: str
    nats: float
    """Evidence above the refitted base in training."""
    behind: float | None
    """What it lacks of the structure that is delivered [nats], with its standard error ..."""
    error: float | None
    weight: float
    """Share of all structures, by exp(nats)."""
    heldout: float | None
    """Nats above the refitted base on held-out recordings, with their standard error ..."""
    heldout_error: float | None
    refused: str
    """The rule that refuses the effect in question; "" where none does."""


def ranked(trials: Sequence[Trial]) -> list[Ranked]:
    """Each structure once, in the order of its evidence in training; the refitted base is one of them."""
    best: dict[tuple[str, ...], Trial] = {}
    for trial in (one for one in trials if one.effect != UNKNOWN):
        key = tuple(sorted(trial.effects))
        if key not in best or trial.train.nats > best[key].train.nats:
            best[key] = trial
    top = max([0.0, *(one.train.nats for one in best.values())])
    total = exp(-top) + sum(exp(one.train.nats - top) for one in best.values())
    rows = [_row(one, exp(one.train.nats - top) / total) for one in best.values() if one.effects]
    behind = next((one.behind.nats + one.train.nats for one in trials if one.behind), None)
    rows.append(Ranked(BASE, 0.0, behind, None, exp(-top) / total, 0.0, None, ""))
    return sorted(rows, key=lambda row: -row.nats)


def _row(one: Trial, weight: float) -> Ranked:
    pairs = ((gain.nats, gain.error) if gain else (None, None) for gain in (one.behind, one.heldout))
    (behind, error), (held, held_error) = pairs
    refused = sentence(one.refused_by) if one.refused_by else ""
    return Ranked(label(one.effects), one.train.nats, behind, error, weight, held, held_error, refused)


def label(effects: Sequence[str]) -> str:
    """Effects of a structure as text; the waves of a ripple are counted: "cogging x 2 + delay"."""
    counted = {name: effects.count(name) for name in effects}
    return " + ".join(name if many == 1 else f"{name} x {many}" for name, many in counted.items()) or BASE


def of_effect(trials: Sequence[Trial], effect: str) -> list[Trial]:
    """The trials in which an effect is in question, the one of the largest evidence first."""
    return sorted((one for one in trials if is_of(one.effect, effect)), key=lambda one: -one.train.nats)


def decisive(trials: Sequence[Trial], effect: str, delivered: Sequence[str] = ()) -> Trial | None:
    """The trial that says most of an effect: beside what is delivered, else where it came furthest.

    Furthest is through most rules, then with most evidence.
    """
    tried = of_effect(trials, effect)
    final = [one for one in tried if {*one.effects} - {one.effect} == {*delivered} - {one.effect}]
    return max(final or tried, key=lambda one: (_passed(one), one.train.nats), default=None)


def _passed(one: Trial) -> int:
    return next((k for k, rule in enumerate(one.rules) if not rule.outcome), len(one.rules) + 1)


def reasons(document: Mapping[str, Any], trials: Sequence[Trial]) -> Iterator[tuple[str, str]]:
    """Of each effect that was looked for its id and one sentence: taken, refused or left open, by which rule."""
    delivered = delivered_of(trials)
    for name, entry in with_names(document["effects"]):
        yield name, _reason(entry, decisive(trials, name, delivered))
    rest = decisive(trials, UNKNOWN, delivered)
    if rest:
        yield UNKNOWN, _of_rest(rest, UNKNOWN in document["verdict"])


def delivered_of(trials: Sequence[Trial]) -> tuple[str, ...]:
    """Effects of the structure that is delivered: the one for which it was asked whether something unknown is left."""
    return next((one.effects for one in trials if one.effect == UNKNOWN), ())


def _reason(entry: Mapping[str, Any], one: Trial | None) -> str:
    answer = entry["answer"]
    word, refused = WORDS.get(answer, answer), one.refused_by if one else None
    if answer in ("not_decided", "not_testable"):
        return f"{word}: {(entry.get('bound') or {}).get('reason') or 'these recordings do not excite it'}."
    if one is None and answer == "ambiguous":
        return f"{word}, p {entry['probability']:.2f}: {entry['evidence']}."
    if one is None:
        return f"{word}: not fitted, as no linear step towards it has evidence."
    if answer in ("not_seen", "not_proven"):
        return f"{word}: {sentence(refused) if refused else 'another effect explains the same'}."
    held = f", {one.heldout.nats:.0f} nats on held-out recordings" if one.heldout else ""
    others = [name for name in dict.fromkeys(one.effects) if name != one.effect]
    beside = f" (fitted together with {', '.join(others)})" if others else ""
    worth = f"removes {100 * one.share:.0f} % of the error energy in training{held}{beside}"
    return f"{word}, p {entry['probability']:.2f}: {worth}{f'; open: {sentence(refused)}' if refused else ''}."


def _of_rest(one: Trial, is_unknown: bool) -> str:
    above = [rule for rule in one.rules if rule.outcome]
    if is_unknown:
        return f"something unknown is left: {'; '.join(map(_measured, above)) or 'a learned term predicts'}."
    nearest = max(one.rules, key=lambda rule: (rule.value or 0.0) / (rule.limit or 1.0), default=None)
    return f"nothing unknown is left: nearest to its limit is {_measured(nearest)}." if nearest else "nothing is left."


def sentence(rule: Rule) -> str:
    """A rule that refuses, with its value and its limit."""
    if rule.value is None or rule.limit is None:
        return f"the rule '{rule.name}' is not met"
    return f"{_measured(rule)}" + (f" ({rule.note})" if rule.note else "")


def _measured(rule: Rule) -> str:
    if rule.value is None or rule.limit is None:
        return rule.name
    unit = f" {rule.unit}" if rule.unit else ""
    return f"{rule.name}: {rule.value:.3g}{unit}, limit {rule.limit:.3g}"
