"""Everything that is doubtful about recordings beside a card, in two steps: before the base is fitted, and after.

The model with its effects may deny one: what is missing from a plain balance looks like two clocks.
"""

from collections.abc import Sequence

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.search.stages import Stage
from cosim.diagnosis.trust.balance import Balance
from cosim.diagnosis.trust.base import BASE_FAR, base_far_from_card, load_far_from_card, other_machine
from cosim.diagnosis.trust.clocks import LATE, clocks
from cosim.diagnosis.trust.judgement import judged
from cosim.diagnosis.trust.likelihood import Reference
from cosim.diagnosis.trust.limits import encoder_step, little_motion, no_set_point, own_set_point, own_torque
from cosim.estimation.fit import Fit, edges_of
from cosim.estimation.problem import Problem
from pyfmi_models.card import Card
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


def without_denied(sanity: Sequence[Sanity], chosen: Fit, beside: Stage) -> tuple[Sanity, ...]:
    """Leave out that position and torque are not of one time, where the model that stands wants no such lag.

    A ripple over the position, a shaking ground or friction that creeps look late to a balance of inertia, friction and
    load. The model knows more: beside its effects, what is late is of that size or is not there. `beside` is what was
    tried beside it.
    """
    gained = [one for one in beside.tried if one.evidence > 0 and hypothesis_of(one.effect).is_timing]
    timing = [one for one in chosen.mount.effects if hypothesis_of(one).is_timing]
    timing += [one.fit.mount.effects[-1] for one in gained]
    lags = [abs(float(getattr(one, one.main.parameter)) / 1e3) for one in timing]  # they count in milliseconds
    return tuple(sanity) if max(lags, default=0.0) >= LATE / 2 else beyond_denial(sanity)
