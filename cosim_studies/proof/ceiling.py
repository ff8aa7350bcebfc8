"""The best that could be done: the true structure, refitted on the training recordings, on the held-out one.

The names of what was concealed are given away, the numbers are not: they are where the fits start. Friction stays the
law of the card, also where something else rubbed in truth: a better law is no effect. The true structure contains the
base, so a fit of it that ends worse than the fit of the base, in training or on the held-out recording, has failed or
has nothing to tell: it is rejected, and the case counts as one without a gap.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from math import pi
from typing import Any, NamedTuple

import numpy as np

from cosim.diagnosis.evidence.band import in_band
from cosim.diagnosis.measure.protocol import heldout_rms
from cosim.estimation.fit import fit
from cosim.estimation.prepare import PROTOCOL_HZ, Array, Band, Prepared
from cosim.estimation.row_weights import described_rows
from cosim.support.plain import Parsed
from cosim_studies.proof.tool import given
from pyfmi_models.effects import CATALOGUE, Effect
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.mount import Mount

SINES = ("cogging", "position_friction")
"""Effects whose waves the generator writes as sines; in a card they are cosines."""
TRUE_NUMBERS = {
    **{"sigma0": "stiffness", "sigma1": "damping", "sigma2": "viscous", "Fc": "coulomb", "Fs": "breakaway"},
    **{"Vs": "stribeck_speed", "delta": "stribeck_power"},
}
"""Numbers of a card's law and those of `truth.c`."""
EVALUATIONS = 60
FAR_FRICTION = 0.15
"""Share of the friction from which the fit of a play starts."""


class Found(NamedTuple):
    """A fitted mount and what it leaves of the weighted training residual's energy."""

    mount: Mount
    cost: float


def in_card_words(entry: Mapping[str, Any]) -> Parsed:
    """The true parameters of an effect with the phase as a card has it."""
    numbers = dict(entry["parameters"])
    if entry["effect"] in SINES and "phase" in numbers:
        numbers["phase"] = float((numbers["phase"] - pi / 2 + pi) % (2 * pi) - pi)
    return numbers


def ceiling(
    folder: str,
    entries: Sequence[Mapping[str, Any]],
    truth: Mapping[str, Any] | None = None,
    band: tuple[float, float] = (PROTOCOL_HZ, PROTOCOL_HZ),
) -> Parsed:
    """{"heldout_rms": x, "base_rms": y}, or {"reason": why there is no x}, for the effects of a truth.

    Of several effects also {"without": {effect: held-out RMS of the same structure without that effect}}.

    Args:
        folder: where card and recordings are.
        entries: the effects.
        truth: the true numbers of the machine, one more place to start from.
        band: cutoff of the torque and of the motion in which errors are given [Hz]: those of the answer with which
            the ceiling is compared, as 30 Hz are mostly noise of the reading on some machines.
    """
    if foreign := [entry["effect"] for entry in entries if not entry["listed"]]:
        return {"reason": f"{foreign[0]} has no structure in the library"}
    card, train, held = given(folder)
    mount = card.plant()
    prepared = in_band(train, mount)
    starts = [mount, *([_as_made(mount, truth)] if truth else [])]

    def refitted(those: Sequence[Mapping[str, Any]]) -> tuple[Found, Found]:
        return _refitted(starts, [_rubbing(true_effect(entry), mount) for entry in those], prepared)

    judge = partial(heldout_rms, [held], band=Band(*band))
    found = judged(judge, *refitted(entries))
    if "reason" in found or len(entries) < 2:
        return found
    without = {one["effect"]: refitted([entry for entry in entries if entry is not one])[1].mount for one in entries}
    return found | {"without": {name: judge(mount) for name, mount in without.items()}}


def judged(judge: Callable[[Mount], float], base: Found, best: Found) -> Parsed:
    """The held-out RMS of the best fit, unless it is worse than the base that it contains."""
    reached, contained = judge(best.mount), judge(base.mount)
    if best.cost > base.cost * (1 + 1e-9):
        return {"reason": "its fit ended worse than that of the base it contains", "base_rms": contained}
    if reached > contained:
        return {"reason": "refitted it predicts less than the base it contains", "base_rms": contained}
    return {"heldout_rms": reached, "base_rms": contained}


def _rubbing(effect: Effect, mount: Mount) -> Effect:
    """Let the far side of a play start with some of the friction: the truth does not say how much it has."""
    if not isinstance(effect, Backlash):
        return effect
    level, viscous = (FAR_FRICTION * float(getattr(mount.friction, name)) for name in ("Fc", "sigma2"))
    return replace(effect, load_friction=level, load_viscous=viscous)


def _as_made(mount: Mount, truth: Mapping[str, Any]) -> Mount:
    """The base with the numbers with which the machine was made, as far as the card's law has them."""
    inertia = float(truth["inertia"]) + float(truth.get("load_inertia", 0.0))
    numbers = {card: float(truth[own]) for card, own in TRUE_NUMBERS.items() if getattr(mount.friction, card, None)}
    return replace(mount, axis=replace(mount.axis, inertia=inertia), friction=replace(mount.friction, **numbers))


def _refitted(starts: Sequence[Mount], effects: Sequence[Effect], prepared: Prepared) -> tuple[Found, Found]:
    """The base fitted, and the best of all fits with the effects.

    From each start everything is fitted at once, and again after the base has found its place beside the true numbers;
    the base's own fit is a start too, so that a structure which only bends it can be no worse.
    """
    card, grown = starts[0], replace(starts[0], effects=(*starts[0].effects, *effects))
    weight = _weight(grown, prepared)
    known = {variable.name for variable in card.parameters()}
    added = tuple(variable.name for variable in grown.parameters() if variable.name not in known)

    def fitted(start: Mount, fixed: tuple[str, ...] = ()) -> Found:
        found = fit(start, prepared.pieces, weight, card, EVALUATIONS, fixed=fixed)
        return Found(found.mount, float(np.sum((weight * found.residual) ** 2)))

    def with_effects(start: Mount) -> Mount:
        return replace(start, effects=(*start.effects, *effects))

    base = min((fitted(start) for start in starts), key=lambda found: found.cost)
    tried = [with_effects(start) for start in (*starts, base.mount)]
    tried.append(fitted(tried[0], added).mount)
    return base, min((fitted(start) for start in tried), key=lambda found: found.cost) if effects else base


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
    return np.ones(len(v)) if bends else described_rows(mount.friction, v).astype(float)
