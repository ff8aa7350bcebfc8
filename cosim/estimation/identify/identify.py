"""From recordings and a card to a card with identified numbers: whatever the recordings allow, each way side by side.

    friction map   every recording that slides: static friction by direction, and joint
    presliding     recordings without a set point that friction holds: bristle stiffness and damping, linear and direct
    output error   recordings with a set point, where the card has a controller: all free parameters at once

The map gives the static part of the starts, presliding that of the bristles, output error has the last word.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from cosim.data.own_rate import at_own_rate
from cosim.data.recording import Recording
from cosim.estimation.fit import with_values
from cosim.estimation.identify.estimate import Estimate, determined
from cosim.estimation.identify.friction_map import FrictionMap, friction_map
from cosim.estimation.identify.output_error import closed_loop, fit_outputs, output_model
from cosim.estimation.identify.presliding import Presliding, presliding
from cosim.support.errors import InputError
from pyfmi_models.card import Card
from pyfmi_models.friction import LuGre
from pyfmi_models.mount import Mount

NOT_IDENTIFIED = ("torque_limit", "smoothing", "phase", "cycles_per_rev")
HELD = 10.0
"""A recording whose position moves by less than this times break-away over stiffness is held by friction."""


@dataclass(frozen=True)
class Options:
    """What may be chosen: free parameters (none: all of inertia and friction), cut of the map, starts, seed."""

    free: tuple[str, ...] = ()
    cut: float | None = None
    keep_inertia: bool = True
    starts: int = 4
    seed: int = 0


@dataclass(frozen=True)
class Identified:
    """Result: the card with new numbers, what each way found, and what could not be done and why."""

    card: Card
    map: FrictionMap | None
    presliding: dict[str, Presliding]
    output_error: tuple[Estimate, ...]
    not_done: tuple[str, ...]
    kept: tuple[str, ...] = ()
    """Full names of the free parameters that nothing determines: they are the given card's."""

    @property
    def best(self) -> Estimate | None:
        """The output-error estimate from the best start."""
        return self.output_error[0] if self.output_error else None


def identify(
    recordings: Sequence[Recording],
    card: Card,
    options: Options | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> Identified:
    """Identify what the recordings tell; raise InputError where they tell nothing at all."""
    options = options or Options()
    free = free_names(card, options.free)
    steps = [one for one in recordings if is_step(one, card)]
    moves = [one for one in recordings if one not in steps]
    not_done: list[str] = []
    on_progress(f"free: {', '.join(free)}")
    on_progress("friction map")
    found_map = _tried(not_done, "friction map", lambda: _map(moves, card, options))
    on_progress(f"presliding steps: {len(steps)}")
    found_steps = {one.name: presliding(card, one) for one in steps}
    if not steps:
        not_done.append("presliding: no recording without a set point is held by friction.")
    started = _started(card, free, found_map, found_steps)
    found_outputs = _tried(not_done, "output error", lambda: _outputs(moves, started, free, options, on_progress)) or ()
    improved = _with_estimate(started, found_outputs[0]) if found_outputs else started
    sure = {*_determined(found_map, found_steps), *(found_outputs[0].names if found_outputs else ())}
    kept = tuple(name for name in free if name not in sure)
    if len(kept) == len(free):
        raise InputError(f"Nothing can be identified of {', '.join(free)}: {' '.join(not_done)}".rstrip(": "))
    return Identified(improved, found_map, found_steps, tuple(found_outputs), tuple(not_done), kept)


def free_names(card: Card, chosen: Sequence[str]) -> tuple[str, ...]:
    """Full names of the parameters to identify; `chosen` may leave out the prefix (inertia, Fc, friction.Fc).

    Raises:
        InputError: the card's plant has no such parameter.
    """
    known = [v.name for v in card.plant().parameters() if not v.name.endswith(NOT_IDENTIFIED)]
    if not chosen:
        return tuple(name for name in known if name.startswith(("axis.", "friction.")))
    found = []
    for name in chosen:
        matches = [full for full in known if full == name or name in full.split(".")[1:] or full.endswith(f".{name}")]
        if not matches:
            raise InputError(
                f'--free: "{name}" is no parameter of {card.path}; there are: {", ".join(known)}.', culprit=name
            )
        found += matches
    return tuple(dict.fromkeys(found))


def is_step(recording: Recording, card: Card) -> bool:
    """Whether friction holds the axis all through a recording without a set point."""
    law = card.friction
    if "q_d" in recording or "q" not in recording or not isinstance(law, LuGre):
        return False
    reach = float(np.max(law.Fs if law.Fs is not None else law.Fc)) / float(np.min(law.sigma0))
    return bool(np.ptp(recording["q"]) < HELD * reach)


Result = TypeVar("Result")


def _tried(not_done: list[str], name: str, work: Callable[[], Result]) -> Result | None:
    try:
        return work()
    except InputError as error:
        not_done.append(f"{name}: {error}")
        return None


def _map(moves: Sequence[Recording], card: Card, options: Options) -> FrictionMap:
    if not moves:
        raise InputError("every recording is a presliding step.")
    return friction_map(
        [*map(at_own_rate, moves)], card.mount.inertia, options.cut, options.keep_inertia, card.friction
    )


def _outputs(
    moves: Sequence[Recording], card: Card, free: tuple[str, ...], options: Options, on_progress: Callable[[str], None]
) -> list[Estimate]:
    driven = [one for one in moves if "q_d" in one and "q" in one]
    if not driven:
        raise InputError("no moving recording has a set point q_d, which drives the simulated loop.")
    machine = closed_loop(card, free)
    best, *others = fit_outputs(machine, driven, options.starts, options.seed, on_progress)
    on_progress("what these recordings do not determine")
    limits = np.array([(one.low, one.high) for one in (machine.plant.parameters[k] for k in machine.places)])
    own = machine.numbers[machine.places]
    return [determined(best, output_model(machine, driven), own, limits), *others]


def _started(card: Card, free: tuple[str, ...], found: FrictionMap | None, steps: dict[str, Presliding]) -> Card:
    """The card with the map's static friction and the bristles of the presliding steps, where those are free."""
    return with_numbers(card, {name: value for name, value in _determined(found, steps).items() if name in free})


def _determined(found: FrictionMap | None, steps: Mapping[str, Presliding]) -> dict[str, float]:
    """Numbers of the map and of the presliding steps that these determine, by full name."""
    numbers: dict[str, float] = {}
    for direction, fit in found.fits.items() if found else ():
        ends = {
            "" if direction == "both" else f".{direction}",
            "" if found and len(found.fits) == 1 else f".{direction}",
        }
        for end in ends:
            numbers |= {f"friction.{n}{end}": v for n, v in zip(fit.names, fit.values.tolist(), strict=True)}
    for name in ("friction.sigma0", "friction.sigma1"):
        sure = [value for one in steps.values() if (value := one.direct.certain.get(name))]
        if sure:
            numbers[name] = float(np.mean(sure))
    return numbers


def _with_estimate(card: Card, found: Estimate) -> Card:
    return with_numbers(card, dict(zip(found.names, found.values.tolist(), strict=True)))


def with_numbers(card: Card, numbers: dict[str, float]) -> Card:
    """The card with new numbers for the plant's parameters; names that its structure lacks are left out."""
    plant: Mount = card.plant()
    known = {variable.name for variable in plant.parameters()}
    chosen = {name: value for name, value in numbers.items() if name in known}
    new = with_values(plant, tuple(chosen), np.array(list(chosen.values())))
    loads = 1 if card.unbalance else 0
    section = card.mount.model_copy(update={"inertia": float(new.axis.inertia)})
    unbalance = new.effects[0] if loads else None
    return replace(card, mount=section, friction=new.friction, unbalance=unbalance, effects=new.effects[loads:])  # type: ignore[arg-type]
