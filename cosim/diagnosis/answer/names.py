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

    def all_of(names: Iterable[str]) -> tuple[str, ...]:
        return tuple(short.get(name, name) for name in names)

    def in_text(text: str) -> str:  # a name may have spaces, as columns have; it is the only one of its id
        for name, own in short.items():
            text = text.replace(name, own)
        return text

    def of_trial(one: Trial) -> Trial:
        rules = tuple(replace(rule, name=in_text(rule.name)) for rule in one.rules)
        return replace(one, effects=all_of(one.effects), effect=short.get(one.effect, one.effect), rules=rules)

    def of_scores(one: EffectScores) -> EffectScores:
        margins, explains = (
            dict(zip(all_of(some), some.values(), strict=True)) for some in (one.margins, one.explains)
        )
        return replace(one, effect=short.get(one.effect, one.effect), margins=margins, explains=explains)

    findings = [
        replace(one, alone=True, title=one.title.removesuffix(f" ({one.source})")) if one.name in short else one
        for one in found.findings
    ]
    scores, plan = found.scores, found.next_experiment.copy()
    if "separates" in plan:
        plan["separates"] = list(all_of(plan["separates"]))
    return replace(
        found,
        findings=tuple(findings),
        delivered=all_of(found.delivered),
        ambiguous_with=tuple(map(all_of, found.ambiguous_with)),
        next_experiment=plan,
        ledger=tuple(map(of_trial, found.ledger)),
        scores=replace(scores, effects=list(map(of_scores, scores.effects))) if scores else None,
    )


def _short(names: Iterable[str]) -> dict[str, str]:
    """Names that are the only ones of their id, with that."""
    groups: dict[str, set[str]] = {}
    for name in names:
        groups.setdefault(id_of(name), set()).add(name)
    return {name: one for one, (name, *others) in groups.items() if ":" in name and not others}
