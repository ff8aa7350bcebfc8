"""Names of effects in an answer: an id, and its source only where an id stands for several ("axis_coupling:q2")."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from cosim.diagnosis.answer.ledger import Trial
from cosim.diagnosis.answer.result import Diagnosis
from cosim.diagnosis.answer.scores import EffectScores


def id_of(name: str) -> str:
    """The id in a name."""
    return name.partition(":")[0]


def with_names(entries: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The `effects` of diagnosis.json by name; couplings with further neighbours are in the entry of the first."""
    for entry in (one for first in entries for one in (first, *first.get("further", ()))):
        yield ":".join(entry[key] for key in ("effect", "neighbour") if key in entry), entry


def is_of(name: str, wanted: str) -> bool:
    """Whether a name is the one that is wanted, or one of several of a wanted id."""
    return wanted in (name, id_of(name))


def with_short_names(found: Diagnosis) -> Diagnosis:
    """The same with the id alone where an answer knows one effect of it."""
    known = dict.fromkeys([name for trial in found.ledger for name in (trial.effect, *trial.effects)])
    short = _short([*known, *(one.name for one in found.findings)])
    if not short:
        return found
    findings = [
        replace(one, alone=True, title=one.title.removesuffix(f" ({one.source})")) if one.name in short else one
        for one in found.findings
    ]
    scores = found.scores
    plan = found.next_experiment.copy()
    if "separates" in plan:
        plan["separates"] = [short.get(name, name) for name in plan["separates"]]
    return replace(
        found,
        findings=tuple(findings),
        delivered=tuple(short.get(name, name) for name in found.delivered),
        ambiguous_with=tuple(tuple(short.get(name, name) for name in group) for group in found.ambiguous_with),
        next_experiment=plan,
        ledger=tuple(_trial(one, short) for one in found.ledger),
        scores=replace(scores, effects=[_scores(one, short) for one in scores.effects]) if scores else None,
    )


def _short(names: Iterable[str]) -> dict[str, str]:
    """Names that are the only ones of their id, with that."""
    groups: dict[str, set[str]] = {}
    for name in names:
        groups.setdefault(id_of(name), set()).add(name)
    return {name: one for one, (name, *others) in groups.items() if ":" in name and not others}


def _trial(trial: Trial, short: Mapping[str, str]) -> Trial:
    rules = tuple(replace(rule, name=_shortened(rule.name, short)) for rule in trial.rules)
    effects = tuple(short.get(name, name) for name in trial.effects)
    return replace(trial, effects=effects, effect=short.get(trial.effect, trial.effect), rules=rules)


def _shortened(text: str, short: Mapping[str, str]) -> str:
    """A rule's name, in which a name may have spaces, as columns have; it is the only one of its id."""
    for name, own in short.items():
        text = text.replace(name, own)
    return text


def _scores(one: EffectScores, short: Mapping[str, str]) -> EffectScores:
    margins, explains = (
        {short.get(name, name): value for name, value in values.items()} for values in (one.margins, one.explains)
    )
    return replace(one, effect=short.get(one.effect, one.effect), margins=margins, explains=explains)
