"""The best that could be done: the true structure, refitted on the training recordings, on the held-out one.

The names of what was concealed are given away, the numbers are not: they are the start of the fit. Friction stays the
law of the card, also where slip blocks made the recordings: a better law is no effect.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from math import pi
from typing import Any

import numpy as np

from cosim.diagnosis.claim import claimed
from cosim.diagnosis.fit import FIXED, Fit, fit
from cosim.diagnosis.prepare import Array, Prepared, choose_cutoff, prepare
from cosim.diagnosis.protocol import heldout_rms
from cosim.proof.tool import given
from pyfmi_models.effects import CATALOGUE, Effect
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.mount import Mount

SINES = ("cogging", "position_friction")
"""Effects whose waves the generator writes as sines; in a card they are cosines."""
EVALUATIONS = 60
FAR_FRICTION = 0.15
"""Share of the friction from which the fit of a play starts."""


def in_card_words(entry: Mapping[str, Any]) -> dict[str, Any]:
    """The true parameters of an effect with the phase as a card has it."""
    numbers = dict(entry["parameters"])
    if entry["effect"] in SINES and "phase" in numbers:
        numbers["phase"] = float((numbers["phase"] - pi / 2 + pi) % (2 * pi) - pi)
    return numbers


def ceiling(folder: str, entries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """{"heldout_rms": x}, or {"reason": why there is none}, for the effects of a truth."""
    if foreign := [entry["effect"] for entry in entries if not entry["listed"]]:
        return {"reason": f"{foreign[0]} has no structure in the library"}
    card, train, held = given(folder)
    mount, prepared = card.plant(), prepare(train, choose_cutoff(train, card.mount.inertia))
    effects = [_rubbing(true_effect(entry), mount) for entry in entries]
    return {"heldout_rms": heldout_rms([held], _refitted(mount, effects, prepared))}


def _rubbing(effect: Effect, mount: Mount) -> Effect:
    """Let the far side of a play start with some of the friction: the truth does not say how much it has."""
    if not isinstance(effect, Backlash):
        return effect
    level, viscous = (FAR_FRICTION * float(getattr(mount.friction, name)) for name in ("Fc", "sigma2"))
    return replace(effect, load_friction=level, load_viscous=viscous)


def _refitted(mount: Mount, effects: Sequence[Effect], prepared: Prepared) -> Mount:
    """The better of two fits of everything: at once, and after the base has found its place beside the true numbers."""
    grown = replace(mount, effects=(*mount.effects, *effects))
    known = {variable.name for variable in mount.parameters()}
    added = tuple(variable.name for variable in grown.parameters() if variable.name not in known)
    weight = _weight(grown, prepared)

    def fitted(start: Mount, fixed: tuple[str, ...] = FIXED) -> Fit:
        return fit(start, prepared.pieces, weight, mount, EVALUATIONS, fixed=fixed)

    beside = fitted(grown, (*FIXED, *added)).mount
    return min((fitted(grown), fitted(beside)), key=lambda found: float(np.sum((weight * found.residual) ** 2))).mount


def true_effect(entry: Mapping[str, Any]) -> Effect:
    """An effect of the library with the true numbers."""
    numbers = in_card_words(entry)
    form = max(CATALOGUE[entry["effect"]], key=lambda form: len(_names(form) & set(numbers)))
    kept = {name: numbers[name] for name in _names(form) & set(numbers)}
    return form(**{name: tuple(value) if isinstance(value, list) else value for name, value in kept.items()})


def _names(form: type[Effect]) -> set[str]:
    return {one.name for one in fields(form)}


def _weight(mount: Mount, prepared: Prepared) -> Array:
    """Rows at rest tell nothing where friction has no memory, of the law's own or by presliding."""
    v = prepared.stacked("v")
    bends = any(effect.id == "presliding" for effect in mount.effects)
    return np.ones(len(v)) if bends else claimed(mount.friction, v).astype(float)
