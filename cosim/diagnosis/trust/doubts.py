"""Everything that is doubtful about recordings beside a card, in two steps: before the base is fitted, and after.

Is it the machine of the card, and one machine in all recordings? Its refitted base, its load and its inertia tell: what
a fit has to bend that far is often all that is wrong. The model with its effects may deny a doubt: what is missing from
a plain balance looks like two clocks.
"""

from collections.abc import Mapping, Sequence
from math import degrees, hypot, log
from typing import Final

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.answer.doubt_entry import Alternative, Sanity
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.search.candidate_fit import FAR
from cosim.diagnosis.search.stages import Stage
from cosim.diagnosis.trust.balance import Balance, Estimate
from cosim.diagnosis.trust.clocks import LATE, clocks
from cosim.diagnosis.trust.judgement import judged
from cosim.diagnosis.trust.likelihood import Reference
from cosim.diagnosis.trust.limits import encoder_step, little_motion, no_set_point, own_set_point, own_torque
from cosim.estimation.determined import ended_at
from cosim.estimation.fit import Fit, edges_of
from cosim.estimation.prepare import Array
from cosim.estimation.problem import Problem
from cosim.plots.quantities import raised
from cosim.support.statistics import SURELY, rms
from pyfmi_models.card import Card
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.model import Variable
from pyfmi_models.mount import Mount

ASSUMED = '" was taken for '
"""How a note begins that a reader leaves who did not believe the unit of the time stamps."""


def doubts(train: Sequence[Recording], heldout: Sequence[Recording], card: Card) -> tuple[Sanity, ...]:
    """What is doubtful about recordings beside a card, those first beside which no effect may be named.

    Raises:
        RecordingError: a unit is wrong beyond doubt; the message names the option that puts it right.
    """
    mount, controller = card.plant(), card.controller
    level = getattr(mount.friction, "Fc", None)
    reference = Reference(
        inertia=float(mount.axis.inertia),
        coulomb=float(np.mean(level)) if level is not None else None,
        torque_limit=float(mount.axis.torque_limit),
        record_hz=float(controller.record_hz) if controller else None,
        linear=mount.motion == "linear",
        is_of_recordings=is_estimated(card, [one.name for one in (*train, *heldout)]),
    )
    found = judged(train, heldout, reference)
    if not found:
        balances = [Balance([one], reference.linear) for one in (*train, *heldout)]
        found = (
            *clocks(balances[: len(train)], ", ".join(one.name for one in train)),
            *other_machine(balances[: len(train)], balances[len(train) :]),
        )
    return tuple(sorted((*found, *assumed_units((*train, *heldout))), key=lambda one: not one.blocks_naming))


def assumed_units(recordings: Sequence[Recording]) -> tuple[Sanity, ...]:
    """Say which time stamps were taken for another unit than seconds when they were read."""
    said = [note for one in recordings for note in one.notes if ASSUMED in note]
    return (Sanity(finding="time_unit", statement=" ".join(said)),) if said else ()


def is_estimated(card: Card, names: Sequence[str]) -> bool:
    """Whether a card was estimated from some recordings of these names, or a part of one: it is no witness of them."""
    given = card.origin.get("recordings", ()) if "estimated_by" in card.origin else ()
    return any(name == one or name.startswith(f"{one} (") for name in names for one in given)


def of_base(
    card: Card, problem: Problem, refitted: Mount, train: Sequence[Recording], heldout: Sequence[Recording]
) -> tuple[Sanity, ...]:
    """What the refitted base says of card and recordings, and what these recordings cannot show."""
    return (
        *_far(card, problem, refitted),
        *load_far_from_card(problem.mount, refitted, problem.prepared.stacked("q")),
        *encoder_step([*train, *heldout], problem.mount, problem.prepared.cutoff),
        *little_motion(problem.prepared),
        *own_torque(problem.prepared),
        *own_set_point(problem.prepared),
        *no_set_point([*train, *heldout]),
    )


def _far(card: Card, problem: Problem, mount: Mount) -> tuple[Sanity, ...]:
    """Numbers of the base that leave the card's, unless these were estimated from the same recordings."""
    if is_estimated(card, problem.prepared.names):
        return ()
    return base_far_from_card(problem.mount, mount, edges_of(problem.mount, problem.prepared.pieces), problem.top_speed)


def of_delivered(sanity: Sequence[Sanity], card: Card, problem: Problem, delivered: Mount) -> tuple[Sanity, ...]:
    """The same doubts, where what is said of the base's numbers is judged on the delivered model.

    A base alone bends its numbers to stand in for what is missing: an inertia 8 times the card's beside a weight that
    nobody knew of.
    """
    kept = [one for one in sanity if one.finding != BASE_FAR]
    return (*_far(card, problem, delivered), *kept)


def single_readings(given: Sequence[Recording], used: Sequence[Recording]) -> tuple[Sanity, ...]:
    """Say of recordings as they were `given`, and as they are `used`, which readings were false."""
    said = [" ".join(after.notes[len(before.notes) :]) for before, after in zip(given, used, strict=True)]
    return tuple(Sanity(finding="single_readings", statement=text) for text in said if text)


def beyond_denial(sanity: Sequence[Sanity]) -> tuple[Sanity, ...]:
    """Doubts that no model can settle: a unit, a sign, another machine."""
    return tuple(one for one in sanity if one.finding != "clocks")


def without_denied(sanity: Sequence[Sanity], chosen: Fit, stage: Stage) -> tuple[Sanity, ...]:
    """Leave out that position and torque are not of one time, where the model that stands wants no such lag.

    A ripple over the position, a shaking ground or friction that creeps look late to a balance of inertia, friction and
    load. The model knows more: with its effects, what is late is of that size or is not there. `stage` is what was
    tried in addition to them.
    """
    gained = [one for one in stage.tried if one.evidence > 0 and hypothesis_of(one.effect).is_timing]
    fits = [chosen, *(one.fit for one in gained)]
    timing = [one for fit in fits for one in fit.mount.effects if hypothesis_of(one).is_timing]
    lags = [abs(float(getattr(one, one.main.parameter)) / 1e3) for one in timing]  # they count in milliseconds
    return tuple(sanity) if max(lags, default=0.0) >= LATE / 2 else beyond_denial(sanity)


BASE_FAR: Final = "base_far_from_card"
TORQUES = ("friction.Fc", "friction.sigma2")
FELT = 0.1
"""Share of the friction at the highest speed below which a change of a friction number is not felt, however large."""
WORDS = {"axis.inertia": "inertia", "friction.Fc": "Coulomb friction", "friction.sigma2": "viscous friction"}
"""Numbers of the base that any recording in motion tells; what only the slowest motion tells is left out."""
CAUSES = {
    "axis.inertia": "another payload, a gear that one side does not count, or a unit",
    "friction.Fc": "another bearing, brake or temperature, or the torque's unit",
    "friction.sigma2": "another lubricant or temperature, or a term the card lacks that goes with speed",
}


def base_far_from_card(
    card: Mount, refitted: Mount, bounds: Mapping[str, tuple[float, float]], top_speed: float
) -> tuple[Sanity, ...]:
    """Say which numbers of the refitted base leave the card by more than `FAR`, or sit at a bound of the fit.

    Args:
        card: the base as delivered.
        refitted: the same structure with fitted numbers.
        bounds: lowest and highest value of each parameter in the fit.
        top_speed: highest recorded speed [rad/s, m/s]: a viscous friction counts by what it makes there.
    """
    before, after = ({v.name: v for v in one.parameters()} for one in (card, refitted))
    said = []
    for name, words in WORDS.items():
        for full in (one for one in before if one == name or one.startswith(f"{name}.")):
            if full in after and _is_felt(full, before, after, top_speed):
                said += _number_far(full, words, CAUSES[name], before[full], after[full].start, bounds.get(full))
    return tuple(Sanity(finding=BASE_FAR, statement=text, alternatives=()) for text in said)


def _number_far(
    name: str, words: str, causes: str, card: Variable, value: float, bounds: tuple[float, float] | None
) -> list[str]:
    side = {"positive": " forward", "negative": " backward"}.get(name.rsplit(".", 1)[-1], "")
    numbers = f"{card.start:.3g} → {value:.3g} {raised(card.unit)}"
    if bounds and ended_at(value, card.start, bounds) is not None:
        return [
            f"Refitted, the {words}{side} ends at a bound of the fit ({numbers}): it stands in for something else, "
            f"or these recordings do not determine it. Possible causes: {causes}."
        ]
    factor = value / card.start if card.start > 0 else 1.0
    if 1 / FAR <= factor <= FAR:
        return []
    how = f"{factor:.3g} times the card's" if factor > 1 else f"{1 / factor:.3g} times smaller than the card's"
    return [f"Refitted, the {words}{side} is {how} ({numbers}). Possible causes: {causes}."]


def _is_felt(name: str, before: Mapping[str, Variable], after: Mapping[str, Variable], top: float) -> bool:
    """Whether a change of a friction number matters beside the friction at the highest speed."""
    if not name.startswith("friction."):
        return True
    sizes = [
        sum(abs(v.start) * (top if "sigma2" in v.name else 1.0) for v in one.values() if v.name.startswith(TORQUES))
        for one in (before, after)
    ]
    change = abs(after[name].start - before[name].start) * (top if "sigma2" in name else 1.0)
    return change > FELT * max(sizes)


def load_far_from_card(card: Mount, refitted: Mount, positions: Array) -> tuple[Sanity, ...]:
    """Say of a load off the axis that the refitted base turns it into another one.

    Two loads that pull alike at the positions that were recorded [rad] are the same load.
    """
    before, after = (dict(mount.of_kind(GravityUnbalance)) for mount in (card, refitted))
    both = [(load, after[name]) for name, load in before.items() if name in after]
    return tuple(
        Sanity(
            finding=BASE_FAR,
            statement=f"Refitted, the known load is another than the card's ({_words(one)} → {_words(other)}): where "
            "the axis was recorded they differ by more than half of it. Possible causes: another payload or "
            "counterweight, or another zero of the position.",
        )
        for one, other in both
        if rms(_pull(other, positions) - _pull(one, positions)) > POLICY.half * rms(_pull(one, positions))
    )


def _pull(load: GravityUnbalance, positions: Array) -> Array:
    return np.asarray(float(load.mgl) * np.sin(positions + float(load.phase)))


def _words(load: GravityUnbalance) -> str:
    return f"{float(load.mgl):.3g} N·m at {degrees(float(load.phase)):.0f}°"


INERTIA, FRICTION = log(1.6), log(3.0)
"""Factors by which inertia and friction of one machine may differ: it varies with position, and warms up."""
OTHER_CAUSES = (
    Alternative(what="another payload, or another machine", likelihood=0.7),
    Alternative(what="another unit or gear ratio in one of the files", likelihood=0.3),
)
"""No recording tells these apart; files of one machine are mostly exported alike."""


def other_machine(train: Sequence[Balance], heldout: Sequence[Balance]) -> tuple[Sanity, ...]:
    """Say which held-out recordings are of another machine than all training recordings."""
    found = []
    for held in heldout:
        told = [_difference(one, held) for one in train]
        if told and all(told):
            name, text = held.recordings[0].name, told[0]
            said = (
                f"{name} is held out, and is not of the machine of the training recordings: {text}. It proves nothing "
                "about that machine."
            )
            found.append(Sanity(finding="other_machine", statement=said, alternatives=OTHER_CAUSES))
    return tuple(found)


def _difference(train: Balance, held: Balance) -> str:
    """How a held-out recording differs from one of training; empty where it does not."""
    solved = [one.solution(one.own_order) for one in (train, held)]
    pairs = [[getattr(one, name) for one in solved] for name in ("inertia", "coulomb")]
    for words, (before, after), most in zip(("inertia", "friction"), pairs, (INERTIA, FRICTION), strict=True):
        if _differs(before, after, most):
            return f"its {words} is {after.value / before.value:.2g} times that of {train.recordings[0].name}"
    return ""


def _differs(before: Estimate, after: Estimate, most: float) -> bool:
    """Whether two positive numbers differ by more than a factor and their errors allow."""
    if min(before.value, after.value) <= 0:
        return False
    error = hypot(before.error / before.value, after.error / after.value)
    return abs(log(after.value / before.value)) > most + SURELY * error
