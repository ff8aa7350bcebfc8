"""The ledger: every structure that was fitted, what it is worth, and each rule by which it was judged.

A structure is the base with some effects. A trial is one structure, looked at for one of its effects; it holds what the
structure gains on the refitted base, in nats, and the rules that were asked of the effect in it, in their order. Rules
are asked until one refuses, so the last rule of a trial that was refused is the one that refused it.
"""

from collections.abc import Callable, ItemsView, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.support.plain import JsonObject

Array = npt.NDArray[np.float64]
Key = tuple[str, tuple[str, ...], bytes]
"""An effect in question, the names of a structure's fitted numbers, and those numbers."""


@dataclass(frozen=True)
class Rule:
    """One rule as it was applied: its name, the value, the limit, and whether it let the effect pass."""

    name: str
    outcome: bool
    value: float | None = None
    """What was measured; None where the rule is a yes or no."""
    limit: float | None = None
    unit: str = ""
    note: str = ""

    def as_json(self) -> JsonObject:
        """Plain data; a value without end is None."""
        numbers = {"value": _finite(self.value), "limit": _finite(self.limit)}
        words = {name: text for name, text in (("unit", self.unit), ("note", self.note)) if text}
        return {"name": self.name, **numbers, "outcome": bool(self.outcome), **words}

    @classmethod
    def of_json(cls, entry: Mapping[str, object]) -> "Rule":
        """The rule that plain data describe."""
        value, limit = (_number(entry.get(name)) for name in ("value", "limit"))
        unit, note = (str(entry.get(name, "")) for name in ("unit", "note"))
        return cls(str(entry["name"]), bool(entry["outcome"]), value, limit, unit, note)


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def at_least(name: str, value: float, limit: float, unit: str = "", note: str = "") -> Rule:
    """A rule that a value must reach."""
    return Rule(name, value >= limit, value, limit, unit, note)


def until_refused(rules: Iterator[Rule]) -> tuple[Rule, ...]:
    """Ask rules in their order, up to the first that refuses: what comes after it is not computed."""
    asked = []
    for rule in rules:
        asked.append(rule)
        if not rule.outcome:
            break
    return tuple(asked)


def all_pass(rules: Iterable[Rule]) -> bool:
    """Whether no rule refuses."""
    return all(rule.outcome for rule in rules)


@dataclass(frozen=True)
class Gain:
    """What a structure gains on the refitted base [nats], with the standard error of that over blocks of time."""

    nats: float
    error: float


def error_of_sum(blocks: Array) -> float:
    """Standard error of the sum over independent blocks (blocks,)."""
    many = len(blocks)
    return float(np.sqrt(many * np.var(blocks, ddof=1))) if many > 1 else 0.0


@dataclass(frozen=True)
class Trial:
    """One structure, looked at for one of its effects."""

    effects: tuple[str, ...]
    """Effects that the structure adds to the base."""
    effect: str
    """The effect in question."""
    numbers: Mapping[str, float]
    """Fitted numbers of the structure, in SI units."""
    train: Gain
    heldout: Gain | None = None
    """The same on the held-out recordings; None where training alone refuses the structure."""
    share: float = 0.0
    """Share of the residual energy in training that the effect removes."""
    rules: tuple[Rule, ...] = ()
    blocks: Array | None = None
    """What the structure leaves in each block of time in training [nats]; not written."""
    behind: Gain | None = None
    """What it lacks of the structure that is delivered."""

    @property
    def refused_by(self) -> Rule | None:
        """The first rule that refuses the effect."""
        return next((rule for rule in self.rules if not rule.outcome), None)

    def as_json(self) -> JsonObject:
        """Plain data: a row of `ledger` in diagnosis.json."""
        gains: JsonObject = {}
        for name, one in (("train", self.train), ("heldout", self.heldout), ("behind", self.behind)):
            gains |= {
                f"nats_{name}": _short(one.nats) if one else None,
                f"se_{name}": _short(one.error) if one else None,
            }
        return {
            "effects": list(self.effects),
            "effect": self.effect,
            "numbers": {name: _short(value) for name, value in self.numbers.items()},
            **gains,
            "share": _short(self.share),
            "rules": [rule.as_json() for rule in self.rules],
        }

    @classmethod
    def of_json(cls, row: Mapping[str, object]) -> "Trial":
        """The trial that a row of `ledger` in diagnosis.json describes."""
        given: dict[str, Any] = dict(row)
        train, heldout, behind = (_gain_of(given, name) for name in ("train", "heldout", "behind"))
        rules = tuple(map(Rule.of_json, given["rules"]))
        shared = {"share": given["share"], "rules": rules, "behind": behind}
        return cls(
            tuple(given["effects"]), given["effect"], dict(given["numbers"]), train or Gain(0, 0), heldout, **shared
        )


def _gain_of(row: Mapping[str, Any], name: str) -> Gain | None:
    nats, error = row[f"nats_{name}"], row[f"se_{name}"]
    return None if nats is None else Gain(float(nats), float(error))


@dataclass
class Ledger:
    """Trials in the order in which they were made; the only thing of a diagnosis that grows while it goes on."""

    _trials: dict[Key, Trial] = field(default_factory=dict)

    def add(self, key: Key, make: Callable[[], Trial]) -> None:
        """Enter a trial once; see `Key`."""
        if key not in self._trials:
            self._trials[key] = make()

    def judge(self, key: Key, rules: Sequence[Rule]) -> None:
        """Add the rules that were asked of a trial; one that was asked again is the last word."""
        if trial := self._trials.get(key):
            names = {rule.name for rule in rules}
            kept = tuple(rule for rule in trial.rules if rule.name not in names)
            self._trials[key] = replace(trial, rules=(*kept, *rules))

    def items(self) -> ItemsView[Key, Trial]:
        """Keys and trials."""
        return self._trials.items()


def _finite(value: float | None) -> float | None:
    return _short(value) if value is not None and isfinite(value) else None


def _short(value: float) -> float:
    """Six digits: enough to see which side of a limit a value is on."""
    return float(f"{value:.6g}")
