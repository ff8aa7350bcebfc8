"""One fit under two names: effects with the very same equation, of which no recording tells which it is.

What was fitted once is not fitted again: the other name has the same torque, the same evidence and the same number.
"""

from collections.abc import Collection
from dataclasses import replace

from cosim.diagnosis.effects import named, namesakes
from cosim.diagnosis.search.stages import CandidateFit
from cosim.estimation.fit import Fit
from pyfmi_models.effects import Effect


def renamed(one: CandidateFit) -> list[CandidateFit]:
    """A candidate by each other name that its effect may have; none for nearly all effects."""
    return [
        replace(one, effect=other, fit=_with(one.fit, one.effect, other))
        for other in namesakes(one.effect, one.fit.mount)
    ]


def by_each_name(one: CandidateFit, known: Collection[str]) -> list[CandidateFit]:
    """A candidate, and the same by each other name that is not among those that are `known`."""
    return [one, *(other for other in renamed(one) if other.effect.name not in known)]


def is_renamed(effect: Effect) -> bool:
    """Whether an effect is never found for itself, only as another name of one that was."""
    return bool(named(effect.id).same_as)


def _with(fit: Fit, effect: Effect, other: Effect) -> Fit:
    """A fit with an effect under another name; torque and slopes are the same."""
    effects = tuple(other if one is effect else one for one in fit.mount.effects)
    mount = replace(fit.mount, effects=effects)
    names = {old.name: new.name for old, new in zip(fit.mount.parameters(), mount.parameters(), strict=True)}
    return replace(fit, mount=mount, free=tuple(names[name] for name in fit.free))
