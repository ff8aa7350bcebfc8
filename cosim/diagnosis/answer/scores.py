"""Scores: all numbers from which a diagnosis is decided, as plain data that can be stored and decided again."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, cast

from cosim.support.errors import InputError
from cosim.support.plain import JsonObject

FIELDS = ("effects", "rest", "learned")
"""What plain data of scores have."""
RETIRED = ("away", "plain", "predicted")
"""Scores of terms that decided up to policy 6, and that no stored answer needed."""


@dataclass(frozen=True)
class EffectScores:
    """Scores of an effect that stands after the proof. Nats."""

    effect: str
    evidence: float
    """Beside the other effects, in training."""
    margins: Mapping[str, float]
    """By how much it is better than each rival."""
    explains: Mapping[str, float]
    """Share of the residual energy that the effect, or a rival in its place, removes."""
    predicted: float = 0.0
    """What the held-out recordings lose without it ..."""
    removes: float = 0.0
    """... and the share of their residual energy that it removes."""
    ahead: float = 0.0
    """By how much it is better than the best term of another kind in its place, which has no name."""
    waves: Sequence[str] = ()
    """Rivals that are waves over position with any number of cycles, where it is none itself."""

    def with_margins_of(self, share: float) -> "EffectScores":
        """The same with so much of each margin."""
        return replace(self, margins={name: share * margin for name, margin in self.margins.items()})


@dataclass(frozen=True)
class TermScores:
    """Scores of a flexible term, a smooth shape of a recorded quantity, beside the structure that stands."""

    name: str
    evidence: float
    share: float
    """Share of the held-out residual energy that it predicts."""
    uneven: float | None = None
    """Of the friction level over position: what it moves the level by, relative to it (RMS)."""


@dataclass(frozen=True)
class ResidualScores:
    """What is left: its slow part relative to friction, in training and held out, and what it follows."""

    share: float
    share_there: float
    terms: Sequence[TermScores] = ()
    over_time: str = "time"
    share_beside: float = 0.0
    """The same beside what friction laws cannot agree on."""
    in_place: tuple[str, ...] = ()
    """Quantities of which a term explains more than a name did that was taken out for it."""
    in_bursts: float = 0.0
    """Share of its energy that comes in bursts."""
    shaken: float = 0.0
    """Level of a random disturbance relative to friction, in training and held out, the less."""
    changes: bool = False
    """Whether the machine becomes another one in the middle of a recording."""


@dataclass(frozen=True)
class LearnedScores:
    """Scores of a term that was learned for what has no name."""

    quantities: tuple[str, ...]
    """What it goes over."""
    evidence: float
    """The lower one of what training and what training left out say for it [nats]."""
    removed: float
    """Share of the held-out error energy that it removes."""
    is_sure: bool
    """Whether training, what training left out and the held-out recordings each prove it for themselves."""
    is_of_law: bool
    """Whether another friction law over speed would say the same."""


@dataclass(frozen=True)
class Scores:
    """Everything that `decide` looks at."""

    effects: Sequence[EffectScores]
    """Effects that stand on the held-out recordings."""
    rest: ResidualScores
    learned: LearnedScores | None = None
    improves: bool = True
    """Whether the model with the names is no worse on the held-out recordings than the refitted base."""

    def as_json(self) -> JsonObject:
        """Plain data: `scores` in diagnosis.json, each number with all its digits."""
        return cast(JsonObject, asdict(self))

    @classmethod
    def of_json(cls, entry: Mapping[str, Any]) -> "Scores":
        """The scores that plain data describe.

        Raises:
            InputError: it is not what `as_json` wrote.
        """
        try:
            rest, learned = dict(entry["rest"]), entry["learned"]
            rest["terms"] = [TermScores(**_kept(one)) for one in rest["terms"]]
            rest["in_place"] = tuple(rest["in_place"])
            known = LearnedScores(**{**_kept(learned), "quantities": tuple(learned["quantities"])}) if learned else None
            effects = [EffectScores(**one) for one in entry["effects"]]
            return cls(effects, ResidualScores(**rest), known, entry.get("improves", True))
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            said = 'scores: not those of a diagnosis; take what stands under "scores" in its diagnosis.json'
            raise InputError(said, culprit="scores", value=entry, choices=FIELDS) from error


def _kept(entry: Mapping[str, Any]) -> Mapping[str, Any]:
    return {name: value for name, value in entry.items() if name not in RETIRED}
